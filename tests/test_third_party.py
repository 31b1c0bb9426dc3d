"""Profiles on other people's scenes: they load, keep what they were, and stay stable."""

import os
import secrets
import subprocess

import mujoco
import numpy as np
import pytest
from assets import NAMES, asset

from joda import attach
from joda.component import Component
from joda.profile import Channel, Channels, Profile, Resistance
from joda.scenes.model import describe_joint, joint_type, load_model
from joda.scenes.motion import release
from joda.scenes.scene import read_profiles

TIME = 0.1  # in which a scale's worth of force moves the joint through half its range, s
MOVABLE = {"microwave": 1, "cabinet": 3, "table": 4, "kitchen": 14, "drawer": 1, "door": 2}


def scale(model, joint) -> float:
    """A force (N, N·m) that suits the joint: inertia * range / TIME^2."""
    span = np.ptp(model.jnt_range[joint])
    return float(span / model.dof_invweight0[model.jnt_dofadr[joint]] / TIME**2)


def flat(label, value) -> Resistance:
    return Resistance(
        components=(Component(label=label, interval=(0, 1), x=(0, 1), y=(value,) * 2),)
    )


def generic(model, joint) -> Profile:
    """A latch at the low end, a detent, friction and damping, all of the joint's own size."""
    force = scale(model, joint)
    latch = Component(label="latch", interval=(0, 0.1), x=(0, 0.5, 1), y=(-force, -force, 0))
    detent = Component(
        label="detent",
        interval=(0.45, 0.55),
        x=(0, 0.25, 0.5, 0.75, 1),
        y=(0, 0.5 * force, 0, -0.5 * force, 0),
    )
    return Profile(
        joint=describe_joint(model, joint),
        channels=Channels(
            conservative=Channel(components=(latch, detent)),
            friction=flat("hinge", 0.1 * force),
            damping=flat("hinge", 0.5 * force * TIME / np.ptp(model.jnt_range[joint])),
        ),
    )


def movable(model) -> list[int]:
    """Hinges and slides that are no robot's."""
    return [
        k
        for k in range(model.njnt)
        if joint_type(model, k) in ("hinge", "slide")
        and not model.joint(k).name.startswith("robot:")
    ]


@pytest.mark.parametrize(("CI", "outcome"), [("", "Skipped"), ("true", "Failed")])
def test_a_failed_download_skips_here_and_fails_in_ci(tmp_path, monkeypatch, CI, outcome):
    failure = subprocess.CompletedProcess([], 1, "", "ERROR: No matching distribution\n")
    monkeypatch.setattr("assets.CACHE", tmp_path)
    monkeypatch.setattr("assets.subprocess.run", lambda *_, **__: failure)
    monkeypatch.setenv("CI", CI)
    with pytest.raises(
        BaseException, match=r"==.* failed: ERROR: No matching distribution"
    ) as error:
        asset("kitchen")
    assert error.typename == outcome


@pytest.fixture(scope="module", params=NAMES)
def scenes(request, tmp_path_factory):
    """The scene as it is, and a copy with the generic profile on all of its joints."""
    path = asset(request.param)
    before = load_model(path)
    joints = movable(before)
    assert len(joints) == MOVABLE[request.param]
    profiles = [generic(before, joint) for joint in joints]
    output = tmp_path_factory.mktemp(request.param) / "scene.xml"
    attach(path, profiles, output)
    return before, output, profiles


def test_all_profiles_are_read_back(scenes):
    _, output, profiles = scenes
    assert list(read_profiles(output).values()) == profiles


@pytest.mark.slow
def test_all_else_of_the_model_is_as_it_was(scenes):
    before, output, _ = scenes
    after = load_model(output)
    for name in ("body_mass", "body_inertia", "geom_size", "jnt_range", "mesh_vert", "tex_data"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name), 1e-4, 1e-6)
    others = np.setdiff1d(np.arange(before.nv), before.jnt_dofadr[movable(before)])
    for name in ("dof_damping", "dof_frictionloss", "dof_armature"):
        assert (getattr(after, name)[others] == getattr(before, name)[others]).all()


