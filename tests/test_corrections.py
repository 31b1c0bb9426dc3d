"""Numbers of the model that the runs contradict: which, by how much, and how sure."""

import json

import mujoco
import numpy as np
import pytest
from hidden_cases import read

from joda import diagnose
from joda.diagnosis.verdict import diagnosed
from joda.hidden import draw
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run

KEYS = {"parameter", "joint", "factor", "value", "error", "unit", "explanation"}
DOOR = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.001" gravity="0 0 0" integrator="implicitfast"/>
  <worldbody><body>
    <joint name="door" type="hinge" axis="0 0 1" limited="true" range="-1.5 1.5" {numbers}/>
    <inertial pos="0.3 0 0" mass="1" diaginertia="0.05 0.05 0.05"/>
  </body></worldbody>
</mujoco>
"""
NUMBERS = {"damping": 0.3, "frictionloss": 0.2, "stiffness": 1.5}
UNITS = {"damping": "N·m·s/rad", "frictionloss": "N·m", "stiffness": "N·m/rad"}
SIGMA = 5e-4


def text_of(numbers):
    return DOOR.format(numbers=" ".join(f'{name}="{x}"' for name, x in numbers.items()))


def pushed(folder, rng, numbers, extra=lambda q: 0.0):
    """Six runs of 4 s of the door in MuJoCo, with a force that is recorded and one that is not."""
    model = mujoco.MjModel.from_xml_string(text_of(numbers))
    names = []
    for k in range(6):
        data = mujoco.MjData(model)
        data.qpos[0] = rng.uniform(-0.4, 0.4)
        size, rate, phase = rng.uniform(0.8, 2.0), rng.uniform(2.0, 6.0), rng.uniform(0, 6)
        rows = []
        for step in range(4000):
            force = size * np.sin(rate * data.time + phase)
            if step % 5 == 0:
                rows.append((data.time, data.qpos[0], force))
            data.qfrc_applied[0] = force + extra(data.qpos[0])
            mujoco.mj_step(model, data)
        time, position, force = np.array(rows).T
        position = position + SIGMA * rng.standard_normal(len(position))
        names.append(folder / f"run{k}.csv")
        write_run(names[-1], Run(names[-1].name, time, position, None, force, True))
    return names


@pytest.mark.slow
@pytest.mark.sweep(1, "corrections")
@pytest.mark.parametrize("wrong", [{}, {"damping": 1.6}, {"frictionloss": 0.5, "stiffness": 1.3}])
def test_numbers_that_are_off_are_told_with_their_errors(tmp_path, rng, wrong):
    runs = pushed(tmp_path, rng, NUMBERS)
    given = {name: x * wrong.get(name, 1.0) for name, x in NUMBERS.items()}
    (tmp_path / "door.xml").write_text(text_of(given))
    found = diagnose(tmp_path / "door.xml", "door", runs)
    assert found.verdict == "adequate"
    told = {one["parameter"]: one for one in json.loads(found.to_json())["corrections"]}
    assert set(told) == set(wrong)
    for name, one in told.items():
        assert set(one) == KEYS
        assert one["joint"] == "door" and one["unit"] == UNITS[name]
        assert abs(one["value"] - NUMBERS[name]) < 4 * one["error"] + 0.01 * NUMBERS[name]
        assert one["factor"] == pytest.approx(one["value"] / given[name])
        assert 0 < one["error"] < 0.05 * one["value"]
        assert name in one["explanation"] and "±" in one["explanation"]


@pytest.mark.sweep(1, "corrections")
def test_a_number_that_is_off_beside_a_missing_effect_is_told_too(tmp_path, rng):
    runs = pushed(tmp_path, rng, NUMBERS, lambda q: -0.5)
    (tmp_path / "door.xml").write_text(text_of(NUMBERS | {"damping": 0.6}))
    found = diagnose(tmp_path / "door.xml", "door", runs)
    assert found.effects
    told = {one.parameter: one for one in found.corrections}
    assert set(told) == {"damping"}
    assert told["damping"].value == pytest.approx(0.3, rel=0.1)


@pytest.mark.long
@pytest.mark.sweep(3)
def test_of_joints_that_lack_nothing_the_right_numbers_are_within_their_errors():
    seed = int(np.random.default_rng().integers(2**31))
    case = draw(seed, None, forced=True)
    found = diagnosed(read(case)[0]).diagnosis
    truth = case.truth
    right = {"frictionloss": truth.friction, "damping": truth.damping}
    for one in found.corrections:
        off = abs(one.value - right[one.parameter])
        assert off < 4 * one.error + 0.01 * right[one.parameter], (seed, one)


@pytest.mark.slow
def test_one_factor_where_no_force_was_recorded_is_the_inertias_and_is_set_right(tmp_path, rng):
    """A slide of 0.6 kg that its model takes for 1 kg, flicked to and fro: friction and damping are
    1.67 times the model's, beside its inertia, which no positions tell."""
    (tmp_path / "slide.xml").write_text("""<mujoco>
      <option gravity="0 0 0"/>
      <worldbody><body>
        <joint name="slide" type="slide" axis="1 0 0" range="0 1" frictionloss="0.3" damping="0.5"/>
        <geom type="box" size=".1 .1 .1" mass="1"/>
      </body></worldbody></mujoco>""")
    time, files = np.arange(400) / 250, []
    for k, speed in enumerate((1.2, -1.1, 1.0, -1.2, 0.9, -1.0)):
        rate, level = 0.5 / 0.6, 0.3 / 0.5
        turns = np.log(1 + abs(speed) / level) / rate
        t = np.minimum(time, turns)
        path = (abs(speed) + level) / rate * (1 - np.exp(-rate * t)) - level * t
        position = 0.1 + path if speed > 0 else 0.9 - path
        noisy = position + 2e-4 * rng.standard_normal(len(time))
        files.append(tmp_path / f"run{k}.csv")
        write_run(files[-1], Run(files[-1].name, time, noisy, None, 0 * time, False))
    found = diagnosed(read_measured(tmp_path / "slide.xml", "slide", files))
    told = found.diagnosis
    assert told.verdict == "adequate"
    assert [one.factor for one in told.corrections] == pytest.approx([1 / 0.6] * 2, rel=0.05)
    assert "the joint's inertia 0.6 times the model's" in told.summary
    assert "force may be in another unit" not in told.summary
    channels = found.corrected.profile.channels
    assert channels.friction.components[0].y[0] == pytest.approx(0.5, rel=0.05)
    assert channels.damping.components[0].y[0] == pytest.approx(0.5 / 0.6, rel=0.05)
