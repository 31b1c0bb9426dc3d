"""What free runs as a whole tell, in which errors add up that segments cannot see."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hidden_cases import read
from lids import FRICTION, INERTIA, RATE, SCENE, SIGMA, SPAN, thrown

from joda import compare
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.data_sufficiency import too_little
from joda.diagnosis.free_runs import free_runs
from joda.diagnosis.verdict import diagnosed
from joda.errors import JodaError
from joda.estimation.problem import segments_for
from joda.hidden import draw
from joda.measured.comparison import sentences
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.measured.whiteness import drift, drifts, free_parts, long_run_variance

SAMPLES = 600


def compared(folder, count):
    return compare(folder / "model.xml", "lid", [folder / f"run{k}.csv" for k in range(count)])


# --- the test by itself
def cleared(make, count=200):
    return np.mean([drift(*make()) > 0.005 for _ in range(count)])


def test_white_noise_is_noise(rng):
    def make():
        return rng.standard_normal(SAMPLES), rng.standard_normal(SAMPLES), 0.0

    assert cleared(make) > 0.95


def test_filtered_noise_is_noise(rng):
    """A moving mean of five, as loud as was estimated or louder."""

    def make():
        noise = np.convolve(rng.standard_normal(SAMPLES + 4), np.ones(5) / 2, "valid")
        return noise, noise, 0.0

    assert cleared(make) > 0.9


def test_a_quantised_motion_is_noise(rng):
    def make():
        position = rng.uniform(20, 200) * np.sin(np.linspace(0, rng.uniform(2, 6), SAMPLES))
        steps = np.round(position)
        return (position - steps) * 12**0.5, steps, 12**0.5

    assert cleared(make) > 0.95


def test_an_encoder_that_dithers_at_rest_is_noise(rng):
    """Between two levels, by a noise far smaller than their distance."""

    def make():
        steps = np.round(0.45 + 0.03 * rng.standard_normal(SAMPLES))
        return (0.45 - steps) * 12**0.5, steps, 12**0.5

    assert cleared(make) > 0.95


def test_half_a_noise_that_comes_and_goes_is_none(rng):
    slow = 0.5 * np.sin(np.linspace(0, 9, SAMPLES))

    def make():
        return slow + rng.standard_normal(SAMPLES), slow, 0.0

    assert cleared(make) < 0.05


def test_a_few_samples_tell_nothing(rng):
    assert drift(5 + rng.standard_normal(40), np.arange(40), 0.0) == 1.0


def test_the_long_run_variance_of_a_moving_mean(rng):
    """Of a sum of n independent numbers it is n² times theirs, here with n of 1 and 3."""
    for width in (1, 3):
        found = []
        for _ in range(60):
            white = rng.standard_normal(1600 + width - 1)
            noise = np.convolve(white, np.ones(width), "valid")
            found.append(long_run_variance(np.array_split(noise, 16)))
        assert 0.8 < np.mean(found) / width**2 < 1.4  # at least what white noise has


def test_without_a_free_run_nothing_drifts():
    assert drifts([], []) == 1.0


def test_what_errors_of_a_force_make_is_no_drift(rng):
    moved = rng.standard_normal(SAMPLES) + np.linspace(-1, 1, SAMPLES)
    assert drift(moved, np.arange(SAMPLES), 0.0) < 1e-6
    assert drift(moved, np.arange(SAMPLES), 0.0, moved=1.0) > 0.05


@pytest.mark.sweep(1, "free runs")
def test_a_small_fault_under_a_force_is_not_cleared(tmp_path):
    """Friction a tenth off in pushed runs, each segment of which hides it."""
    model = """<mujoco><compiler angle="radian"/><option timestep=".002"/><worldbody><body>
      <joint name="j" range="-9 9" limited="true" damping="{}"/>
      <inertial pos="0 0 0" mass="1" diaginertia=".5 .5 .5"/></body></worldbody></mujoco>"""
    (tmp_path / "m.xml").write_text(model.format(1.0))
    (tmp_path / "true.xml").write_text(model.format(1.1))
    rng, paths = np.random.default_rng(), []
    plant = mujoco.MjModel.from_xml_path(str(tmp_path / "true.xml"))
    for k in range(4):
        data, rows, phase = mujoco.MjData(plant), [], rng.uniform(0, 6)
        while data.time < 6:
            force = 0.6 * np.sin(1.5 * data.time + phase)
            rows.append((data.time, data.qpos[0] + rng.normal(0, 0.005), force))
            for _ in range(5):
                data.qfrc_applied[0] = 0.6 * np.sin(1.5 * data.time + phase)
                mujoco.mj_step(plant, data)
        paths.append(tmp_path / f"{k}.csv")
        lines = [f"{t:.5f},{q:.6f},{f:.8f}" for t, q, f in rows]
        paths[-1].write_text("\n".join(["time,position,force", *lines]) + "\n")
    found = compare(tmp_path / "m.xml", "j", paths)
    assert found.adequacy.verdict != "within_noise"
    assert "no fault of the model" not in " ".join(sentences(found))
    right = compare(tmp_path / "true.xml", "j", paths)
    assert not right.adequacy.adrift


@pytest.mark.slow
# --- of a joint
def test_a_true_model_follows_its_free_runs(tmp_path, rng):
    told = []
    for k in range(8):
        folder = tmp_path / str(k)
        folder.mkdir()
        parts = free_parts(measured := thrown(folder, rng, 2, drag=1e-6))
        told.append(drifts(parts, [measured.replayer.followed(*one)[0] / one[1] for one in parts]))
    assert np.sum(np.array(told) > 0.005) >= 6


def test_a_joint_that_friction_holds_is_followed_at_its_mean_position(tmp_path, rng):
    """No velocity shows there: it is stopped at once."""
    measured = thrown(tmp_path, rng, 1, drag=1e-7)
    rests = replace(
        measured.runs[0],
        position=2.0 + SIGMA * rng.standard_normal(len(measured.runs[0].time)),
    )
    rests.position[:30] += 0.7 * SIGMA  # from where its start seems to be
    left, _ = measured.replayer.followed(rests, SIGMA)
    assert np.mean(left) == pytest.approx(0, abs=0.05 * SIGMA)


def test_a_run_in_which_the_joint_rests_counts_with_all_its_samples(tmp_path, rng):
    """Of a few of them the mean position may be off by more than all of them allow."""
    told = []
    for _ in range(6):
        moving = thrown(tmp_path, rng, 1, drag=1e-6)
        rest = rng.uniform(1, 3) + SIGMA * rng.standard_normal(400)
        time = np.arange(400) / RATE
        write_run(tmp_path / "rest.csv", Run("rest.csv", time, rest, None, 0 * time, False))
        names = [tmp_path / "run0.csv", tmp_path / "rest.csv"]
        measured = read_measured(tmp_path / "model.xml", "lid", names)
        told.append(free_runs(measured, fit_baseline(moving)).drifting)
    assert not any(told)


def louder(measured, folder, rng, times):
    """The same runs with more noise, so that no segment tells anything."""
    files = [folder / run.name for run in measured.runs]
    for run, file in zip(measured.runs, files, strict=True):
        noise = times * SIGMA * rng.standard_normal(len(run.time))
        moves = np.abs(run.position - run.position[-50:].mean()) > 20 * SIGMA
        run = run.part(slice(0, int(np.flatnonzero(moves)[-1]) + 50))
        noise = noise[: len(run.time)]
        write_run(file, type(run)(run.name, run.time, run.position + noise, None, run.force, False))
    return read_measured(folder / "model.xml", "lid", files)


@pytest.mark.slow
@pytest.mark.sweep(1, "free runs")
@pytest.mark.parametrize("times", [1.08, 0.93])
def test_a_friction_that_only_whole_runs_tell_is_told(tmp_path, rng, times):
    """Eight or seven percent of friction, in a noise that hides it in segments."""
    quiet = thrown(tmp_path, rng, 3, drag=1e-6, friction=times * FRICTION)
    measured = louder(quiet, tmp_path, rng, 25)
    found = free_runs(measured, fit_baseline(measured))
    assert found.denied and found.suffice
    assert found.fit.x[0] == pytest.approx(times, abs=max(4 * found.errors[0], 0.01))
    said = diagnosed(measured).diagnosis
    assert compared(tmp_path, 3).adequacy.verdict != "within_noise"
    assert "The model is adequate" not in said.summary


@pytest.mark.slow
@pytest.mark.parametrize("times", [1.035, 0.965])
def test_a_small_part_of_friction_is_a_correction_where_free_runs_tell_it(tmp_path, rng, times):
    """What is less than 5 % off is worth a word where the model is denied as it is."""
    measured = thrown(tmp_path, rng, 4, drag=1e-6, friction=times * FRICTION)
    back = [replace(run, position=SPAN - run.position) for run in measured.runs[2:]]
    runs = [*measured.runs[:2], *back]
    found = diagnosed(measured.with_runs(runs, range(4)))
    (told,) = found.diagnosis.corrections
    assert (found.diagnosis.verdict, told.parameter) == ("adequate", "frictionloss")
    assert told.factor == pytest.approx(times, abs=0.015)
    assert "as it stands the model" in found.diagnosis.summary
    assert found.corrected.profile.channels.friction.components[0].y[0] == pytest.approx(
        times * FRICTION, abs=0.015 * FRICTION
    )


@pytest.mark.slow
def test_a_drag_is_no_friction(tmp_path, rng):
    """Over a range of speeds no friction stands in for it."""
    measured = thrown(tmp_path, rng, 3, drag=0.02 * INERTIA / 0.03)
    found = free_runs(measured, fit_baseline(measured))
    assert found.denied and found.drifting and not found.suffice


# --- of runs that tell nothing
def test_a_joint_at_rest_tells_nothing(tmp_path, rng):
    measured = thrown(tmp_path, rng, 1, drag=1e-6)
    run = measured.runs[0]
    pushed = np.where(run.time < run.time[-1] / 2, 3.0, 0.0)
    still = 0.7 + SIGMA * rng.standard_normal(len(run.time))
    stuck = type(run)(run.name, run.time, still, None, pushed, True)
    said = diagnosed(measured.with_runs([stuck], [0])).diagnosis
    assert (said.verdict, said.effects) == ("insufficient_data", ())
    assert "does not move" in said.summary


@pytest.mark.parametrize("moves", [True, False])
def test_a_quick_motion_tells_even_where_each_short_segment_has_little_of_it(tmp_path, rng, moves):
    """Of a coarse encoder: 3 rad within 0.1 s, in segments of a dozen samples."""
    (tmp_path / "model.xml").write_text(SCENE)
    files = [tmp_path / f"run{k}.csv" for k in range(3)]
    time = np.arange(0, 0.6, 1e-3)
    for file in files:
        away = (3.0 if moves else 0.2) * np.exp(-time / 0.04) + 0.05 * rng.standard_normal(600)
        write_run(file, Run(file.name, time, np.round(0.5 + away, 1), None, 0 * time, False))
    measured = read_measured(tmp_path / "model.xml", "lid", files)
    assert segments_for(measured).length < 0.03 or not moves
    assert bool(too_little(measured)) != moves


def test_positions_that_repeat_clear_nothing(tmp_path, rng):
    measured = thrown(tmp_path, rng, 1, drag=1e-6, friction=1.2 * FRICTION)
    run = measured.runs[0].part(slice(0, 800))
    held = run.position[np.arange(800) // 8 * 8]
    write_run(tmp_path / run.name, type(run)(run.name, run.time, held, None, run.force, False))
    assert compared(tmp_path, 1).adequacy.verdict != "within_noise"


def test_what_a_spreadsheet_writes_for_no_value_is_no_comment(tmp_path, rng):
    thrown(tmp_path, rng, 1, drag=1e-6)
    file = tmp_path / "run0.csv"
    rows = file.read_text().splitlines()
    rows[40] = ",".join(["#N/A", *rows[40].split(",")[1:]])
    file.write_text("\n".join(rows) + "\n")
    with pytest.raises(JodaError, match=r"run0\.csv, line 41: time is '#N/A'"):
        compared(tmp_path, 1)


@pytest.mark.long
def test_a_part_of_a_run_in_which_the_joint_is_at_rest_is_fitted_from_rest():
    """A noisy position of a joint that stops near an end is cut there, as if it came to the end; at
    the speed that a parabola tells, the rest of the run is far off."""
    case = draw(8203, None, False, family="household")
    found = diagnosed(read(case)[0]).diagnosis
    assert found.verdict == "adequate"
    friction = next(one for one in found.corrections if one.parameter == "frictionloss")
    assert friction.value == pytest.approx(case.truth.friction, abs=3 * friction.error)
