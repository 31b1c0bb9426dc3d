"""What is held out of fits: where the joint moves, each sample fitted or held out, never both."""

from dataclasses import replace

import numpy as np
import pytest
from lids import RATE, SIGMA, thrown

from joda.diagnosis.adding import add_effect, error
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.holdout import Holdout, robust_rms
from joda.diagnosis.split import held_blocks, held_out, held_segments, in_blocks, parted
from joda.estimation.problem import segments_for
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run


def moving(run):
    return np.abs(run.position - run.position[-100:].mean()) > 5 * SIGMA


@pytest.mark.parametrize("count", [1, 2, 3])
def test_of_few_runs_some_of_the_motion_is_held_out(tmp_path, rng, count):
    measured = thrown(tmp_path, rng, count, drag=0.02)
    train, held = parted(measured)
    assert all(np.ptp(run.position) > 10 * SIGMA for run in held.runs)
    moved = sum(np.count_nonzero(moving(run)) for run in measured.runs)
    assert 0.1 < sum(len(run.time) for run in held.runs) / moved < 0.5
    together = np.concatenate([run.position for run in (*train.runs, *held.runs)])
    whole = np.concatenate([run.position for run in measured.runs])
    assert sorted(together) == sorted(whole)
    assert len(held.sigma) == len(held.runs) and len(train.sigma) == len(train.runs)
    assert in_blocks(measured, held)
    assert held_out(measured, held).endswith("s in which the joint moves")


@pytest.mark.sweep(2)
@pytest.mark.parametrize("count", range(4, 12))
def test_of_every_three_runs_one_is_held_out_and_one_that_shows_what_is_missing(
    tmp_path, rng, count
):
    """However few show it, and wherever they are, some are fitted and one judges."""
    drag = np.full(count, 1e-7)
    telling = rng.choice(count, rng.integers(2, 5), replace=False)
    drag[telling] = rng.uniform(0.01, 0.03, len(telling))
    measured = thrown(tmp_path, rng, count, drag)
    train, held = parted(measured)
    judging = [run.name for run in held.runs]
    assert len(judging) == count // 3 if len(telling) > 2 else (count + 1) // 3
    assert sum(f"run{k}.csv" in judging for k in telling) == 1
    names = [run.name for run in measured.runs]
    assert [run.name for run in train.runs] == [name for name in names if name not in judging]
    assert held_out(measured, held) == ", ".join(judging)
    assert not in_blocks(measured, held)


@pytest.mark.slow
def test_a_run_at_rest_is_none_of_the_four(tmp_path, rng):
    thrown(tmp_path, rng, 5, drag=0.02)
    time = np.arange(0, 2, 1 / RATE)
    rest = 2.0 + SIGMA * rng.standard_normal(len(time))
    write_run(tmp_path / "run3.csv", Run("run3.csv", time, rest, None, 0 * time, False))
    files = [tmp_path / f"run{k}.csv" for k in range(5)]
    model = tmp_path / "model.xml"
    held = parted(read_measured(model, "lid", files))[1]
    assert [run.name for run in held.runs] != ["run3.csv"] and len(held.runs) == 1
    few = parted(read_measured(model, "lid", files[1:]))[1]  # three move
    assert all(np.ptp(run.position) > 10 * SIGMA for run in few.runs)


def test_a_joint_that_never_moves_is_held_out_all_the_same(tmp_path, rng):
    measured = thrown(tmp_path, rng, 1, drag=0.02)
    still = measured.runs[0].part(slice(-400, None))
    measured = measured.with_runs([still], [0])
    train, held = parted(measured)
    assert len(train.runs) and len(held.runs)
    assert "moves" not in held_out(measured, held)


@pytest.mark.sweep(1)
@pytest.mark.parametrize("count", [1, 3])
def test_an_effect_of_a_joint_that_comes_to_rest_is_added(tmp_path, rng, count):
    drag = rng.uniform(0.01, 0.03)
    measured = thrown(tmp_path, rng, count, drag)
    added_effect = add_effect(*parted(measured), "quadratic_damping")
    assert added_effect.effect == "quadratic_damping", added_effect.reason
    other = tmp_path / "other"
    other.mkdir()
    unseen = thrown(other, rng, 4, drag)
    assert error(unseen, added_effect.profile).window < 2 * SIGMA < 0.5 * error(unseen).window


