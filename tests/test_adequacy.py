"""The verdict of compare: an all-clear only where everything is within the noise."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_cases import read
from hidden_model import true_profile
from scipy.stats import binom
from test_compare import door, flat, runs_of, scene_of

from joda import JodaError, compare
from joda.hidden import draw, write
from joda.measured.adequacy import MIN_SEGMENTS, residual_pattern
from joda.measured.comparison import sentences
from joda.measured.errors import EXPLAINED, MULTIPLE
from joda.measured.failing_intervals import COLUMNS, FORCE
from joda.measured.run_files import write_run
from joda.measured.runs import Run

ALL_CLEAR = "no fault of the model"


def said(found):
    return " ".join(sentences(found))


@pytest.fixture
def unclear(tmp_path):
    """A run of 0.3 s whose segments of 0.1 s hardly show what the whole run does."""
    write(draw(101, "magnetic_return_to_low_end", forced=False), tmp_path)
    return compare(tmp_path / "model.xml", "joint", [tmp_path / "held_out3.csv"])


@pytest.mark.slow
def test_an_error_of_many_noises_is_never_an_all_clear(unclear):
    assert unclear.rmse > 10 * unclear.noise_floor
    assert unclear.adequacy.verdict == "beyond_noise"
    assert ALL_CLEAR not in said(unclear)
    assert "times the noise" in said(unclear)


@pytest.mark.slow
def test_where_it_fails_is_found_in_the_whole_run_too(unclear):
    assert {"direction", "load", "time"} <= {place.by for place in unclear.failing}


@pytest.mark.long
def test_the_true_model_of_free_runs_is_cleared(tmp_path):
    rng = np.random.default_rng()
    seeds = rng.integers(2**31, size=6)
    cleared = []
    for seed in seeds:
        _, held = read(draw(int(seed), None, forced=False))
        write_model = tmp_path / f"{seed}"
        case = draw(int(seed), None, forced=False)
        write(case, write_model)
        runs = [write_model / run.name for run in case.held_out]
        found = compare(write_model / "model.xml", case.joint, runs)
        cleared.append(found.adequacy.verdict == "within_noise")
        assert (ALL_CLEAR in said(found)) == cleared[-1]
        assert not cleared[-1] or found.rmse < 3 * held.floor
    assert sum(cleared) >= 1, seeds  # its friction may be 15 % off, and then it is not


def test_a_few_samples_are_not_enough_and_blame_nothing(tmp_path):
    for count in (10, 25):
        time = np.arange(count) / 100
        position = 0.5 + 0.4 * time + np.random.default_rng(0).normal(0, 1e-3, count)
        run = Run("run.csv", time, position, None, np.zeros(count), forced=False)
        write_run(tmp_path / f"run{count}.csv", run)
    scene = scene_of(door(), tmp_path)
    with pytest.raises(JodaError, match="10 samples are not enough to tell"):
        compare(scene, "joint", [tmp_path / "run10.csv"])
    found = compare(scene, "joint", [tmp_path / "run25.csv"])
    assert found.adequacy.verdict == "not_enough_data"
    assert found.failing == ()
    assert "Not enough to tell" in said(found)


def test_one_position_and_one_speed_make_no_warning_and_no_claim(tmp_path):
    time = np.arange(400) / 200
    rng = np.random.default_rng(1)
    for name, position in (("rest", np.full(400, 0.8)), ("steady", 0.1 + 0.5 * time)):
        noisy = position + rng.normal(0, 1e-4, 400)
        run = Run(f"{name}.csv", time, noisy, None, np.full(400, 0.05), forced=True)
        write_run(tmp_path / run.name, run)
        try:  # warnings are errors here
            found = compare(scene_of(door(), tmp_path), "joint", [tmp_path / run.name])
        except JodaError as error:
            assert "nan" not in str(error)
            continue
        assert "nan" not in said(found)
        if name == "rest":
            assert ALL_CLEAR not in said(found)


def test_a_run_of_unknown_force_is_named_with_its_reason(tmp_path):
    names = runs_of(door(), tmp_path, 3, 2)
    lines = names[0].read_text().splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("time"))
    kept = lines[: head + 1] + [line.rsplit(",", 1)[0] + "," for line in lines[head + 1 :]]
    names[0].write_text("\n".join(kept) + "\n")
    found = compare(scene_of(door(), tmp_path), "joint", names)
    assert found.runs[0].rmse is None
    assert "run0.csv: its force is unknown throughout." in said(found)
    assert "nan" not in said(found) + found.to_json().lower()
    assert found.adequacy.verdict != "within_noise"


@pytest.mark.slow
def test_what_changes_its_sign_is_not_blamed_on_a_direction(tmp_path, seed=5):
    """A bump that pushes both ways while the joint moves in one direction."""
    both = door(flat(1.5, 0.2, 0.4), flat(-1.5, 0.6, 0.8))
    found = compare(scene_of(door(), tmp_path), "joint", runs_of(both, tmp_path, seed))
    assert not [place for place in found.failing if place.by == "direction"]
    assert [place for place in found.failing if place.by == "position"]


def rows_of(force):
    rows = np.zeros((len(force), COLUMNS))
    rows[:, 0] = np.linspace(0, 1, len(force))
    rows[:, 1], rows[:, 2] = 1.0, 0.5
    rows[:, FORCE], rows[:, FORCE + 1] = force, 1.0
    return rows


def test_a_force_of_one_sign_has_the_binomial_probability():
    n = 20
    expected = 5 * 2 * binom.pmf(0, n, 0.5)  # five tests, two sides
    assert residual_pattern(rows_of(np.ones(n))) == pytest.approx(expected)


def test_two_long_runs_of_signs_are_a_pattern_and_random_ones_rarely():
    rng = np.random.default_rng()
    assert residual_pattern(rows_of(np.repeat([1.0, -1.0], 20))) < 1e-6
    found = [residual_pattern(rows_of(rng.normal(size=40))) for _ in range(400)]
    assert np.mean(np.array(found) < 0.05) < 0.1  # Bonferroni: at most 5 %, and chance
    assert residual_pattern(rows_of(np.ones(MIN_SEGMENTS - 1))) is None


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["spring_return_to_high_end", "quadratic_damping"])
def test_a_right_model_of_noisy_free_runs_is_not_blamed_for_their_starts(tmp_path, effect):
    """Noise of 0.8 % of the range: a velocity that is lost in it is not taken for zero."""
    rng = np.random.default_rng()
    seed = int(rng.integers(2**31))
    case = draw(seed, effect, forced=False)
    sigma = 0.008 * case.truth.joint.span
    noisy = [
        replace(run, position=run.position + sigma * rng.standard_normal(len(run.time)))
        for run in case.held_out_clean
    ]
    _, held = read(replace(case, held_out=noisy))
    right = held.changed(true_profile(case, held.profile))
    off = [
        np.sqrt(np.mean((path - run.position) ** 2)) / noise
        for path, run, noise in zip(right.paths(), right.runs, right.sigma, strict=True)
    ]
    assert np.median(off) < 1.5, seed
    explained = [
        right.replayer.scatter(run, right.replayer.start(run, noise)) / noise
        for run, noise in zip(right.runs, right.sigma, strict=True)
    ]
    blamed = [o > MULTIPLE and o > EXPLAINED * e for o, e in zip(off, explained, strict=True)]
    assert sum(blamed) <= 1, seed


def test_what_may_be_motion_between_samples_is_not_called_small(tmp_path):
    """A spring swings at 4.3 Hz, logged at 10 Hz; the model has none."""
    (tmp_path / "model.xml").write_text(
        '<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body>'
        '<joint name="j" axis="0 0 1" range="0 1.6" limited="true" damping=".01"/>'
        '<geom type="box" size=".2 .02 .2" pos=".2 0 0" mass="1"/></body></worldbody></mujoco>'
    )
    time = np.arange(0, 6, 0.1)
    position = 0.8 + 0.33 * np.cos(2 * np.pi * 4.3 * time)
    rows = "\n".join(f"{t:.1f},{q:.6f}" for t, q in zip(time, position, strict=True))
    (tmp_path / "run.csv").write_text("time,position\n" + rows + "\n")
    found = compare(tmp_path / "model.xml", "j", [tmp_path / "run.csv"])
    assert found.adequacy.verdict != "within_noise"
    assert found.adequacy.loudness > 0.5
    assert "Small" not in said(found) and "record faster" in said(found)
