"""What a measurement has wrong: as arithmetic, as a file, and in a replay; masses in a scene."""

import json

import mujoco
import numpy as np
import pytest

import joda
from joda import JodaError
from joda.hidden.instrument import Instrument
from joda.measured.corrections_file import corrections_text, read_corrections
from joda.measured.run_files import write_run
from joda.measured.runs import QuasiStatic, Run
from joda.measured.sensing import RIGHT, Sensing
from joda.profile import Profile
from joda.scenes.actuators import Servo
from joda.scenes.attaching import attached
from joda.scenes.mass_attributes import Heavier
from joda.scenes.model import describe_joint

PENDULUM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <body name="arm" pos="0 0 1">
      <joint name="arm" type="hinge" axis="0 1 0" limited="true" range="-3 3" damping="0.05"
             armature="0.01"/>
      <inertial pos="0.2 0 -0.1" mass="0.6" diaginertia="0.01 0.02 0.01"/>
      <body name="tip" pos="0.3 0 0" quat="0.9 0 0.3 0.1">
        <geom type="capsule" size="0.02" fromto="0 0 0 0.1 0.05 0" mass="0.3"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
SIGMA = 1e-4


def drawn(rng):
    return Sensing(
        force_scale=float(rng.uniform(0.5, 1.6)),
        force_offset=float(rng.uniform(-0.3, 0.3)),
        time_delay=float(rng.uniform(0.005, 0.04)),
        position_offset=float(rng.uniform(-0.05, 0.05)),
    )


def pushed(folder, rng, count=2):
    """Runs of the pendulum in MuJoCo, exact but for noise, with the force at each step's begin."""
    model = mujoco.MjModel.from_xml_string(PENDULUM)
    out = []
    for k in range(count):
        data, rows = mujoco.MjData(model), []
        size, rate, phase = rng.uniform(0.3, 0.8), rng.uniform(3, 6), rng.uniform(0, 6)
        for _ in range(3000):
            data.qfrc_applied[0] = size * np.sin(rate * data.time + phase)
            rows.append((data.time, data.qpos[0], data.qfrc_applied[0]))
            mujoco.mj_step(model, data)
        time, position, force = np.array(rows).T
        position = position + SIGMA * rng.standard_normal(len(position))
        out.append(Run(f"run{k}.csv", time, position, None, force, True))
    return out


def spoiled(run, wrong):
    """The run as it is logged with what is wrong: the inverse of `Sensing.of`, in closed form."""
    logged = np.interp(run.time + wrong.time_delay, run.time, run.force)
    own = Instrument(wrong.force_scale, wrong.force_offset, 0.0, wrong.position_offset)
    return own.logged(Run(run.name, run.time, run.position, None, logged, True))


def test_a_run_set_right_is_the_run_that_was(rng):
    wrong, time = drawn(rng), np.linspace(0, 3, 3001)
    run = Run("a.csv", time, np.sin(time), None, np.cos(2 * time), True)
    right = wrong.of(spoiled(run, wrong))
    assert right.time[0] >= wrong.time_delay > right.time[0] - 2e-3
    inside = right.time < 3 - wrong.time_delay
    np.testing.assert_allclose(right.position, np.sin(right.time), atol=1e-12)
    np.testing.assert_allclose(right.force[inside], np.cos(2 * right.time)[inside], atol=1e-5)
    assert len(wrong.of(spoiled(run, wrong), whole=True).time) == len(time)
    same = RIGHT.of(run)
    np.testing.assert_array_equal(same.force, run.force)


def test_what_is_not_known_of_a_force_stays_unknown(rng):
    time = np.linspace(0, 1, 101)
    force = np.where((time > 0.4) & (time < 0.6), np.nan, 1.0)
    right = Sensing(time_delay=0.1).of(Run("a.csv", time, time, None, force, True))
    gone = right.time[np.isnan(right.force)]
    assert 0.49 < gone.min() < 0.52 and 0.68 < gone.max() < 0.71
    free = Run("b.csv", time, time, None, np.zeros(101), False)
    np.testing.assert_array_equal(drawn(rng).of(free).force, 0.0)


def test_a_curve_and_an_actuator_are_set_right_too():
    wrong = Sensing(2.0, 0.5, 0.01, 0.1, 3.0)
    curve = wrong.of_curve(QuasiStatic("c.csv", np.arange(4.0), np.ones(4)))
    np.testing.assert_allclose(curve.position, np.arange(4) - 0.1)
    np.testing.assert_allclose(curve.force, 2.5)
    servo = wrong.driving(Servo(gain=2.0, delay=0.005))
    assert (servo.gain, servo.delay) == (pytest.approx(6.0), pytest.approx(0.015))
    assert wrong.driving(None) is None


