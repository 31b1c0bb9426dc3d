"""The models that ship in models/: bare joints, plausible masses, gravity as the object has it."""

import warnings as python_warnings
from pathlib import Path
from typing import Literal, NamedTuple

import mujoco
import numpy as np
import pytest
from joints import warnings

from joda import context, generate
from joda.interaction.robot import read_targets
from joda.scenes.motion import play

MODELS = Path(__file__).parents[1] / "models"


class Expected(NamedTuple):
    """What a model is to be: the mass is that of the moving part in kg, the span in rad or m.

    The joints of a robot arm, if there is one, come after the joint of the object.
    """

    joint: str
    mass: tuple[float, float]
    span: float
    gravity: Literal["opens", "closes below 90 degrees", "none"]
    arm: tuple[str, ...] = ()


EXPECTED = {
    "cabinet": Expected("door", (2, 4), 1.6, "opens"),
    "dishwasher": Expected("door", (6, 10), 1.5, "opens"),
    "drawer": Expected("drawer", (4, 6), 0.45, "none"),
    "knob": Expected("knob", (0.015, 0.035), 4.71, "none"),
    "laptop": Expected("lid", (0.3, 0.7), 2.3, "closes below 90 degrees"),
    "lighter": Expected("button", (0.001, 0.003), 0.006, "opens"),
    "microwave": Expected("door", (1, 2.5), 1.92, "none", ("arm_pan", "arm_shoulder", "arm_elbow")),
    "oven": Expected("door", (4, 8), 1.57, "opens"),
    "refrigerator": Expected("door", (9, 15), 2.1, "none"),
    "switch": Expected("rocker", (0.008, 0.016), 0.4, "none"),
}
each = pytest.mark.parametrize("name", EXPECTED)


def path(name):
    return MODELS / f"{name}.xml"


def load(name):
    """The model with its data, compiled with every warning an error."""
    said = []
    mujoco.set_mju_user_warning(said.append)
    try:
        with python_warnings.catch_warnings():
            python_warnings.simplefilter("error")
            model = mujoco.MjModel.from_xml_path(str(path(name)))
    finally:
        mujoco.set_mju_user_warning(None)
    assert said == []
    return model, mujoco.MjData(model)


def test_every_model_is_listed():
    assert {file.stem for file in MODELS.glob("*.xml")} == set(EXPECTED)


@each
def test_the_joint_is_bare(name):
    model, _ = load(name)
    names = (EXPECTED[name].joint, *EXPECTED[name].arm)
    assert tuple(model.joint(k).name for k in range(model.njnt)) == names
    assert (model.nq, model.nv) == (model.njnt, model.njnt)
    assert model.jnt_limited[0]
    assert model.jnt_range[0] == pytest.approx((0, EXPECTED[name].span))
    native = (model.dof_damping, model.dof_frictionloss, model.dof_armature, model.jnt_stiffness)
    assert not np.any(native, where=np.arange(model.nv) == 0)
    driven = [model.joint(joint).name for joint in model.actuator_trnid[:, 0]]
    assert driven == list(EXPECTED[name].arm)
    assert (model.ntendon, model.neq) == (0, 0)
    assert np.all(model.body_rootid[model.jnt_bodyid[1:]] != model.body_rootid[model.jnt_bodyid[0]])


@each
def test_the_mass_of_what_moves_and_the_closed_end(name):
    found = context(path(name), EXPECTED[name].joint)
    low, high = EXPECTED[name].mass
    assert low <= found.moving_mass <= high
    assert found.closed_end == "low_end"


@each
def test_inertia_is_that_of_a_body_within_reach(name):
    """A slide carries its mass; a hinge at most its mass at the farthest point of what moves."""
    model, data = load(name)
    found = context(path(name), EXPECTED[name].joint)
    if model.jnt_type[0] == mujoco.mjtJoint.mjJNT_SLIDE:
        assert found.inertia == pytest.approx(np.full(21, found.moving_mass))
        return
    mujoco.mj_forward(model, data)
    moving = np.flatnonzero(model.geom_bodyid == model.jnt_bodyid[0])
    away = data.geom_xpos[moving] - data.xanchor[0]
    away -= np.outer(away @ data.xaxis[0], data.xaxis[0])
    reach = np.max(np.linalg.norm(away, axis=1) + model.geom_rbound[moving])
    assert 0 < found.equivalent_inertia < found.moving_mass * reach**2


@each
def test_gravity_acts_as_on_the_object(name):
    found = context(path(name), EXPECTED[name].joint)
    force, positions = np.array(found.gravity_force), np.array(found.positions)
    weight = found.moving_mass * 9.81
    match EXPECTED[name].gravity:
        case "opens":
            assert np.all(force > 0)
        case "closes below 90 degrees":
            below = positions < np.pi / 2 - 0.1
            assert np.all(force[below] < 0)
            assert np.all(force[positions > np.pi / 2 + 0.1] > 0)
        case "none":  # of a hinge: a lever arm of less than a millimetre
            assert np.all(np.abs(force) < 1e-3 * weight)


@each
def test_nothing_touches_along_the_motion(name):
    model, data = load(name)
    for data.qpos[0] in np.linspace(*model.jnt_range[0], 101):
        mujoco.mj_forward(model, data)
        assert data.ncon == 0


