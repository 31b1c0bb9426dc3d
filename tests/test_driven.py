"""Joints that an actuator acts on, and columns of logs that are not read yet."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest
from scenes import write

from joda import JodaError, add, attach, compare, context, diagnose, improve, refine
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.profile import Profile
from joda.scenes.actuators import actuators_on

ARM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="arm">
      <joint name="elbow" axis="0 0 1" range="-1.5 1.5" limited="true" damping=".05"/>
      <geom name="link" type="capsule" fromto="0 0 0 .4 0 0" size=".03" mass="1"/>
      <site name="hand" pos=".4 0 0"/>
      <body pos=".4 0 0">
        <joint name="wrist" axis="0 0 1" range="-1 1" limited="true"/>
        <geom type="sphere" size=".03" mass=".1"/>
      </body>
    </body>
    <site name="anchor" pos=".5 .5 0"/>
    <body name="wheel" pos="-.3 0 0">
      <joint name="crank" axis="0 0 1" range="-3 3" limited="true"/>
      <geom type="cylinder" size=".1 .01" mass=".2"/>
      <site name="pin" pos=".1 0 0"/>
    </body>
    <site name="slider" pos="-.8 0 0" euler="0 1.5708 0"/>
  </worldbody>
  <tendon>
    <fixed name="both"><joint joint="elbow" coef="1"/><joint joint="wrist" coef="-1"/></fixed>
    <spatial name="cable"><site site="anchor"/><site site="hand"/></spatial>
  </tendon>
  <actuator>{actuator}</actuator>
</mujoco>
"""
SERVO = '<position name="servo" joint="elbow" kp="50"/>'


def acting(actuator, joint="elbow", extra=""):
    text = ARM.format(actuator=actuator).replace("<worldbody>", f"{extra}<worldbody>")
    model = mujoco.MjModel.from_xml_string(text)
    return actuators_on(model, model.joint(joint).id)


@pytest.mark.parametrize(
    ("actuator", "joint", "named"),
    [
        (SERVO, "elbow", ("servo",)),
        (SERVO, "wrist", ()),
        ('<motor joint="elbow"/>', "elbow", ("actuator 0",)),
        ('<motor name="m" jointinparent="elbow"/>', "elbow", ("m",)),
        ('<motor name="m" tendon="both"/>', "elbow", ("m",)),
        ('<motor name="m" tendon="both"/>', "crank", ()),
        ('<motor name="m" tendon="cable"/>', "elbow", ("m",)),
        ('<motor name="m" tendon="cable"/>', "wrist", ()),
        ('<motor name="m" site="hand" gear="0 1 0 0 0 0"/>', "elbow", ("m",)),
        ('<motor name="m" site="hand" gear="0 0 1 0 0 0"/>', "elbow", ()),
        ('<motor name="m" cranksite="pin" slidersite="slider" cranklength=".6"/>', "crank", ("m",)),
        ('<motor name="m" cranksite="pin" slidersite="slider" cranklength=".6"/>', "elbow", ()),
        ('<adhesion name="m" body="arm" ctrlrange="0 1" gain="1"/>', "elbow", ()),
        (f'{SERVO}<motor name="m" tendon="both"/>', "elbow", ("servo", "m")),
    ],
)
def test_who_acts_on_a_joint(actuator, joint, named):
    assert acting(actuator, joint) == named


def test_what_is_disabled_does_not_act():
    assert acting(SERVO, extra='<option><flag actuation="disable"/></option>') == ()
    grouped = SERVO.replace("/>", ' group="3"/>')
    assert acting(grouped, extra='<option actuatorgroupdisable="3"/>') == ()
    assert acting(grouped, extra='<option actuatorgroupdisable="2"/>') == ("servo",)


def test_the_context_names_the_actuators(tmp_path):
    path = write(tmp_path, ARM.format(actuator=SERVO))
    found = context(path, "elbow")
    assert found.driven and found.actuators == ("servo",)
    assert "driven by:    servo" in found.describe()


def swung(folder, name="run.csv", forced=True, seconds=5.0):
    """The arm under a force, its actuator off, as it truly moves."""
    model = mujoco.MjModel.from_xml_string(ARM.format(actuator=""))
    data, rows = mujoco.MjData(model), []
    data.qpos[0] = 0.0 if forced else 0.6
    data.qvel[0] = 0.0 if forced else -0.4
    while data.time < seconds:
        data.qvel[1] = data.qpos[1] = 0.0  # the wrist is held
        data.qfrc_applied[0] = 0.2 * np.sin(2.5 * data.time) if forced else 0.0
        rows.append((data.time, data.qpos[0], data.qfrc_applied[0]))
        mujoco.mj_step(model, data, 5)
    time, position, force = np.array(rows).T
    position = position + np.random.default_rng(0).normal(0, 3e-4, len(time))
    write_run(folder / name, Run(name, time, position, None, force, forced))
    return folder / name


