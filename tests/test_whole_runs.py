"""Whole runs of an adequate model: missed by no more than errors explain, up to an end."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_cases import read
from lids import RATE, SCENE, SIGMA

from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.free_runs import worst
from joda.diagnosis.settings import SETTINGS
from joda.hidden import draw
from joda.measured.reading import read_measured
from joda.measured.replay import Start
from joda.measured.run_files import write_run
from joda.measured.runs import Run, until_end, visits


def test_a_run_counts_up_to_where_the_joint_comes_to_an_end():
    position = np.array([0.0, 0.001, 0.2, 0.9, 0.999, 0.7, 0.5])
    run = Run("a.csv", np.arange(7.0), position, None, np.zeros(7), False)
    assert list(until_end(run, (0.0, 1.0), 3e-3).time) == [1.0, 2.0, 3.0]  # it leaves an end
    assert len(until_end(run, (0.0, 1.0), 3e-5).time) == 7
    assert len(until_end(run, (0.0, 1.0), 3.0).time) == 7


def test_each_visit_to_an_end_is_told_with_what_is_around_it():
    """From a time before it, or the last visit, to a time after it, or the next."""
    position = np.array([0, 0, 5, 9, 10, 10.2, 9.98, 9.95, 8, 5, 10, 7, 4, 3, 2.0])
    run = Run("run", np.arange(15.0), position, None, np.zeros(15), True)
    told = [(part.start, part.stop) for part in visits(run, (0.0, 10.0), 0.04, (2.0, 3.0))]
    assert told == [(0, 4), (2, 10), (8, 14)]  # what hovers at an end has not left it
    assert visits(run.part(slice(8, 10)), (0.0, 10.0), 0.04, (2.0, 3.0)) == []


def test_a_run_that_begins_pressed_into_an_end_counts_from_where_that_lets_go():
    position = np.array([-0.05, -0.02, 0.001, 0.2, 0.9, 0.999, 0.7])
    run = Run("a.csv", np.arange(7.0), position, None, np.zeros(7), False)
    assert list(until_end(run, (0.0, 1.0), 3e-3).time) == [2.0, 3.0, 4.0]
    assert list(until_end(run, (0.0, 1.0), 0.1).time) == [2.0, 3.0]
    assert list(until_end(run, (0.0, 1.0), 0.5).time) == list(run.time)
    pressed = run.part(slice(0, 2))
    assert until_end(pressed, (0.0, 1.0), 3e-3).time.tolist() == [0.0, 1.0]


@pytest.mark.long
@pytest.mark.parametrize("forced", [True, False])
def test_errors_explain_the_runs_of_a_right_model_and_not_those_of_a_wrong_one(forced):
    seed = int(np.random.default_rng().integers(2**31))
    print(seed)
    train, _ = read(draw(seed, None, forced))
    baseline = fit_baseline(train)
    assert worst(train, baseline).free < SETTINGS.whole_runs.max_multiple
    assert len(baseline.fit.x)
    wrong = replace(baseline, fit=replace(baseline.fit, x=3.0 * baseline.fit.x))
    assert worst(train, wrong).free > worst(train, baseline).free


def test_a_start_is_sought_as_mujoco_moves_the_joint():
    """The joint's own simulator takes the plugin's steps."""
    train, _ = read(draw(12, "presliding_friction", True, family="household"))
    replayer = train.replayer
    assert replayer.simulator
    for run, sigma in zip(train.runs, train.sigma, strict=True):
        starts = np.array([(run.position[0], 0.0), (run.position[3], 0.1)])
        known = run.time - run.time[0], starts, np.tile(run.force, (2, 1)), None
        apart = np.abs(replayer._quickly(*known) - replayer._replay(*known))
        assert apart.max() < 0.01 * sigma


def test_segments_are_missed_by_as_much_without_mujoco():
    """The joint's own simulator takes the plugin's steps, also those of starts nearby."""
    train, _ = read(draw(12, "presliding_friction", True, family="household"))
    for run, sigma in zip(train.runs, train.sigma, strict=True):
        pairs = [train.replayer.segments(run, sigma, quickly=quickly) for quickly in (False, True)]
        for with_it, without in zip(*pairs, strict=True):
            assert np.abs(with_it.misfit - without.misfit).max() < 0.01 * sigma
            assert with_it.force == pytest.approx(without.force, rel=1e-3, abs=1e-3)


def test_a_run_that_begins_just_before_an_end_is_followed(tmp_path, rng):
    """Smoothed samples, half of them after it threw the joint back, tell another velocity."""
    (tmp_path / "model.xml").write_text(
        SCENE.replace('limited="true"', 'limited="true" solreflimit="0.04 0.3"')
    )
    time = np.arange(0, 1.2, 1 / RATE)
    still = Run("run.csv", time, 1 + SIGMA * rng.standard_normal(len(time)), None, 0 * time, False)
    write_run(tmp_path / "run.csv", still)
    replayer = read_measured(tmp_path / "model.xml", "lid", [tmp_path / "run.csv"]).replayer
    lost = 0
    for _ in range(40):  # of 40 about 12 by the smoothed samples' start
        true = np.array([rng.uniform(0.01, 0.05), -rng.uniform(2, 4)])
        path = replayer.whole(still, Start(true, np.eye(2)))
        run = replace(still, position=path + SIGMA * rng.standard_normal(len(time)))
        followed = replayer.whole(run, replayer.start(run, SIGMA))
        lost += np.sqrt(np.mean((followed - path) ** 2)) > 15 * SIGMA
    assert lost <= 5