@each
def test_five_seconds_of_random_pushes(name):
    """Bounded motion, no warning and no contact under gravity and forces of about the weight's."""
    model, data = load(name)
    found = context(path(name), EXPECTED[name].joint)
    span = EXPECTED[name].span
    size = max(0.1 * found.gravity_scale, found.equivalent_inertia * span)
    random = np.random.default_rng(0)
    for k in range(round(5 / model.opt.timestep)):
        if k % round(0.2 / model.opt.timestep) == 0:
            data.qfrc_applied[0] = size * random.standard_normal()
        mujoco.mj_step(model, data)
        assert data.ncon == 0
        assert -0.15 * span < data.qpos[0] < 1.15 * span  # stops yield a little
    assert warnings(data) == 0


@each
def test_the_front_camera_sees_what_moves(name):
    """The body's centre of mass lies within the picture at both ends of the motion."""
    model, data = load(name)
    camera = model.camera("front").id
    tangent = np.tan(np.radians(model.cam_fovy[camera]) / 2)
    for data.qpos[0] in model.jnt_range[0]:
        mujoco.mj_forward(model, data)
        away = data.subtree_com[model.jnt_bodyid[0]] - data.cam_xpos[camera]
        x, y, z = data.cam_xmat[camera].reshape(3, 3).T @ away
        assert z < 0
        assert np.hypot(x, y) < -z * tangent


RELEASED = np.pi / 3
"""Where the microwave's door is when the arm comes, rad."""

SLIGHT_PUSH, TWO_PUSHES = "microwave.push.csv", "microwave.two_pushes.csv"
"""The arm comes beside the door's top, at its outside, and pushes. The door moves at 2 rad/s when
the tip stops, at 0.14 rad, where the latch begins. Later the arm pushes it 7 mm beyond its closed
surface."""


def pushed(model, pushes):
    """The door's positions, rad, one per step, while the arm pushes and for two seconds more."""
    said = []

    def watch(data):
        touching = {model.geom(k).name for contact in data.contact for k in contact.geom}
        assert touching in (set(), {"arm_tip", "door_panel"})
        said.append(warnings(data))

    targets = read_targets(MODELS / pushes, model)
    motion = play(model, 0, RELEASED, targets, targets.time[-1] + 2, watch)
    assert not any(said)
    return motion.position


@pytest.fixture(scope="module", params=["", "1", "2", "3", "4"])
def latched(request, tmp_path_factory):
    """The microwave with the offline proposer's profile, compiled with one of several keys."""
    folder = tmp_path_factory.mktemp("microwave")
    generate(path("microwave"), "door", folder, proposer="offline", key=request.param)
    return mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))


def test_the_arm_stays_at_home():
    """Home is where the model starts, targets of 0 hold it, and the door swings past it freely."""
    model, data = load("microwave")
    assert model.key("home").qpos == pytest.approx(model.qpos0)
    assert np.all(model.key("home").ctrl == 0)
    tip = model.site("arm_tip").id
    mujoco.mj_forward(model, data)
    start = data.site_xpos[tip].copy()
    for speed in (4, -4):
        data.joint("door").qvel = speed
        for _ in range(round(1 / model.opt.timestep)):
            mujoco.mj_step(model, data)
            assert data.ncon == 0
            assert data.site_xpos[tip] == pytest.approx(start, abs=1e-4)


def test_the_door_clears_the_arm_at_home():
    """By two centimetres at least, wherever the door is."""
    model, data = load("microwave")
    arm = [k for k in range(model.ngeom) if model.geom(k).name.startswith("arm_")]
    door = [model.geom(name).id for name in ("door_panel", "door_handle")]
    assert len(arm) == 6
    for data.qpos[0] in np.linspace(*model.jnt_range[0], 101):
        mujoco.mj_forward(model, data)
        assert all(
            mujoco.mj_geomDistance(model, data, a, b, 1, None) > 0.02 for a in arm for b in door
        )


@pytest.mark.sweep(2)
def test_a_slight_push_does_not_latch_the_microwave(latched):
    """The door leaves the tip, comes to the latch, and rests or is thrown back there."""
    s = pushed(latched, SLIGHT_PUSH) / EXPECTED["microwave"].span
    assert np.all(s > 0.04)
    assert 0.06 < s[-1] < 0.1
    assert np.all(s[-1000:] == pytest.approx(s[-1], abs=1e-3))


@pytest.mark.sweep(2)
def test_an_additional_push_latches_the_microwave(latched):
    """It is still latched when the arm has gone home."""
    s = pushed(latched, TWO_PUSHES) / EXPECTED["microwave"].span
    assert np.all(np.abs(s[-1000:]) < 0.005)
    assert s[round(4 / latched.opt.timestep)] > 0.06


@pytest.mark.parametrize("latched", [""], indirect=True)
def test_the_latch_throws_the_slightly_pushed_door_back(latched):
    s = pushed(latched, SLIGHT_PUSH) / EXPECTED["microwave"].span
    assert s[-1] > s.min() + 0.01


def test_with_constant_damping_alone_the_slight_push_shuts_the_microwave():
    model, _ = load("microwave")
    model.dof_damping[0] = 0.3
    s = pushed(model, SLIGHT_PUSH) / EXPECTED["microwave"].span
    left = round(1.55 / model.opt.timestep)
    assert s[left] > 0.03
    assert s.min() <= 0
    assert s[-1] < 0.03
