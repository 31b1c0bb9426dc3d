"""The models that ship in models/: bare joints, plausible masses, gravity as the object has it."""

import warnings as python_warnings
from pathlib import Path
from typing import Literal, NamedTuple

import mujoco
import numpy as np
import pytest
from joints import warnings

from joda import context

MODELS = Path(__file__).parents[1] / "models"


class Expected(NamedTuple):
    """What a model is to be: the mass is that of the moving part in kg, the span in rad or m."""

    joint: str
    mass: tuple[float, float]
    span: float
    gravity: Literal["opens", "closes below 90 degrees", "none"]


EXPECTED = {
    "cabinet": Expected("door", (2, 4), 1.6, "opens"),
    "dishwasher": Expected("door", (6, 10), 1.5, "opens"),
    "drawer": Expected("drawer", (4, 6), 0.45, "none"),
    "knob": Expected("knob", (0.015, 0.035), 4.71, "none"),
    "laptop": Expected("lid", (0.3, 0.7), 2.3, "closes below 90 degrees"),
    "lighter": Expected("button", (0.001, 0.003), 0.006, "opens"),
    "microwave": Expected("door", (1, 2.5), 1.92, "none"),
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
def test_the_one_joint_is_bare(name):
    model, _ = load(name)
    assert (model.njnt, model.nq, model.nv) == (1, 1, 1)
    assert model.joint(0).name == EXPECTED[name].joint
    assert model.jnt_limited[0]
    assert model.jnt_range[0] == pytest.approx((0, EXPECTED[name].span))
    native = (model.dof_damping, model.dof_frictionloss, model.dof_armature, model.jnt_stiffness)
    assert not np.any(native)
    assert (model.nu, model.ntendon, model.neq) == (0, 0, 0)


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
        if k % 100 == 0:
            data.qfrc_applied[0] = size * random.standard_normal()
        mujoco.mj_step(model, data)
        assert data.ncon == 0
        assert -0.1 * span < data.qpos[0] < 1.1 * span
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