def test_where_nothing_is_missed_nothing_can_be_told(tmp_path, rng):
    measured = thrown(tmp_path, rng, 2, drag=1e-7)
    added_effect = add_effect(*parted(measured), "quadratic_damping")
    assert added_effect.effect is None
    assert "no more than the noise even without it" in added_effect.reason


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3, 12])
def test_a_diagnosis_holds_out_segments_in_which_the_joint_moves(tmp_path, rng, count):
    measured = thrown(tmp_path, rng, count, drag=0.02 if count < 4 else 0.1)
    baseline = fit_baseline(measured)
    held = Holdout(baseline, measured)
    segments, counts = baseline.estimator.segments, baseline.estimator.counts
    out = held.folds[0]
    assert out.any() and (counts & ~out).any()
    travel = [np.ptp(segments.position[row[row >= 0]]) for row in segments.rows[out]]
    if count < 4:
        assert max(travel) > 50 * SIGMA  # others may reach beyond their block
    else:
        judging = {block.run for block in held_blocks(measured, segments)}
        assert set(segments.run[out]) == judging and len(judging) == 4 and len(held.folds) == 1


@pytest.mark.slow
def test_where_segments_held_out_tell_nothing_all_are_in_turn(tmp_path, rng):
    """An effect that acts where only the runs that are fitted went is not denied by the others."""
    measured = thrown(tmp_path, rng, 12, drag=0.1)
    told = Holdout(fit_baseline(measured), measured)
    louder = 2 * told.before / measured.floor
    calm = replace(measured, sigma=tuple(louder * sigma for sigma in measured.sigma))
    baseline = fit_baseline(measured)
    held = Holdout(baseline, calm)
    assert len(told.folds) == 1 and len(held.folds) == 4
    assert not np.any(np.sum(held.folds, axis=0) > 1)
    assert np.array_equal(np.any(held.folds, axis=0), baseline.estimator.counts)


@pytest.mark.slow
def test_segments_that_tell_of_no_effect_are_no_evidence_against_it(tmp_path, rng):
    """All segments judge it in turn, where those held out are missed alike without it and with
    it, whatever else is missed there."""
    measured = thrown(tmp_path, rng, 12, drag=0.1)
    baseline = fit_baseline(measured)
    held = Holdout(baseline, measured)
    drag = next(one for one in baseline.hypotheses if one.effect == "quadratic_damping")
    found = baseline.fit_hypothesis(drag)
    before, after = held.errors(found)
    assert after < 0.5 * before == 0.5 * held.before
    silent = replace(found, fit=replace(found.fit, x=np.append(baseline.fit.x, 0.0)))
    silent = replace(silent, hypothesis=replace(drag, write=lambda profile, x: profile))
    crossed, alike = held.errors(silent)
    assert crossed == held._crossed[1] != before and alike == pytest.approx(crossed, rel=1e-3)


def test_where_nothing_was_held_out_nothing_is_missed():
    assert robust_rms([], 1e-3) == robust_rms([np.zeros(0)], 1e-3) == 0.0


def test_of_segments_held_out_one_that_goes_astray_does_not_decide(rng):
    """As a segment in which the joint goes over a barrier, and did not: all others are nearer."""
    count, noise = rng.integers(12, 20), 10 ** rng.uniform(-5, -2)
    sizes = np.sort(rng.integers(30, 60, count))
    for size in (1.0, 5.0, 200.0):
        alike = [np.full(n, size * noise) for n in sizes]
        assert robust_rms(alike, noise) == pytest.approx(size * noise)
    before = [noise * rng.normal(0, 5, n) for n in sizes]
    astray = [noise * rng.normal(0, 100 if k == 0 else 1, n) for k, n in enumerate(sizes)]
    assert np.std(np.concatenate(astray)) > 2 * np.std(np.concatenate(before))
    assert robust_rms(astray, noise) < robust_rms(before, noise)


def test_segments_follow_the_blocks(tmp_path, rng):
    """The middle of each segment that is held out is in a block that is, of nearly its length."""
    measured = thrown(tmp_path, rng, 3, drag=0.02)
    for length in (0.1, 0.3):
        segments = segments_for(measured, length)
        held = held_segments(measured, segments)
        spans = [
            (block.run, *measured.runs[block.run].time[block.samples][[0, -1]])
            for block in held_blocks(measured, segments)
        ]
        for k, row in enumerate(segments.rows):
            own = segments.time[row[row >= 0]]
            if not len(own):  # the joint rests on
                continue
            middle = own[len(own) // 2]
            inside = any(r == segments.run[k] and a <= middle <= b for r, a, b in spans)
            assert inside == held[k]
