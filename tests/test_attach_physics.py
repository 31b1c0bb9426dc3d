"""What the attached scene does: end stops, copies, other joints."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from joints import DISCRETE, needs
from scenes import DOOR, EMPTY, LATCH, attached, model_of, profile, swing

from joda import attach
from joda.scenes.scene import read_profiles


# --- the limits' elasticity
def rebound(path: Path, h: float) -> float:
    """Speed after hitting the upper limit over the speed before; mean over the place in a step."""
    m = model_of(path)
    m.opt.timestep = h
    m.opt.gravity[:] = 0
    speeds = []
    for k in range(5):
        d = mujoco.MjData(m)
        d.qvel[0] = 0.5
        d.qpos[0] = 1.5 - (20.1 + k / 5) * h * d.qvel[0]
        while d.time < 0.5:
            mujoco.mj_step(m, d)
        speeds.append(-d.qvel[0] / 0.5)
    return float(np.mean(speeds))


RATIOS = {"none": 1.0, "weak": 0.5, "medium": 0.25, "strong": 0.1}


def restitution(ratio: float) -> float:
    """Of a spring and damper that never pull (Schwager and Pöschel 2007)."""
    if ratio == 1:
        return float(np.exp(-2))
    root = np.sqrt(1 - ratio**2)
    angle = np.pi - np.arctan2(2 * ratio * root, 1 - 2 * ratio**2)
    return float(np.exp(-ratio / root * angle))


@pytest.mark.parametrize("h", [0.005, 0.002, 0.0005])
@pytest.mark.parametrize(
    "limit", ["", 'solreflimit="0.01 2"', 'solreflimit="-2500 -100"', 'solreflimit="0.001 1"']
)
def test_the_rebound_is_that_of_the_hinted_damping_ratio(tmp_path, h, limit):
    option = f"<option timestep='{h}'/>"
    text = DOOR.replace("axis", f"{limit} axis").replace("<worldbody>", option + "<worldbody>")
    for hint, ratio in RATIOS.items():
        given = profile(**EMPTY, hint=hint)
        _, after, notes = attached(tmp_path, text, given, output=f"{hint}.xml")
        if hint == "none":
            assert notes == []
        else:
            assert notes == [
                f"joint 'door' has limits of damping ratio {ratio:g} now ({hint} elasticity; "
                "MuJoCo has one value for both ends)."
            ]
            assert rebound(after, h) == pytest.approx(restitution(ratio), rel=0.12)


def test_the_rebound_grows_with_the_hint(tmp_path):
    speeds = []
    for hint in RATIOS:
        attached(tmp_path, DOOR, profile(**EMPTY, hint=hint), output=f"{hint}.xml")
        speeds.append(rebound(tmp_path / f"{hint}.xml", 0.002))
    assert speeds == sorted(speeds) and speeds[0] < 0.2 and speeds[-1] > 0.7


# --- the scene afterwards
def settles(m: mujoco.MjModel, names: list[str], start: float) -> np.ndarray:
    d = mujoco.MjData(m)
    joints = [m.joint(name) for name in names]
    for joint in joints:
        d.qpos[joint.qposadr] = start
    while d.time < 3:
        mujoco.mj_step(m, d)
    return np.array([d.qpos[joint.qposadr[0]] for joint in joints])


def test_the_scene_does_what_the_profile_says(tmp_path):
    """Constant force F = -0.5 over damping 0.05: shut in a while; without the profile it stays."""
    before, after, _ = attached(tmp_path, DOOR, profile(**LATCH))
    assert settles(model_of(before), ["door"], 0.4) == pytest.approx(0.4)
    assert settles(model_of(after), ["door"], 0.4) == pytest.approx(0, abs=5e-3)


def test_friction_and_damping_come_from_their_rows(tmp_path):
    """Terminal speed (push - friction) / damping, where an explicit damping force diverges."""
    only = profile(force=None, friction=(0.3, 0.3), damping=(500.0, 500.0))
    _, after, _ = attached(tmp_path, DOOR, only)
    m = model_of(after)
    assert 500 * m.opt.timestep * m.dof_invweight0[0] > 2
    d = mujoco.MjData(m)
    d.qfrc_applied[0] = 50.3
    mujoco.mj_step(m, d, 100)
    assert d.qvel[0] == pytest.approx(0.1, rel=1e-5)


def test_other_joints_move_as_they_did(tmp_path):
    """A pendulum beside the door, and one that hangs on it, while the door has nothing to do."""
    bob = '<body pos="{}"><joint name="{}" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body>'
    text = DOOR.replace("</worldbody>", bob.format("0 9 9", "beside") + "</worldbody>")
    text = text.replace("<geom type", bob.format("0 0 5", "on it") + "<geom type")
    before, after, _ = attached(tmp_path, text, profile(**EMPTY))
    paths = []
    for path in (before, after):
        m = model_of(path)
        d = mujoco.MjData(m)
        states = []
        for _ in range(1000):
            mujoco.mj_step(m, d)
            states.append(d.qpos.copy())
        paths.append(np.array(states))
    assert np.ptp(paths[0], axis=0)[1:].min() > 1
    assert paths[0] == pytest.approx(paths[1], abs=1e-6)


def test_inert_equalities_of_a_default_class_stay_inert(tmp_path):
    """A default class for equalities does not reach the row that carries the damping."""
    default = '<default><equality solref="0.002 1" solimp="0.99 0.999" active="false"/></default>'
    text = DOOR.replace("<worldbody>", default + "<worldbody>")
    _, after, _ = attached(tmp_path, text, profile(**(EMPTY | dict(damping=(500.0, 500.0)))))
    m = model_of(after)
    d = mujoco.MjData(m)
    d.qfrc_applied[0] = 50
    mujoco.mj_step(m, d, 100)
    assert d.qvel[0] == pytest.approx(0.1, rel=1e-5)


def test_two_copies_in_a_parent_both_work(tmp_path):
    _, after, _ = attached(tmp_path, DOOR, profile(**LATCH))
    parent = mujoco.MjSpec()
    for side in ("left-", "right-"):
        frame = parent.worldbody.add_frame(pos=[0, 3 if side == "left-" else -3, 0])
        parent.attach(mujoco.MjSpec.from_file(str(after)), frame=frame, prefix=side)
    names = ["left-door", "right-door"]
    m = parent.compile()
    assert settles(m, names, 0.4) == pytest.approx(0, abs=5e-3)
    (tmp_path / "parent.xml").write_text(parent.to_xml())
    found = read_profiles(tmp_path / "parent.xml")
    assert found == {name: profile(name, **LATCH) for name in names}
    assert settles(model_of(tmp_path / "parent.xml"), names, 0.4) == pytest.approx(0, abs=5e-3)


def test_a_prefixed_copy_gets_a_new_profile_without_a_second_row(tmp_path):
    _, after, _ = attached(tmp_path, DOOR, profile(**LATCH))
    parent = mujoco.MjSpec()
    parent.attach(
        mujoco.MjSpec.from_file(str(after)), frame=parent.worldbody.add_frame(), prefix="x-"
    )
    parent.compile()
    (tmp_path / "parent.xml").write_text(parent.to_xml())
    attach(tmp_path / "parent.xml", profile("x-door"), tmp_path / "new.xml")
    assert read_profiles(tmp_path / "new.xml") == {"x-door": profile("x-door")}
    assert model_of(tmp_path / "new.xml").neq == 1


def test_mujocos_own_writer_and_binary_files_keep_the_behaviour(tmp_path):
    _, after, _ = attached(tmp_path)
    m = model_of(after)
    expected = swing(m, 0.8, 0.3, 500)
    spec = mujoco.MjSpec.from_file(str(after))
    assert np.array_equal(swing(spec.compile(), 0.8, 0.3, 500), expected)
    (tmp_path / "again.xml").write_text(spec.to_xml())
    assert swing(model_of(tmp_path / "again.xml"), 0.8, 0.3, 500) == pytest.approx(
        expected, abs=1e-6
    )
    mujoco.mj_saveModel(m, str(tmp_path / "m.mjb"))
    binary = mujoco.MjModel.from_binary_path(str(tmp_path / "m.mjb"))
    assert np.array_equal(swing(binary, 0.8, 0.3, 500), expected)


@needs(DISCRETE)
def test_under_the_discrete_integrator_friction_holds_with_mujocos_stiffest_row(tmp_path):
    """That integrator makes the plugin's rows anew, and MuJoCo's default row creeps."""
    text = DOOR.replace("<worldbody>", '<option integrator="discrete"/><worldbody>', 1)
    assert "discrete" in text
    _, after, notes = attached(tmp_path, text, profile(force=None, friction=(0.3, 0.3)))
    assert any("for integrator discrete" in note for note in notes)
    m = model_of(after)
    m.opt.gravity[:] = 0
    d = mujoco.MjData(m)
    joint = m.joint("door")
    d.qpos[joint.qposadr[0]], d.qfrc_applied[joint.dofadr[0]] = 0.7, 0.28
    mujoco.mj_step(m, d, round(60 / m.opt.timestep))
    assert d.qpos[joint.qposadr[0]] == pytest.approx(0.7, abs=1e-3 * 1.5)
