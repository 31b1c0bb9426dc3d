"""A learned force: its table, its motion beside SciPy's, its energy, its mistakes."""

import json
import re

import mujoco
import numpy as np
import pytest
from matplotlib.colors import to_rgba
from scenes import write
from scipy.integrate import solve_ivp
from tables import random_memory, random_table, scipys_resistance
from test_effects_physics import MASS, build, run

from joda import JodaError, Profile
from joda.effects import LearnedForce
from joda.estimation.profile_parameters import Parameters
from joda.exporting.nearest import nearest
from joda.field.table import resistance
from joda.joints.resistance import damping
from joda.pictures.draw import draw
from joda.pictures.style import EFFECTS as COLOUR
from joda.profile import Joint
from joda.scenes.native import whole_profile

DOOR = Joint(name="door", type="hinge", range=(0, 1.6), unit="rad")
STEPS = (0.0005, 0.002, 0.01, 0.02)
STEEP = LearnedForce(velocities=(-1.0, -0.005, 0.0, 0.005, 1.0), y=((-3.0, -3.0, 0.0, 3.0, 3.0),))
"""Dry friction of 3 N that has come up at 5 mm/s."""
NONE = {"velocities": (-1.0, 0.0, 1.0), "y": ((0.0, 0.0, 0.0),)}


# --- the table


def test_rows_are_scipys_pchip_and_between_them_is_a_mean(rng):
    for _ in range(20):
        table = random_table(rng, 3.0, rows=16, sides=11, interval=(0.0, 1.0))
        ends = table.velocities[0], table.velocities[-1]
        s, v = rng.uniform(-0.2, 1.2, 200), rng.uniform(1.3 * ends[0], 1.3 * ends[1], 200)
        value, slope = resistance(table, s, v)
        expected, expected_slope = scipys_resistance(table)(s, v)
        np.testing.assert_allclose(value, expected, atol=1e-12)
        np.testing.assert_allclose(slope, expected_slope, atol=1e-9)
        assert (value * v >= -1e-15).all()


def test_it_fades_to_nothing_inside_an_end_that_is_not_the_ranges():
    table = LearnedForce(interval=(0.3, 0.6), velocities=(-1, 0, 1), y=((-2, 0, 2),))
    s = np.array([0.0, 0.3, 0.31, 0.32, 0.58, 0.59, 0.6, 1.0])
    np.testing.assert_allclose(resistance(table, s, 1.0)[0], [0, 0, 1, 2, 2, 1, 0, 0], atol=1e-12)
    whole = LearnedForce(velocities=(-1, 0, 1), y=((-2, 0, 2),))
    np.testing.assert_allclose(resistance(whole, [-1, 0, 1, 2], 1.0)[0], 2)


# --- in the step


def scipys(table, memory, q, seconds, force, at):
    """Positions by SciPy of 0.8 kg on a slide of 200 m."""
    resisted = scipys_resistance(table)

    def slope(t, state):
        q, v, z = state
        R = resisted([(q + 100) / 200], np.array([v]))[0][0]
        if memory == "speed":
            return v, (force(t) - max(0, 1 + table.gain * z) * R) / MASS, (abs(v) - z) / table.time
        pull = table.gain * z if memory == "position" else 0
        return v, (force(t) - R - pull) / MASS, v - z / table.time

    solved = solve_ivp(
        slope, (0, seconds), (q, 0, 0), t_eval=at, rtol=1e-8, atol=1e-10, max_step=0.01
    )
    return solved.y[0]


def test_random_tables_move_a_slide_as_scipys_law(tmp_path, rng):
    """The position of the range is nearly the same all along the way: 200 m."""
    for _ in range(4):
        how = random_memory(rng, 2.0)
        table = random_table(rng, 2.0, interval=(0.0, 1.0), **how)
        model, data = build(tmp_path, table, step=0.0005)
        phase = rng.uniform(0, 6)

        def force(t, _=0.0, phase=phase):
            return 3 * np.sin(2.2 * t + phase) + 1.5 * np.sin(5.1 * t)

        path = run(model, data, 4, force)[0]
        at = 0.0005 * np.arange(len(path))
        expected = scipys(table, how["memory"], 0.0, at[-1], force, at)
        assert np.abs(path - expected).max() < 4e-3 * np.ptp(expected), (table, how)