@pytest.mark.slow
@pytest.mark.parametrize("contact", [True, False], ids=["contact", "no contact"])
def test_stable_for_a_minute_under_random_forces(scenes, contact):
    seed = int(os.environ.get("JODA_SEED", secrets.randbits(32)))
    print(f"JODA_SEED={seed}")
    random = np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_path(str(scenes[1]))
    if not contact:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    joints = movable(model)
    forces = np.array([scale(model, joint) for joint in joints])
    dofs, places = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
    lowest, highest = data.qpos[places], data.qpos[places]
    while data.time < 60:
        data.qfrc_applied[dofs] = forces * random.uniform(-3, 3, len(forces))
        for _ in range(random.integers(1, 20)):
            mujoco.mj_step(model, data, 5)
            lowest = np.minimum(lowest, data.qpos[places])
            highest = np.maximum(highest, data.qpos[places])
        assert np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()
    assert [warning.number for warning in data.warning] == [0] * len(data.warning)
    spans = np.ptp(model.jnt_range[joints], axis=1)
    assert ((highest - lowest) / spans < 2).all()
    if not contact:  # with it, parts of the table that overlap hold each other
        assert ((highest - lowest) / spans > 0.9).all(), "joints were to move through their range"


def test_the_kitchens_knobs_stand_their_native_damping(tmp_path):
    """h C / inertia is 3.9: an explicit damping force would diverge; speed goes to force / C."""
    path = asset("kitchen")
    before = load_model(path)
    joints = [before.joint(f"knob_Joint_{k}") for k in (1, 2, 3, 4)]
    dofs = [joint.dofadr[0] for joint in joints]
    ratio = before.opt.timestep * before.dof_damping[dofs] * before.dof_invweight0[dofs]
    assert ratio == pytest.approx(3.92, abs=0.01)
    profiles = [
        Profile(
            joint=describe_joint(before, joint.id),
            channels=Channels(damping=flat("grease", float(before.dof_damping[joint.dofadr[0]]))),
        )
        for joint in joints
    ]
    attach(path, profiles, tmp_path / "kitchen.xml")
    model = load_model(tmp_path / "kitchen.xml")
    data = mujoco.MjData(model)
    assert (model.dof_damping[dofs] == 0).all()
    data.qpos[model.jnt_qposadr[[joint.id for joint in joints]]] = -1
    data.qfrc_applied[dofs] = 0.2
    mujoco.mj_step(model, data, 50)
    # the equalities that tie knobs to burners add 0.3 %
    assert data.qvel[dofs] == pytest.approx(0.1, rel=5e-3)
    assert [warning.number for warning in data.warning] == [0] * len(data.warning)


def test_a_latch_shuts_the_microwave_that_stays_open_without(tmp_path):
    """Let go at rest nearly closed (0 is shut, -2.094 open), as it comes and with a snap latch."""
    path = asset("microwave")
    door = describe_joint(load_model(path), 0)
    latch = Component(
        label="snap latch", interval=(0.95, 1), x=(0, 0.25, 0.5, 1), y=(0, -0.3, 0, 2)
    )
    profile = Profile(
        joint=door,
        channels=Channels(
            conservative=Channel(components=(latch,)),
            friction=flat("hinge", 0.05),
            damping=flat("hinge", 0.05),
        ),
    )
    attach(path, profile, tmp_path / "scene.xml")
    ends = [
        release(load_model(scene), 0, -0.04, 1.0).position[-1]
        for scene in (path, tmp_path / "scene.xml")
    ]
    assert ends[0] == pytest.approx(-0.04, abs=1e-3)
    assert ends[1] == pytest.approx(0, abs=2e-3)
    away = release(load_model(tmp_path / "scene.xml"), 0, -1.0, 1.0).position
    assert away[-1] == pytest.approx(-1.0, abs=1e-6)