@pytest.mark.slow
def test_compare_replays_with_what_is_wrong_set_right(tmp_path, rng):
    wrong = drawn(rng)
    model, file = tmp_path / "arm.xml", tmp_path / "arm.corrections.json"
    model.write_text(PENDULUM)
    file.write_text(corrections_text({"arm": wrong}))
    for run in pushed(tmp_path, rng):
        write_run(tmp_path / run.name, spoiled(run, wrong))
    runs = sorted(tmp_path.glob("run*.csv"))
    as_logged = joda.compare(model, "arm", runs)
    right = joda.compare(model, "arm", runs, corrections=file)
    assert right.rmse < 1.1 * SIGMA  # windows begin with a measured speed, which is noisier
    assert as_logged.rmse_window > 30 * SIGMA
    assert read_corrections(file) == {"arm": wrong}
    schema = joda.schema("corrections")
    assert set(json.loads(file.read_text())) <= set(schema["properties"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"joints": {"door": {}}}', "has no joint 'arm'; it has 'door'"),
        ('{"joints": {"arm": {"force_scale": -1}}}', "joints.arm.force_scale: Input should be"),
        ('{"joints": {"arm": {"ghost": 1}}}', "joints.arm.ghost: Extra inputs"),
        ("{", "the file: Invalid JSON"),
    ],
)
def test_a_file_that_is_none_is_named(tmp_path, rng, text, said):
    (tmp_path / "arm.xml").write_text(PENDULUM)
    (tmp_path / "c.json").write_text(text)
    write_run(tmp_path / "run.csv", pushed(tmp_path, rng, 1)[0])
    with pytest.raises(JodaError, match=said):
        joda.compare(
            tmp_path / "arm.xml", "arm", [tmp_path / "run.csv"], corrections=tmp_path / "c.json"
        )


def test_a_scene_gets_the_masses_gravity_and_centre_of_mass_asked_for(tmp_path, rng):
    gravity, inertia = sorted(map(float, rng.uniform(0.4, 1.6, 2)))
    own = Heavier(inertia, gravity, float(rng.uniform(-0.3, 0.3)))
    (tmp_path / "arm.xml").write_text(PENDULUM)
    before = mujoco.MjModel.from_xml_string(PENDULUM)
    bare = Profile(joint=describe_joint(before, 0))
    content, notes, _ = attached(tmp_path / "arm.xml", bare, tmp_path / "new.xml", heavier=own)
    (tmp_path / "new.xml").write_bytes(content)
    after = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    np.testing.assert_allclose(after.body_mass, own.inertia * before.body_mass, rtol=1e-6)
    assert any("masses and inertias" in note for note in notes)

    def at(model, q):
        """Inertia, and gravity's force on the joint, at a position."""
        data, M = mujoco.MjData(model), np.zeros((1, 1))
        data.qpos[0] = q
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, M)
        return float(M[0, 0]), float(data.qfrc_gravcomp[0] - data.qfrc_bias[0])

    for q in rng.uniform(-3, 3, 5):
        old, new = at(before, q), at(after, q)
        turned = at(before, q + own.turned)
        assert new[0] == pytest.approx(own.inertia * old[0], rel=1e-5)
        assert new[1] == pytest.approx(own.gravity * turned[1], rel=1e-4, abs=1e-5)


def test_that_gravity_pulls_more_than_masses_make_it_is_said_to_be_left_out(tmp_path):
    (tmp_path / "arm.xml").write_text(PENDULUM)
    before = mujoco.MjModel.from_xml_string(PENDULUM)
    bare = Profile(joint=describe_joint(before, 0))
    made = attached(tmp_path / "arm.xml", bare, tmp_path / "new.xml", heavier=Heavier(1.1, 1.4))
    (said,) = (note for note in made.notes if "masses and inertias 1.1 times" in note)
    assert "gravity pulls 1.4 times as much MJCF cannot say, and is left out" in said
    assert not made.model.body_gravcomp.any()


def test_bodies_that_are_not_written_there_are_named(tmp_path):
    scene = PENDULUM.replace(
        '<body name="tip"', '<replicate count="2" offset="0 0.1 0"><body name="tip"'
    ).replace("</body>\n    </body>", "</body></replicate>\n    </body>")
    (tmp_path / "arm.xml").write_text(scene)
    model = mujoco.MjModel.from_xml_string(scene)
    bare = Profile(joint=describe_joint(model, 0))
    with pytest.raises(JodaError, match="moves are not all written there, and their masses"):
        attached(tmp_path / "arm.xml", bare, tmp_path / "new.xml", heavier=Heavier(1.2, 1.2))
