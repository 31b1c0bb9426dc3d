"""How measured runs are cut into windows, and what simulates the joint in them."""

import numpy as np
import pytest

from joda.diagnosis.baseline import base_of, single_for, units_of, usable, windows_for
from joda.diagnosis.cutting import STEPS, _step, windows_of
from joda.diagnosis.judge import EMPTY, NOTHING, Fit, Judge
from joda.measured import smoothing
from joda.measured.reading import read_measured
from joda.measured.runs import Run, write_run

SIGMA = 2e-4
"""Noise of the encoder, m; the range is 1 m."""
STEP = 1e-3
SLIDE = """<mujoco>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" range="0 1" damping="1" {more}/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


def run_of(position, seed=0, step=STEP):
    """A run without a recorded force."""
    rng = np.random.default_rng(seed)
    time = step * np.arange(len(position))
    noisy = position + SIGMA * rng.standard_normal(len(position))
    return Run("run.csv", time, noisy, None, np.zeros(len(time)), False)


def cut(*positions):
    """Their windows of 0.2 s."""
    runs = [run_of(q, seed) for seed, q in enumerate(positions)]
    return windows_of(runs, [SIGMA] * len(runs), 1.0, 0.0, 1.0, STEP, 0.2)


# --- knocks
def hops(height, hold=0.0):
    """A joint that falls to the low end again and again, each time in 0.1 s, for 0.2 s."""
    t = STEP * np.arange(200) % 0.1
    return hold + height * 4 * (t / 0.1) * (1 - t / 0.1)


@pytest.mark.parametrize("height", [0.003, 0.03, 0.3])
@pytest.mark.parametrize("low", [True, False])
def test_hops_at_an_end_are_knocks(height, low):
    windows = cut(hops(height) if low else 1 - hops(height))
    assert windows.knocks[-1]
    for row in windows.rows[~windows.knocks]:  # the flight before the first one
        assert windows.time[row[row >= 0]].max() < 0.1


def test_what_is_before_a_knock_is_kept():
    """A joint that falls to its end in 0.15 s and stays there, in windows of 0.2 s."""
    t = STEP * np.arange(400)
    windows = cut(np.maximum(0.9 * (1 - (t / 0.15) ** 2), 0.0))
    first, knock, *rest = (windows.time[row[row >= 0]] for row in windows.rows)
    assert list(windows.knocks) == [False, True] + [False] * len(rest)
    assert 0.13 < first.max() < knock.min() < 0.15 < knock.max()


def test_hops_elsewhere_are_none():
    assert not cut(hops(0.03, 0.5), 1 - hops(0.3, 0.2)).knocks.any()


def test_what_rests_at_an_end_or_leaves_it_does_not_knock():
    t = STEP * np.arange(200)
    assert not cut(0 * t, 1 + 0 * t, t**2, 1 - 2 * t**2).knocks.any()


# --- starts
@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_what_is_let_go_begins_at_rest_and_what_is_flicked_does_not(step):
    t = step * np.arange(round(0.4 / step))
    motions = {
        "held": 0 * t + 0.5,
        "let go": 0.5 + t**2,
        "flicked": 0.5 + 0.1 * (1 - np.exp(-8 * t)),
    }
    rests = {
        name: np.mean(
            [
                smoothing.begins_at_rest(run.time, run.position, SIGMA)
                for run in (run_of(motion, seed, step) for seed in range(40))
            ]
        )
        for name, motion in motions.items()
    }
    assert rests["held"] > 0.9
    assert rests["let go"] > 0.6  # of the others the start is fitted, as of any window
    assert rests["flicked"] < 0.05


# --- ends of the range
def measured(folder, position, more=""):
    (folder / "model.xml").write_text(SLIDE.format(more=more))
    write_run(folder / "run.csv", run_of(position))
    return read_measured(folder / "model.xml", "slide", [folder / "run.csv"])


AT_THE_END = np.minimum(0.5 + STEP * np.arange(1000), 1.0)


def test_ends_that_nobody_chose_are_hard(tmp_path):
    found = measured(tmp_path, AT_THE_END)
    assert found.single.solref == (0.02, 1.0)
    assert single_for(found, 1e-4).solref == (2e-4, 1.0)


@pytest.mark.parametrize(
    ("more", "beyond"), [('solreflimit="0.05 1"', 0.0), ("", 20 * SIGMA)], ids=["chosen", "soft"]
)
def test_ends_that_somebody_chose_or_that_yield_are_as_they_are(tmp_path, more, beyond):
    found = measured(tmp_path, AT_THE_END + beyond * (AT_THE_END == 1.0), more)
    assert single_for(found, 1e-4).solref == found.single.solref


# --- starts that are stuck
def test_where_only_knocks_have_been_nothing_was_measured(tmp_path):
    """No window with a knock counts, and so nothing tells of a curve there."""
    swing = 0.5 + 0.2 * np.sin(2 * STEP * np.arange(2000))
    thrown = np.abs(1 - swing[-1] - 3 * STEP * np.arange(220))  # 3 m/s, thrown back at the end
    found = measured(tmp_path, np.append(swing, 1 - thrown))
    windows = windows_for(found)
    knock = windows.rows[windows.knocks]
    assert windows.position[knock[knock >= 0]].max() > 0.98
    first, last = units_of(windows, found).visited
    assert first == pytest.approx(0.5 + 0.2 * np.sin(2 * STEP * 2000), abs=0.01)
    assert last < 0.98


def test_a_fit_takes_a_windows_start_anew_where_that_is_better():
    """Over an edge between two sides a start does not come back by small steps."""
    windows = cut(0.5 + 0.2 * np.sin(3 * STEP * np.arange(2000)))
    judge = Judge(windows, np.ones(len(windows.count), bool))

    class Edge:
        """Moves as measured from where it was measured; beyond an edge to and fro, whose best start
        is there too."""

        def replay(self, force, at, start, fresh, h, command):
            path = np.interp(h * np.arange(len(force) + 1), windows.time, windows.position)
            far = np.abs(start[:, 0] - windows.start[:, 0]) > 5 * windows.doubt[:, 0]
            window = np.searchsorted(at, np.arange(len(force) + 1), side="right") - 1
            fro = 0.1 * np.sin(0.3 * np.arange(len(path))) + 100 * (start - there)[window, 0]
            moved = path + np.where(far[window], fro, 0.0)
            return moved[:-1], moved[1:]

    there = windows.start.copy()
    there[3] += 20 * windows.doubt[3]
    squares = judge.squares(Edge(), there)[1]
    stuck = Fit(EMPTY, there, squares, judge.loss(squares))
    assert judge.fit(lambda x: Edge(), NOTHING, EMPTY, there).loss > 0.9 * stuck.loss
    freed = judge.refit(lambda x: Edge(), NOTHING, stuck)
    assert freed.loss < 0.1 * stuck.loss
    assert freed.start[3] == pytest.approx(windows.start[3], abs=5 * windows.doubt[3].max())


def test_a_good_fit_stays_as_it_is(tmp_path):
    found = measured(tmp_path, 0.2 + 0.5 * (1 - np.exp(-STEP * np.arange(1000))))
    base = base_of(found.profile, single_for(found, STEP), STEP)
    windows = windows_of(found.runs, found.sigma, 1.0, 0.0, 1.0, STEP, 0.2)
    judge = Judge(windows, np.ones(len(windows.count), bool))
    fit = judge.fit(base.solo, base.unknowns, np.ones(len(base.places)))
    assert judge.refit(base.solo, base.unknowns, fit) is fit


# --- rest and pace
def test_rest_at_an_end_does_not_count_and_rest_elsewhere_does_by_few_samples():
    t = STEP * np.arange(1000)
    windows = cut(np.maximum(0.9 * (1 - (t / 0.15) ** 2), 0.0), 0.4 + 0 * t)
    told = usable(windows)
    assert windows.rests[windows.run == 0].sum() == 4
    assert not told[windows.run == 0][2:].any()
    assert told[windows.run == 1][0] and 4 <= windows.count[windows.run == 1].sum() <= 16


def test_a_short_stroke_is_cut_into_short_windows_up_to_the_knock():
    """Full stroke in 20 ms, at 1 kHz, and then rest at the end."""
    t = STEP * np.arange(300)
    run = run_of(np.minimum(0.05 + (t / 0.02) ** 2, 1.0))
    windows = windows_of([run], [SIGMA], 1.0, 0.0, 1.0, STEP)
    assert windows.length < 0.03
    told = np.flatnonzero(usable(windows))
    assert len(told) >= 1
    assert windows.time[windows.rows[told[-1]].max()] > 0.015


@pytest.mark.parametrize(
    ("timestep", "length", "usual", "step"),
    [(2e-3, 0.1, 0.1, 1 / 3000), (5e-4, 0.45, 0.45, 1.5e-3), (5e-4, 1.5, 0.45, 1.5e-3)],
)
def test_steps_are_short_for_the_windows(timestep, length, usual, step):
    assert _step(timestep, length, usual, STEPS) == pytest.approx(step)
