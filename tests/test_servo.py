"""Driven joints: actuators' laws as MuJoCo has them, commands replayed, their numbers recovered."""

import mujoco
import numpy as np
import pytest
from scenes import write
from servo_arm import NOISE, Arm

from joda import JodaError, compare, diagnose, improve, templates
from joda.effects import CHANNEL_EFFECTS, EFFECTS
from joda.joints.rig import rig
from joda.measured.reading import read_measured
from joda.measured.runs import held
from joda.scenes.actuators import Servo, drive_of

JOINT = """<mujoco><compiler angle="radian"/><option timestep=".002"/><worldbody><body>
  <joint name="j" range="-2 2" limited="true"{own}/><geom size=".1" pos=".3 0 0"/>
  <site name="s" pos=".3 0 0"/></body></worldbody>
  <tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
  <actuator>{actuators}</actuator></mujoco>"""
BOTH = '<position name="p" joint="j" kp="20"/><velocity name="v" joint="j" kv="2" gear="3"/>'
EVERY = {*EFFECTS, *CHANNEL_EFFECTS, *templates()}
GENERAL = '<general name="g" joint="j" gainprm="5" biastype="affine" biasprm="1 -4 -.3" gear="-2"/>'


def compiled(actuators, own=""):
    return mujoco.MjModel.from_xml_string(JOINT.format(actuators=actuators, own=own))


@pytest.mark.parametrize(
    ("actuators", "own"),
    [
        ('<motor name="m" joint="j" gear="7" ctrlrange="-.5 .5"/>', ""),
        ('<position name="p" joint="j" kp="30" kv="2" forcerange="-4 6"/>', ""),
        ('<position name="p" joint="j" kp="30" dampratio="1" gear="-3" forcerange="-4 6"/>', ""),
        ('<velocity name="v" joint="j" kv="3" ctrlrange="-1 1"/>', ""),
        (GENERAL, ""),
        (BOTH, ""),
        (BOTH, ' actuatorfrcrange="-5 3"'),
    ],
)
def test_the_law_is_the_engine_s(actuators, own):
    model = compiled(actuators, own)
    drive, data = drive_of(model, 0), mujoco.MjData(model)
    rng = np.random.default_rng()
    for q, v in rng.uniform(-2, 2, (50, 2)):
        ctrl = rng.uniform(-2, 2, model.nu)
        data.qpos[0], data.qvel[0], data.ctrl[:] = q, v, ctrl
        mujoco.mj_forward(model, data)
        command = drive.command(ctrl[None])
        mine = drive.servo.force(command, np.array([q]), np.array([v]))[0]
        assert mine == pytest.approx(data.qfrc_actuator[0], abs=1e-9)


@pytest.mark.parametrize(
    ("actuators", "reason"),
    [
        ('<position name="p" tendon="t" kp="3"/>', "does not act on the joint directly"),
        ('<position name="p" joint="j" kp="3" timeconst=".1"/>', "dynamics of its own"),
        ('<damper name="d" joint="j" kv="3" ctrlrange="0 1"/>', "gain that is not fixed"),
        ('<muscle name="m" joint="j"/>', "dynamics of its own"),
        ('<motor name="m" joint="j" forcerange="-1 1"/><motor joint="j"/>', "force limit"),
    ],
)
def test_what_is_no_servo_is_refused(actuators, reason):
    with pytest.raises(JodaError, match=reason):
        drive_of(compiled(actuators), 0)


