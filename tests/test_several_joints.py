"""Logs of several joints: what the others do to one, each by itself, and all at once."""

import json
import re
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from joda import JodaError, compare, compare_all, diagnose_all, improve_all
from joda.measured.contact_samples import NEAR, touching
from joda.measured.coupling import coupling_force
from joda.measured.reading import read_measured
from joda.measured.scene_replay import replayed_together

ARM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 1 0" range="-2 2" limited="true" damping=".1"/>
      <inertial pos="0.2 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
      <body pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" range="-2 2" limited="true" damping=".05"/>
        <inertial pos="0.15 0 0" mass="0.8" diaginertia="0.01 0.01 0.01"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="first" joint="shoulder" kp="80" kv="6"/>
    <position name="second" joint="elbow" kp="{kp}" kv="1.5"/>
  </actuator>
</mujoco>
"""
NOISE = 3e-4


def model(folder, kp=30.0):
    path = folder / f"arm_{kp:g}.xml"
    path.write_text(ARM.format(kp=kp))
    return path


def log(path, seed, seconds=6.0, header=True, kp=30.0):
    """The arm in MuJoCo under smooth commands of both joints, logged at 100 Hz."""
    arm = mujoco.MjModel.from_xml_string(ARM.format(kp=kp))
    data, rng, rows = mujoco.MjData(arm), np.random.default_rng(seed), []
    pace, phase = rng.uniform(0.3, 1.0, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))

    def command(time):
        ramp = 1 - np.exp(-(time**2))  # it begins at rest
        return 0.3 * ramp * np.sin(2 * np.pi * pace * time + phase).sum(axis=1)

    weight = [0.2 * 9.81 + 0.8 * 9.81 * 0.55, 0.8 * 9.81 * 0.15]
    data.qpos[:] = np.array(weight) / (80, kp)  # where the servos hold it
    data.qvel[:] = 0.0
    for _ in range(2000):
        mujoco.mj_step(arm, data)
    data.time = 0.0
    for _ in range(round(seconds * 100)):
        data.ctrl[:] = command(data.time)
        rows.append((data.time, *(data.qpos + rng.normal(0, NOISE, 2)), *data.ctrl))
        mujoco.mj_step(arm, data, 5)
    names = "time,position:shoulder,position:elbow,ctrl:first,ctrl:second"
    path.write_text("\n".join([names, *(",".join(f"{x:.7f}" for x in row) for row in rows)]) + "\n")
    return path


def logs(folder, count=2, **more):
    seeds = np.random.SeedSequence().generate_state(count)
    return [log(folder / f"log{k}.csv", int(seed), **more) for k, seed in enumerate(seeds)]


TABLE = """<mujoco><compiler angle="radian"/><worldbody>
  <geom name="table" type="plane" pos="0 0 -.3" size="2 2 .1"/>
  <body>
    <joint name="shoulder" axis="0 1 0" range="-2 2" limited="true"/>
    <geom type="box" size=".2 .01 .01" pos=".2 0 .1"/>
    <body pos=".4 0 0">
      <joint name="elbow" axis="0 1 0" range="-2 2" limited="true"/>
      <geom name="tip" type="sphere" size=".02" pos=".3 0 0"/>
      <body pos=".3 0 .1"><joint name="jaw" type="slide" axis="1 0 0" range="0 .1" limited="true"/>
        <geom size=".01" pos="0 0 .3" contype="0" conaffinity="0"/></body>
    </body>
  </body></worldbody></mujoco>"""


def test_touches_are_found_where_geometry_has_them():
    arm = mujoco.MjModel.from_xml_string(TABLE)
    rng = np.random.default_rng()
    q = np.stack([rng.uniform(0, 0.8, 400), rng.uniform(-0.6, 0.6, 400), np.zeros(400)])
    height = -0.4 * np.sin(q[0]) - 0.3 * np.sin(q[:2].sum(axis=0)) - 0.02 + 0.3
    ids = {name: arm.joint(name).id for name in ("shoulder", "elbow", "jaw")}
    positions = {ids[name]: own for name, own in zip(ids, q, strict=True)}
    for name, arms in (("shoulder", (0.6, 0.72)), ("elbow", (0.28, 0.32))):
        inside, pairs = touching(arm, ids[name], positions)
        near = [NEAR * length for length in arms]  # how far the place of contact is from the joint
        sure, never = height < near[0], height > near[1] + 0.002
        beside = np.convolve(~never, np.ones(5), mode="same") > 0
        assert 20 < inside.sum() < 380 and ("tip", "table") in pairs
        assert inside[sure].all() and not inside[~beside].any()
    assert not touching(arm, ids["jaw"], positions)[0].any()  # the tip does not move with it


def test_what_always_touches_is_no_touch():
    rests = TABLE.replace('pos="0 0 -.3"', 'pos="0 0 -.02"')
    arm = mujoco.MjModel.from_xml_string(rests)
    still = {0: np.zeros(50), 1: np.zeros(50)}
    assert not touching(arm, 0, still)[0].any()


def test_where_the_scene_touches_is_left_out_and_said(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(TABLE)
    time = np.arange(400) / 100
    q, u = 0.45 - 0.35 * np.cos(2 * time), 0.1 * np.sin(3 * time)
    rows = "".join(f"{t:.3f},{a:.6f},{b:.6f}\n" for t, a, b in zip(time, q, u, strict=True))
    (tmp_path / "run.csv").write_text("time,position:shoulder,position:elbow\n" + rows)
    found = read_measured(path, "elbow", [tmp_path / "run.csv"])
    (told,) = [note for note in found.notes if "left out" in note]
    count = int(re.search(r"run.csv: (\d+) of 400 samples", told).group(1))
    low = -0.4 * np.sin(q) - 0.3 * np.sin(q + u) - 0.02 + 0.3 < 0
    assert low.sum() <= count < 390 and "'tip' 'table'" in told
    gone = np.concatenate([run.time for run in found.runs])[
        np.isnan(np.concatenate([run.force for run in found.runs]))
    ]
    assert set(time[low & (time > 0.16) & (time < 3.83)].round(3)) <= set(gone.round(3))


def test_the_force_of_the_others_is_that_of_a_planar_arm():
    """Two-link arm in closed form (Craig, Introduction to Robotics, section 6.7), rods of one
    point mass each and inertias about it."""
    arm = mujoco.MjModel.from_xml_string(ARM.format(kp=30))
    time = np.linspace(0, 4, 801)
    q = np.stack([0.8 * np.sin(2.1 * time), 0.7 * np.cos(1.7 * time)])
    v = np.stack([0.8 * 2.1 * np.cos(2.1 * time), -0.7 * 1.7 * np.sin(1.7 * time)])
    a = np.stack([-(2.1**2) * q[0], -(1.7**2) * q[1]])
    m2, l1, c2 = 0.8, 0.4, 0.15
    cos = np.cos(q[1])
    inertia = 0.01 + m2 * c2**2
    torque = (
        inertia * (a[0] + a[1])
        + m2 * l1 * c2 * (cos * a[0] + np.sin(q[1]) * v[0] ** 2)
        - m2 * 9.81 * c2 * np.cos(q[0] + q[1])  # about +y a weight at +x pulls towards +q
    )
    alone = inertia * a[1] - m2 * 9.81 * c2 * np.cos(q[1])
    found = coupling_force(arm, 1, time, {0: q[0], 1: q[1]})
    inner = slice(40, -40)  # the ends are smoothed from one side
    np.testing.assert_allclose(found[inner], (alone - torque)[inner], atol=0.02)
    assert np.ptp(found) > 1.0


@pytest.mark.slow
def test_each_joint_is_replayed_among_the_others(tmp_path):
    runs = logs(tmp_path)
    for joint in ("shoulder", "elbow"):
        found = compare(model(tmp_path), joint, runs)
        assert found.rmse < 5 * NOISE, joint
    wrong = compare(model(tmp_path, kp=20.0), "elbow", runs)
    assert wrong.rmse > 20 * NOISE


@pytest.mark.slow
def test_all_at_once_are_replayed_in_the_scene(tmp_path):
    runs = logs(tmp_path)
    arm = mujoco.MjModel.from_xml_path(str(model(tmp_path)))
    for one in replayed_together(arm, runs):
        assert max(one.rmse.values()) < 2 * NOISE
    found = compare_all(model(tmp_path, kp=20.0), runs, json=tmp_path / "c.json")
    assert list(found.joints) == ["shoulder", "elbow"]
    assert found.rmse("elbow") > 20 * NOISE
    written = json.loads((tmp_path / "c.json").read_text())["joints"]
    assert written["elbow"]["rmse_together"] == found.rmse("elbow")
    assert written["shoulder"]["rmse"] == found.joints["shoulder"].rmse


def test_all_at_once_forces_act_empty_commands_are_held_and_names_may_lack(tmp_path):
    """A pendulum that a force pushes, beside a servo without a name."""
    text = ARM.format(kp=30).replace('name="second" ', "")
    arm = mujoco.MjModel.from_xml_string(text)
    data, rows = mujoco.MjData(arm), []
    for k in range(300):
        force, command = 0.8 * np.sin(2 * data.time), 0.1 * (k // 10 % 3)
        cell = f"{command}" if k % 10 == 0 else ""
        rows.append(f"{data.time:.4f},{data.qpos[0]:.9f},{data.qpos[1]:.9f},{force:.9f},0,{cell}")
        data.ctrl[1] = command
        for _ in range(5):
            data.qfrc_applied[0] = 0.8 * np.sin(2 * data.time)
            mujoco.mj_step(arm, data)
    head = "time,position:shoulder,position:elbow,force:shoulder,ctrl:first,ctrl:actuator 1"
    run = tmp_path / "log.csv"
    run.write_text("\n".join([head, *rows]) + "\n")
    (found,) = replayed_together(arm, [run])
    assert max(found.rmse.values()) < 1e-3  # it is let go: its first velocity is smoothed
    run.write_text(run.read_text().replace(rows[9], rows[9].replace(rows[9].split(",")[3], "")))
    assert replayed_together(arm, [run]) == ()


def test_an_unstable_scene_has_no_error_and_no_warning(tmp_path, capfd):
    run = log(tmp_path / "log.csv", 0, seconds=1.0)
    wild = mujoco.MjModel.from_xml_string(ARM.format(kp=1e9))
    (found,) = replayed_together(wild, [run])
    assert set(found.rmse.values()) == {None}
    assert capfd.readouterr().err == ""


@pytest.mark.long
def test_the_joint_whose_gain_is_off_is_found_and_mended(tmp_path):
    runs, given = logs(tmp_path, 3), model(tmp_path, kp=60.0)
    found = diagnose_all(given, runs, ["elbow"], json=tmp_path / "d.json")
    by_name = {one.parameter: one for one in found["elbow"].corrections}
    assert abs(by_name["actuator_gain"].value - 30) < 1.5
    assert "time_delay" not in by_name
    written = json.loads((tmp_path / "d.json").read_text())["joints"]["elbow"]
    assert written["verdict"] == found["elbow"].verdict

    done = improve_all(given, runs, tmp_path / "new.xml")
    assert list(done) == ["shoulder", "elbow"] and done["shoulder"].scene is None
    assert done["elbow"].picture == tmp_path / "new.elbow.png" and done["elbow"].picture.exists()
    new = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    assert new.actuator_gainprm[:, 0] == pytest.approx([80, 30], rel=0.03)
    assert compare_all(tmp_path / "new.xml", runs).rmse("elbow") < 6 * NOISE


def test_a_joint_that_the_log_has_not_stays_at_its_reference(tmp_path):
    run = log(tmp_path / "log.csv", 0)
    text = run.read_text().replace("position:shoulder", "position:lamp")
    run.write_text(text)
    (note,) = (n for n in read_measured(model(tmp_path), "elbow", [run]).notes if "held" in n)
    assert note == "log.csv: has no positions of 'shoulder': held at the model's reference."


@pytest.mark.slow
def test_pictures_are_of_one_joint(tmp_path):
    run = log(tmp_path / "log.csv", 0, seconds=1.0)
    command = [sys.executable, "-m", "joda", "compare", str(model(tmp_path)), str(run)]
    for option, name in (("--report", "r.html"), ("-o", "p.png")):
        found = subprocess.run(
            [*command, option, str(tmp_path / name)], capture_output=True, text=True
        )
        assert found.returncode == 2
        assert f"{option} is of one joint; name it with --joint, or use --json." in found.stderr
    told = subprocess.run(command, capture_output=True, text=True)
    assert told.returncode == 0 and "all joints at once" in told.stdout


def test_a_driven_joint_of_such_a_log_needs_its_command_too(tmp_path):
    run = log(tmp_path / "log.csv", 0, seconds=2.0)
    run.write_text(run.read_text().replace("ctrl:second", "ctrl:lamp"))
    with pytest.raises(JodaError, match="the run has neither a column 'ctrl:second' nor 'force'"):
        read_measured(model(tmp_path), "elbow", [run])
    assert read_measured(model(tmp_path), "elbow", [run], passive=True).runs[0].command is None
    assert read_measured(model(tmp_path), "shoulder", [run]).runs[0].command is not None


def test_without_a_command_not_all_is_replayed_at_once(tmp_path):
    run = log(tmp_path / "log.csv", 0, seconds=1.0)
    run.write_text(run.read_text().replace("ctrl:second", "ctrl:lamp"))
    arm = mujoco.MjModel.from_xml_path(str(model(tmp_path)))
    assert replayed_together(arm, [run]) == ()
    run.write_text(run.read_text().replace("position:", "speed:"))
    with pytest.raises(
        JodaError, match=r"log\.csv: no column 'position:JOINT' of a hinge or slide"
    ):
        replayed_together(arm, [run])


def test_a_log_of_one_joint_needs_its_name(tmp_path):
    run = tmp_path / "one.csv"
    run.write_text("\n".join(["time,position", *(f"{k / 50},{k / 100}" for k in range(60))]))
    with pytest.raises(
        JodaError, match=r"one\.csv: has no columns 'position:JOINT' of the model's"
    ):
        compare_all(model(tmp_path), [run])