def test_a_memory_of_position_has_maxwells_amplitude(tmp_path):
    """Of a slide that is swung to and fro by 0.1 m: k A w T / sqrt(1 + w² T²)."""
    stiffness, time, amplitude = 30.0, 0.2, 0.1
    maxwell = LearnedForce(memory="position", gain=stiffness, time=time, **NONE)
    for turn in (1.0, 5.0, 25.0):
        model, data = build(tmp_path, maxwell, step=1e-3)
        held = []
        for k in range(round(8 * np.pi / turn / 1e-3)):
            data.qvel[0] = amplitude * turn * np.cos(turn * k * 1e-3)
            mujoco.mj_step(model, data)
            held.append(stiffness * data.plugin_state[-1])
        shape = turn * time / np.sqrt(1 + (turn * time) ** 2)
        assert np.max(held[len(held) // 2 :]) == pytest.approx(
            stiffness * amplitude * shape, rel=0.02 * turn
        )


@pytest.mark.parametrize("step", STEPS)
def test_a_passive_table_never_adds_energy(tmp_path, step, rng):
    """Kinetic energy, and that of the memory's spring, of a slide that nothing else acts on."""
    for memory in ("none", "position", "speed"):
        how = random_memory(rng, 20.0) | {"memory": memory}
        how["gain"] = {"none": 0.0, "position": 40.0, "speed": rng.uniform(-2, 3)}[memory]
        model, data = build(tmp_path, random_table(rng, 20.0, **how), step=step)
        data.qvel[0] = rng.uniform(-3, 3)
        last = np.inf
        for _ in range(400):
            mujoco.mj_step(model, data)
            energy = MASS / 2 * data.qvel[0] ** 2
            if memory == "position":
                energy += how["gain"] / 2 * data.plugin_state[-1] ** 2
            assert energy <= last + 1e-14
            last = energy


@pytest.mark.parametrize("step", STEPS)
def test_a_drawer_comes_to_rest_where_the_table_is_steep_at_rest(tmp_path, step):
    """It creeps by what the table says of its load, and does not shake."""
    model, data = build(tmp_path, STEEP, step=step)
    data.qvel[0] = 0.4
    speeds = np.concatenate((run(model, data, 2)[1], run(model, data, 2, 1.2)[1]))
    assert speeds.min() > -1e-12
    assert speeds[round(2 / step)] < 1e-9
    creeps = speeds[-round(1 / step) :]
    assert np.ptp(creeps) < 1e-9
    assert resistance(STEEP, 0.5, creeps[-1])[0] == pytest.approx(1.2, rel=1e-6)


def test_a_saved_state_takes_the_memory_along(tmp_path, rng):
    for memory, gain in (("position", 5.0), ("speed", 0.7)):
        table = random_table(rng, 2.0, memory=memory, gain=gain, time=0.5)
        model, data = build(tmp_path, table)
        run(model, data, 0.5, 3.0)
        what = mujoco.mjtState.mjSTATE_FULLPHYSICS | mujoco.mjtState.mjSTATE_WARMSTART
        state = np.empty(mujoco.mj_stateSize(model, what))
        mujoco.mj_getState(model, data, state, what)
        other = mujoco.MjData(model)
        mujoco.mj_setState(model, other, state, what)
        np.testing.assert_array_equal(run(model, other, 0.5), run(model, data, 0.5))
        assert other.plugin_state[-1] != 0


def test_an_active_table_drives(tmp_path):
    motor = LearnedForce(
        power="active", velocities=(-2.0, -1.0, 0.0, 1.0, 2.0), y=((1.0, 1.0, 0.0, -1.0, 1.0),)
    )
    model, data = build(tmp_path, motor)
    data.qvel[0] = 0.05
    speed = run(model, data, 30)[1][-1]
    assert 1 < speed < 2 and resistance(motor, 0.5, speed)[0] == pytest.approx(0, abs=1e-9)


def test_the_flag_of_dampers_switches_it_off(tmp_path):
    model, _ = build(tmp_path, STEEP, options="")
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_DAMPER
    assert run(model, mujoco.MjData(model), 1, 1.6)[1][-1] == pytest.approx(2, rel=1e-6)
    carried = Profile(joint=Joint(name="j", type="slide", range=(-100, 100), unit="m"),
                      effects=(STEEP,))  # fmt: skip
    assert whole_profile(model, 0, carried).effects == ()


# --- what reads it

WARM = LearnedForce(
    memory="speed",
    time=4.0,
    gain=-0.2,
    positions=(0.0, 0.4, 1.0),
    velocities=(-2.0, -1.0, 0.0, 1.0, 2.0),
    y=((-2.0, -1.0, 0.0, 1.0, 2.0), (-4.0, -2.0, 0.0, 2.0, 4.0), (-2.0, -1.0, 0.0, 3.0, 6.0)),
)


def test_its_text_and_its_words():
    assert WARM.text() == (
        "learned_force memory=speed time=4 gain=-0.2: 0 1 | 0 0.4 1 | -2 -1 0 1 2 | "
        "-2 -1 0 1 2 | -4 -2 0 2 4 | -2 -1 0 3 6"
    )
    assert WARM.described() == "learned force, up to 6, memory of speed, time 4, gain -0.2"
    active = LearnedForce(power="active", **NONE)
    assert active.text().startswith("learned_force power=active: 0 1 | 0 | ")
    assert active.described() == "learned force, up to 0, active"


def test_a_picture_shows_its_resistance_over_velocity():
    figure = draw(Profile(joint=DOOR, effects=(WARM,)))
    *_, panel = figure.axes
    assert panel.get_xlabel() == "velocity (rad/s)"
    labels = [text.get_text() for text in panel.get_legend().get_texts()]
    assert labels == ["at q = 0 rad", "at q = 0.64 rad", "at q = 1.6 rad"]
    lines = [line for line in panel.lines if line.get_label() in labels]
    assert all(to_rgba(line.get_color()) == to_rgba(COLOUR) for line in lines)
    v, force = lines[-1].get_data()
    assert np.interp(1.5, v, force) == pytest.approx(4.5) and force[-1] == pytest.approx(6)
    assert len(figure.axes) == len(draw(Profile(joint=DOOR)).axes) + 1


def test_damping_at_a_speed_is_its_resistance_over_it():
    profile = Profile(joint=DOOR, effects=(WARM,))
    # where a row bends at rest, PCHIP's slope there is the harmonic mean of 1 and 3
    cubic = (0.5 * 3 + (1.5 - 3) / 8) / 0.5
    np.testing.assert_allclose(damping(profile, [0, 0.4, 1.0], 0.5), [1, 2, cubic])
    np.testing.assert_allclose(damping(profile, [0, 0.4, 1.0], 0.0), [1, 2, 1.5])
    np.testing.assert_allclose(damping(profile, [0.0, 0.0], [-1.5, 4.0]), [1, 0.5])


def test_an_export_takes_the_nearest_damping_and_tells_of_a_memory():
    linear = LearnedForce(velocities=(-2.0, 0.0, 2.0), y=((-3.0, 0.0, 3.0),))
    found = nearest(Profile(joint=DOOR, effects=(linear,)), "native")
    assert found.damping == pytest.approx((1.5, 0.0)) and not found.lost
    assert found.errors[2].rms == pytest.approx(0, abs=1e-12)
    assert nearest(Profile(joint=DOOR, effects=(WARM,)), "urdf").lost == (WARM.described(),)


def test_a_fit_of_effects_leaves_it_as_it_is():
    assert not Parameters(Profile(joint=DOOR, effects=(WARM,)), ("effects",)).slots


# --- mistakes

WRONG = {
    "interval must lie in 0 to 1 and be at least 1e-9 wide": {"interval": [0.5, 0.4]},
    "positions must increase from 0 or more to 1 or less": {
        "positions": [0.2, 1.2], "y": [[0, 0, 0]] * 2
    },
    "velocities must increase from below 0 to above it, with 0 among them": {
        "velocities": [-1, 0.5, 1]
    },
    "y needs 2 rows, one for each position": {"positions": [0, 1]},
    "each row of y needs 3 numbers, one for each velocity": {"y": [[-1, 0, 1, 2]]},
    "a table's y must lie between -1e15 and 1e15": {"y": [[0, 0, 2e15]]},
    "y must be 0 at velocity 0; what acts at rest belongs into a channel": {"y": [[0, 1, 2]]},
    "y must not have the sign opposite to its velocity": {"y": [[1, 0, 1]]},
    "gain is a memory's; give memory position or speed": {"gain": 1},
    "gain of a memory of position must not be negative": {"memory": "position", "gain": -1},
    "time: must be greater than 0": {"memory": "speed", "time": 0},
    "power: must be 'passive' or 'active'": {"power": "some"},
    "velocities: must have at most 24 numbers, not 25": {"velocities": [*range(-12, 13)]},
}  # fmt: skip


@pytest.mark.parametrize("said", WRONG)
def test_a_mistake_is_told_in_one_sentence(said, tmp_path):
    effect = {"effect": "learned_force"} | NONE | WRONG[said]
    content = Profile(joint=DOOR).model_dump(mode="json") | {"effects": [effect]}
    with pytest.raises(JodaError, match=re.escape(said)) as caught:
        Profile.read(write(tmp_path, json.dumps(content), "composed.json"))
    assert "\n" not in str(caught.value)


def test_a_joint_has_one_learned_force():
    with pytest.raises(ValueError, match="has learned_force already"):
        Profile(joint=DOOR, effects=(WARM, STEEP))