def test_a_held_command_has_its_means():
    time, values = np.array([0.0, 0.1, 0.3]), np.array([1.0, 5.0, -2.0])
    found = held(time, values, np.array([-0.1, 0.0, 0.05, 0.15, 0.3, 0.4]))
    np.testing.assert_allclose(found, [1.0, 1.0, 3.0, 5.0, -2.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    "servo",
    [
        Servo(stiffness=60.0, damping=2.0),
        Servo(stiffness=60.0, damping=2.0, low=-3.0, high=5.0),
        Servo(gain=0.4, stiffness=60.0, damping=2.0, delay=0.0137),
        Servo(following=3.0, gain=0.7),
        Servo(low=-1.0, high=1.0),
    ],
)
def test_a_joint_in_c_moves_as_the_engine_with_the_plugin(tmp_path, servo):
    arm = Arm()
    measured = read_measured(arm.model(tmp_path / "m.xml"), "elbow", [arm.log(tmp_path / "r", 0)])
    h, n, profile = 0.002, 1500, measured.profile
    joint_model = measured.joint_model.with_plugin
    rng = np.random.default_rng()
    command = np.repeat(rng.normal(0, 30, n // 50), 50)
    own = type(joint_model)(**{**vars(joint_model), "servo": servo})
    _, path = own.simulator(profile, h).replay(np.zeros(n), [0], [[0.3, 0.0]], [True], h, command)
    model = rig(measured.context, profile, servo=servo)
    model.opt.timestep = h
    model.jnt_solref[0], model.jnt_solimp[0] = joint_model.limits(profile, h)
    data, late = mujoco.MjData(model), servo.delay / h
    data.qpos[0] = 0.3
    for k in range(n):
        at = max(k - late, 0.0)
        i = int(at)
        data.ctrl[0] = (1 - at + i) * command[i] + (at - i) * command[min(i + 1, n - 1)]
        mujoco.mj_step(model, data)
        assert path[k] == pytest.approx(data.qpos[0], abs=1e-9)


@pytest.mark.slow
def test_a_driven_run_is_replayed_under_its_command(tmp_path):
    arm = Arm()
    runs = arm.logs(tmp_path)
    right = Arm(friction=0.3).model(tmp_path / "m.xml")
    right.write_text(right.read_text().replace("0.002", "0.0005"))  # nearer the logs' own
    found = compare(right, "elbow", runs)
    assert found.rmse < 2 * NOISE
    wrong = compare(Arm(kp=60.0).model(tmp_path / "w.xml"), "elbow", runs)
    assert wrong.rmse > 20 * NOISE and wrong.adequacy.verdict == "beyond_noise"


@pytest.mark.sweep(1, "servo")
def test_its_gain_and_delay_are_found_and_written(tmp_path):
    rng = np.random.default_rng()
    delay = rng.uniform(0.008, 0.025)
    arm = Arm(delay=delay)
    runs = arm.logs(tmp_path)
    model = Arm(kp=40 * rng.choice([0.4, 2.5])).model(tmp_path / "m.xml")
    result = improve(model, "elbow", runs, tmp_path / "new.xml")
    assert [bool(step.corrections) for step in result.steps] == [False, True]
    first, last = result.steps
    assert first.diagnosis is None and last.diagnosis.verdict == "adequate"
    assert last.error.window < 2 * NOISE < 10 * NOISE < first.error.window
    by_name = {one.parameter: one for one in last.corrections}
    assert set(by_name) == {"actuator_gain", "time_delay"}
    gain, late = by_name["actuator_gain"], by_name["time_delay"]
    assert abs(gain.value - 40) < max(3 * gain.error, 0.4)
    assert abs(late.value - delay) < max(3 * late.error, 5e-4)
    new = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    assert new.actuator_gainprm[0, 0] == pytest.approx(gain.value, rel=0.02)
    assert new.actuator_delay[0] == pytest.approx(delay, abs=1e-3)
    assert new.actuator_forcerange[0].tolist() == [-12, 12]
    assert compare(tmp_path / "new.xml", "elbow", runs).rmse < 2 * NOISE


@pytest.mark.sweep(1, "servo")
def test_friction_in_its_gear_is_found(tmp_path):
    arm = Arm(by_load=np.random.default_rng().uniform(0.12, 0.25))
    found = diagnose(Arm().model(tmp_path / "m.xml"), "elbow", arm.logs(tmp_path))
    assert found.effects[0].effect == "load_dependent_friction"
    first = found.effects[0]
    assert abs(first.magnitude - arm.by_load) < max(3 * first.magnitude_error, 0.02)
    assert not found.corrections


@pytest.mark.sweep(1, "servo")
def test_numbers_are_told_and_set_right_where_something_stays_unexplained(tmp_path):
    model, runs = Arm(kp=100.0).model(tmp_path / "m.xml"), Arm(by_load=0.4).logs(tmp_path)
    known = [name for name in EVERY if name != "end_stop_restitution"]
    found = diagnose(model, "elbow", runs, exclude=known)
    assert found.verdict == "unexplained" and "suit the runs best without it" in found.summary
    (gain,) = [one for one in found.corrections if one.parameter == "actuator_gain"]
    assert 20 < gain.value < 60  # what rubs by load is taken for less of it
    steps = improve(model, "elbow", runs, tmp_path / "new.xml").steps
    assert steps[1].corrections and not steps[1].added  # before anything is asked
    assert steps[1].error.window < 0.3 * steps[0].error.window


@pytest.mark.slow
@pytest.mark.sweep(1, "servo")
def test_damping_of_joint_and_actuator_is_one_number(tmp_path):
    model = Arm().model(tmp_path / "m.xml")
    damped = model.read_text().replace('damping=".05"', 'damping="3"')  # with the servo's 4.5
    model.write_text(damped)
    found = diagnose(model, "elbow", Arm().logs(tmp_path))
    (damping,) = [one for one in found.corrections if one.parameter == "damping"]
    assert damping.value == pytest.approx(1.55, abs=max(4 * damping.error, 0.05))
    assert damping.factor == pytest.approx(1.55 / 4.5, rel=0.1)
    assert "damping of joint and actuator" in damping.explanation


# --- columns


def edited(folder, change):
    run = Arm().log(folder / "r.csv", 3, seconds=2.0)
    head, *rows = run.read_text().splitlines()
    run.write_text("\n".join(change(head, [row.split(",") for row in rows])) + "\n")
    return Arm().model(folder / "m.xml"), run


def test_an_empty_command_is_held(tmp_path):
    model, run = edited(tmp_path, lambda head, rows: [head, *map(",".join, rows)])
    whole = read_measured(model, "elbow", [run]).runs[0].command
    assert whole is not None
    model, run = edited(
        tmp_path,
        lambda head, rows: [
            head,
            *(f"{t},{q},{u if k % 2 == 0 else ''}" for k, (t, q, u) in enumerate(rows)),
        ],
    )
    sparse = read_measured(model, "elbow", [run]).runs[0].command
    np.testing.assert_array_equal(sparse, np.repeat(whole[::2], 2))


def test_a_command_that_begins_empty_is_refused(tmp_path):
    model, run = edited(
        tmp_path, lambda head, rows: [head, f"{rows[0][0]},{rows[0][1]},", *map(",".join, rows[1:])]
    )
    with pytest.raises(JodaError, match=r"r\.csv, line 2: no ctrl:servo; the first cell must tell"):
        read_measured(model, "elbow", [run])


def test_runs_with_and_without_a_command_are_not_mixed(tmp_path):
    model, run = edited(tmp_path, lambda head, rows: [head, *map(",".join, rows)])
    other = tmp_path / "forced.csv"
    other.write_text(
        "\n".join(["time,position,force", *(f"{k / 50},{k / 100},1" for k in range(60))])
    )
    with pytest.raises(
        JodaError, match=r"forced\.csv: no column 'ctrl:servo', which other runs have"
    ):
        read_measured(model, "elbow", [run, other])


def test_all_actuators_on_a_joint_must_be_told(tmp_path):
    model = write(tmp_path, JOINT.format(actuators=BOTH, own=""), "both.xml")
    run = tmp_path / "one.csv"
    run.write_text(
        "\n".join(["time,position,ctrl:p", *(f"{k / 50},{k / 100},1" for k in range(60))])
    )
    with pytest.raises(JodaError, match="no column 'ctrl:v', and the actuators on the joint act"):
        read_measured(model, "j", [run])