def test_a_driven_joint_s_run_without_force_is_refused_unless_passive(tmp_path):
    model = write(tmp_path, ARM.format(actuator=SERVO), "arm.xml")
    run = swung(tmp_path, forced=False)
    sentence = (
        r"run\.csv: actuator 'servo' acts on joint 'elbow', and the run has neither a column "
        r"'ctrl:servo' nor 'force'; record its signal or the whole force on the joint, or say with "
        r"--passive that the actuator was off\.$"
    )
    (tmp_path / "d.json").write_text('{"effects": []}')
    flat = context(model, "elbow").joint
    attach(model, Profile(joint=flat), tmp_path / "s.xml", native="keep")
    for command, *more in (
        (compare, model, "elbow", [run]),
        (diagnose, model, "elbow", [run]),
        (improve, model, "elbow", [run], tmp_path / "n.xml"),
        (refine, tmp_path / "s.xml", "elbow", [run], tmp_path / "n.xml"),
    ):
        with pytest.raises(JodaError, match=sentence):
            command(*more)
    with pytest.raises(JodaError, match=sentence):
        add(model, "elbow", tmp_path / "d.json", [run], tmp_path / "n.xml", effect="backlash")
    assert not (tmp_path / "n.xml").exists()
    found = compare(model, "elbow", [run], passive=True)
    assert found.rmse_window < 1.5 * found.noise_floor  # 50 N·m/rad would pull it to zero


@pytest.mark.slow
def test_with_a_force_the_actuator_s_own_is_not_added(tmp_path):
    model = write(tmp_path, ARM.format(actuator=SERVO), "arm.xml")
    for passive in (False, True):
        found = compare(model, "elbow", [swung(tmp_path)], passive=passive)
        assert found.rmse_window < 2 * found.noise_floor and not found.failing


def headed(folder, old, new, forced=True):
    path = swung(folder, forced=forced, seconds=2.0)
    lines = path.read_text().splitlines()
    (at,) = (k for k, line in enumerate(lines) if line.startswith("time"))
    lines[at] = lines[at].replace(old, new)
    path.write_text("\n".join(lines) + "\n")
    return path


def test_commands_of_what_was_off_or_is_elsewhere_are_named(tmp_path):
    model = write(tmp_path, ARM.format(actuator=SERVO), "arm.xml")
    run = headed(tmp_path, "force", "ctrl:servo")
    (note,) = read_measured(model, "elbow", [run], passive=True).notes
    assert note.startswith("run.csv: not used: 'ctrl:servo', which are of other actuators")
    run = headed(tmp_path, "force", "ctrl:lamp")
    with pytest.raises(JodaError, match="neither a column 'ctrl:servo' nor 'force'"):
        read_measured(model, "elbow", [run])
    undriven = write(tmp_path, ARM.format(actuator=""), "plain.xml")
    (note,) = read_measured(undriven, "elbow", [run]).notes
    assert "not used: 'ctrl:lamp'" in note


def test_columns_of_other_joints_are_named(tmp_path):
    model = write(tmp_path, ARM.format(actuator=""), "arm.xml")
    run = headed(tmp_path, "position", "position:elbow")
    with pytest.raises(JodaError, match=r"no column 'position:wrist'; it has 'position:elbow'\."):
        read_measured(model, "wrist", [run])
    run = headed(tmp_path, "force", "force:wrist")
    (note,) = read_measured(model, "elbow", [run]).notes
    assert "not used: 'force:wrist'" in note


def test_other_columns_are_ignored_in_silence(tmp_path):
    model = write(tmp_path, ARM.format(actuator=""), "arm.xml")
    run = headed(tmp_path, "force", "temperature")
    assert read_measured(model, "elbow", [run]).notes == ()


@pytest.mark.slow
def test_the_command_takes_passive(tmp_path):
    model = write(tmp_path, ARM.format(actuator=SERVO), "arm.xml")
    run = swung(tmp_path, forced=False)
    command = [sys.executable, "-m", "joda", "compare", str(model), str(run), "--joint", "elbow"]
    refused = subprocess.run(command, capture_output=True, text=True)
    assert refused.returncode == 2 and "say with --passive" in refused.stderr
    assert subprocess.run([*command, "--passive"], capture_output=True).returncode == 0
