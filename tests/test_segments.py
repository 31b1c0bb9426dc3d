"""How measured runs are cut into segments, and what simulates the joint in them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from joda.diagnosis.units import units_of
from joda.estimation.base_model import base_of
from joda.estimation.estimator import Fit, Linearization, SegmentEstimator
from joda.estimation.problem import joint_model_for, posed, segments_for
from joda.estimation.segmentation import STEPS, _responses, _step, segments_of
from joda.estimation.segments import GRID
from joda.estimation.unknowns import EMPTY, NOTHING
from joda.joints.divergence import GROWN, Linearized
from joda.measured import smoothing
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.measured.sensing import Sensing

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
    """Their segments of 0.2 s."""
    runs = [run_of(q, seed) for seed, q in enumerate(positions)]
    return segments_of(runs, [SIGMA] * len(runs), 1.0, 0.0, 1.0, STEP, 0.2)


# --- impacts
def hops(height, hold=0.0):
    """A joint that falls to the low end again and again, each time in 0.1 s, for 0.2 s."""
    t = STEP * np.arange(200) % 0.1
    return hold + height * 4 * (t / 0.1) * (1 - t / 0.1)


@pytest.mark.parametrize("height", [0.003, 0.03, 0.3])
@pytest.mark.parametrize("low", [True, False])
def test_hops_at_an_end_are_knocks(height, low):
    segments = cut(hops(height) if low else 1 - hops(height))
    assert segments.impacts[-1]
    for row in segments.rows[~segments.impacts]:  # the flight before the first one
        assert segments.time[row[row >= 0]].max() < 0.1


def test_what_is_before_a_knock_is_kept():
    """A joint that falls to its end in 0.15 s and stays there, in segments of 0.2 s."""
    t = STEP * np.arange(400)
    segments = cut(np.maximum(0.9 * (1 - (t / 0.15) ** 2), 0.0))
    first, impact, *rest = (segments.time[row[row >= 0]] for row in segments.rows)
    assert list(segments.impacts) == [False, True] + [False] * len(rest)
    assert 0.13 < first.max() < impact.min() < 0.15 < impact.max()


def test_hops_elsewhere_are_none():
    assert not cut(hops(0.03, 0.5), 1 - hops(0.3, 0.2)).impacts.any()


def test_what_rests_at_an_end_or_leaves_it_does_not_knock():
    t = STEP * np.arange(200)
    assert not cut(0 * t, 1 + 0 * t, t**2, 1 - 2 * t**2).impacts.any()


# --- starts
def test_a_segment_begins_where_an_end_that_yields_has_let_go_of_the_joint():
    """What was pressed into the end rests there; what comes after tells of the joint."""
    t = STEP * np.arange(400)
    segments = cut(np.where(t < 0.13, -0.003, -0.003 + 0.5 * (t - 0.13) ** 2))
    back = 0.13 + (2 * 0.003) ** 0.5
    tells = [segments.time[row[row >= 0]] for row in segments.rows[segments.usable]]
    assert back - 0.01 < min(own[0] for own in tells) < back + 0.02


@pytest.mark.parametrize("more", range(GRID))
def test_no_segment_begins_after_the_last_sample(more):
    """Where an end lets go of the joint just as the run ends."""
    position = np.where(np.arange(400 + more) < 399 + more, -0.003, 0.1)
    segments = cut(position, position)
    assert (np.diff(segments.at) > 0).all() and segments.at[-1] < len(segments.force)


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
    assert rests["let go"] > 0.6  # of the others the start is fitted, as of any segment
    assert rests["flicked"] < 0.05


def test_what_a_late_force_has_moved_before_the_first_sample_need_not_rest_there():
    """The force acts later than it was logged: before that it is unknown, and not sampled."""
    off = []
    for seed in range(40):
        late, t = np.random.default_rng(seed).uniform(0.021, 0.039), 0.02 * np.arange(30)
        run = run_of(0.2 + np.clip(t - late, 0, None) ** 2, seed, 0.02)
        logged = replace(run, force=np.full(len(t), 2.0), forced=True)
        right = Sensing(time_delay=late).of(logged)
        begun = segments_of([right], [SIGMA], 1.0, 0.0, 1.0, STEP, 0.2)
        off.append((begun.start[0, 1] - 2 * (right.time[0] - late)) / begun.prior_std[0, 1])
    assert np.max(np.abs(off)) < 4


# --- ends of the range
def measured(folder, position, more=""):
    (folder / "model.xml").write_text(SLIDE.format(more=more))
    write_run(folder / "run.csv", run_of(position))
    return read_measured(folder / "model.xml", "slide", [folder / "run.csv"])


AT_THE_END = np.minimum(0.5 + STEP * np.arange(1000), 1.0)


def test_ends_that_nobody_chose_are_hard(tmp_path):
    found = measured(tmp_path, AT_THE_END)
    assert found.joint_model.solref == (0.02, 1.0)
    assert joint_model_for(found, 1e-4).solref == (2e-4, 1.0)


@pytest.mark.parametrize(
    ("more", "beyond"), [('solreflimit="0.05 1"', 0.0), ("", 20 * SIGMA)], ids=["chosen", "soft"]
)
def test_ends_that_somebody_chose_or_that_yield_are_as_they_are(tmp_path, more, beyond):
    found = measured(tmp_path, AT_THE_END + beyond * (AT_THE_END == 1.0), more)
    assert joint_model_for(found, 1e-4).solref == found.joint_model.solref


# --- starts that are stuck
def test_where_only_knocks_have_been_nothing_was_measured(tmp_path):
    """No segment with an impact counts, and so nothing tells of a curve there."""
    swing = 0.5 + 0.2 * np.sin(2 * STEP * np.arange(2000))
    thrown = np.abs(1 - swing[-1] - 3 * STEP * np.arange(220))  # 3 m/s, thrown back at the end
    found = measured(tmp_path, np.append(swing, 1 - thrown))
    segments = segments_for(found)
    impact = segments.rows[segments.impacts]
    assert segments.position[impact[impact >= 0]].max() > 0.98
    first, last = units_of(segments, found).visited
    assert first == pytest.approx(0.5 + 0.2 * np.sin(2 * STEP * 2000), abs=0.01)
    assert last < 0.98


def test_a_fit_takes_a_segments_start_anew_where_that_is_better():
    """Over an edge between two sides a start does not come back by small steps."""
    segments = cut(0.5 + 0.2 * np.sin(3 * STEP * np.arange(2000)))
    estimator = SegmentEstimator(segments, np.ones(len(segments.count), bool))

    class Edge:
        """Moves as measured from where it was measured; beyond an edge to and fro, whose best start
        is there too."""

        def replay(self, force, at, start, fresh, h, command):
            path = np.interp(h * np.arange(len(force) + 1), segments.time, segments.position)
            far = np.abs(start[:, 0] - segments.start[:, 0]) > 5 * segments.prior_std[:, 0]
            window = np.searchsorted(at, np.arange(len(force) + 1), side="right") - 1
            fro = 0.1 * np.sin(0.3 * np.arange(len(path))) + 100 * (start - there)[window, 0]
            moved = path + np.where(far[window], fro, 0.0)
            return moved[:-1], moved[1:]

    there = segments.start.copy()
    there[3] += 20 * segments.prior_std[3]
    squares = estimator.squares(Edge(), there)[1]
    stuck = Fit(EMPTY, there, squares, estimator.loss(squares))
    assert estimator.fit(lambda x: Edge(), NOTHING, EMPTY, there).loss > 0.9 * stuck.loss
    freed = estimator.refit(lambda x: Edge(), NOTHING, stuck)
    assert freed.loss < 0.1 * stuck.loss
    assert freed.start[3] == pytest.approx(segments.start[3], abs=5 * segments.prior_std[3].max())


def test_starts_are_sought_from_those_of_a_fit_nearby_where_these_miss_less():
    """A segment moves as measured from one side of an edge; its measured start is on the other."""
    segments = cut(0.5 + 0.2 * np.sin(3 * STEP * np.arange(2000)))
    estimator = SegmentEstimator(segments, np.ones(len(segments.count), bool))
    near = segments.start.copy()
    near[3] += 4 * segments.prior_std[3]

    class Edge:
        """As measured, but where it starts as segment 3 was measured to."""

        def replay(self, force, at, start, fresh, h, command):
            path = np.interp(h * np.arange(len(force) + 1), segments.time, segments.position)
            lost = np.abs(start[:, 0] - segments.start[3, 0]) < 2 * segments.prior_std[3, 0]
            window = np.searchsorted(at, np.arange(len(force) + 1), side="right") - 1
            moved = path + np.where(lost[window], 0.1 * np.sin(0.3 * np.arange(len(path))), 0.0)
            return moved[:-1], moved[1:]

    alone, helped = estimator.started(Edge()), estimator.started(Edge(), near=near)
    assert helped.squares[3] < 0.1 * alone.squares[3]
    others = np.arange(len(near)) != 3
    assert np.array_equal(helped.start[others], alone.start[others])


def test_errors_of_a_force_grow_where_the_joint_runs_away():
    """Against the differential equation; a joint that does not run away is a free one."""
    rng = np.random.default_rng(0)
    times = np.cumsum(np.append(0.0, rng.uniform(0.01, 0.05, 30)))
    gaps = np.diff(times, append=times[-1])
    rate = np.where(rng.uniform(size=31) < 0.7, rng.uniform(0, 6, 31), 0.0)
    found = _responses(times, gaps, rate)
    for k in (0, 7, 20):
        x = np.array([0.5 * gaps[k], 1.0])
        assert not found[: k + 1, k].any()
        for i in range(k + 1, 30):
            assert found[i, k] == pytest.approx(x[0], rel=1e-7)
            pushed = solve_ivp(
                lambda t, y, r=rate[i]: (y[1], r**2 * y[0]), (0, gaps[i]), x, rtol=1e-10, atol=1e-12
            )
            x = pushed.y[:, -1]
    free = np.maximum(times[:, None] - times - 0.5 * gaps, 0.0)
    assert np.allclose(_responses(times, gaps, np.zeros(31)), free)
    assert np.allclose(_responses(times, gaps, np.full(31, 1e-6)), free, atol=1e-9)


@pytest.mark.parametrize("each", [1, 30])
def test_a_segment_begins_after_a_force_that_changed_between_two_samples(each):
    """A stroke of 20 ms that is recorded well, each millisecond, or once in 30 ms."""
    rng, t = np.random.default_rng(3), STEP * np.arange(1800)
    force = np.where((t > 0.835) & (t < 0.855), -20.0, 0.0) + 0.2 * np.sin(4 * t)
    speed = STEP * np.cumsum(force)
    position = 0.3 + STEP * np.cumsum(speed + 0.4)
    seen = position[::each] + SIGMA * rng.standard_normal(len(t[::each]))
    run = Run("run.csv", t[::each], seen, None, force[::each], True)
    segments = segments_of([run], [SIGMA], 1.0, 0.0, 1.0, STEP, 0.6)
    begins = segments.h * segments.at
    if each == 1:
        assert np.allclose(begins, [0.0, 0.6, 1.2], atol=0.01)
    else:
        assert any(0.83 < begin < 0.91 for begin in begins)
        assert not any(row[0] < 0.83 and row[1] > 0.86 for row in _spans(segments))
    assert segments.length == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize("kicks", [(0.5,), (0.5, 0.55)])
def test_segments_begin_after_the_few_jumps_of_a_force_that_a_joint_which_sticks_remembers(kicks):
    """A kick of 1 N·s between two samples, once in 4 ms: when it came shifts a joint of 1 kg that
    sticks soon after by up to 4 mm, 20 times the encoder's noise; an error of every sample's force
    that moves it as far does not begin one."""
    rng, t = np.random.default_rng(), 4 * STEP * np.arange(300)
    alike = 0.3 + 0.2 * np.sin(t) + SIGMA * rng.standard_normal(len(t))
    kicked = 0.01 * rng.standard_normal(len(t))
    for sign, kick in zip((1, -1), kicks, strict=False):
        kicked += np.where(t < kick, 0.0, sign * 10.0)
    uneven = 2.0 * rng.standard_normal(len(t))

    def begins(force, swings=30.0):
        run = Run("run.csv", t, alike, None, force, True)
        nearby = {"nearby": lambda q: Linearized(0 * q - swings, 0 * q)}
        segments = segments_of([run], [SIGMA], 1.0, 0.0, 1.0, STEP, 0.4, **nearby)
        return segments.h * segments.at

    for kick in kicks:
        assert np.abs(begins(kicked) - kick).min() < 0.01
    assert len(begins(kicked)) == 3 + len(kicks)
    free = begins(kicked, 0.0)  # of which it is known how it goes on after several
    assert len(free) == 3 + (len(kicks) == 1)
    assert np.allclose(begins(uneven), [0.0, 0.4, 0.8], atol=0.01)


@pytest.mark.parametrize("rate", [5.0, 20.0, 60.0])
def test_segments_end_where_an_error_at_their_begins_has_grown_to_a_part_of_the_range(rate):
    """Errors grow as exp(rate t) where the joint runs away, above the middle of its range."""
    run = run_of(0.5 + 0.3 * np.sin(np.pi * STEP * np.arange(2000)))
    nearby = lambda q: Linearized(np.where(q > 0.5, rate**2, 0.0), 0 * q)  # noqa: E731
    segments = segments_of([run], [SIGMA], 1.0, 0.0, 1.0, STEP, 0.5, nearby=nearby)
    lengths = np.diff(segments.h * segments.at, append=2.0)
    most = np.log(GROWN / SIGMA) / rate
    there = segments.at * segments.h < 0.99
    assert np.all(lengths[there] < min(most, 0.5) + 0.01)
    assert lengths[~there] == pytest.approx(0.5, abs=0.01)


def test_starts_of_a_joint_that_runs_away_are_found_from_what_is_early_in_a_segment():
    """On a hill, x'' = 8² x, an error of 4 % in its velocity throws the joint to the other side;
    beyond 0.3 m it no longer goes on, so that slopes tell nothing of the way back. One of three
    starts is as far off."""
    rng, t, rate = np.random.default_rng(), STEP * np.arange(900), 8.0
    start = np.array([-0.2, 1.6015])

    def moved(start, t):
        return 0.3 * np.tanh(
            (start[0] * np.cosh(rate * t) + start[1] * np.sinh(rate * t) / rate) / 0.3
        )

    class Hill:
        """The joint on it, exactly."""

        def replay(self, force, at, start, fresh, h, command):
            ends = np.append(at[1:], len(force))
            paths = [
                moved(s, h * np.arange(e - a + 1)) for s, a, e in zip(start, at, ends, strict=True)
            ]
            return tuple(
                np.concatenate([p[own] for p in paths]) for own in (slice(-1), slice(1, None))
            )

    noises = SIGMA * rng.standard_normal((3, len(t)))
    runs = [Run("run.csv", t, moved(start, t) + one, None, 0 * t, False) for one in noises]
    segments = segments_of(runs, 3 * [SIGMA], 2.0, -1.0, 1.0, STEP, 0.9)
    assert len(segments.at) == 3
    begun = np.stack([start, start, start - [0.0, 0.07]])
    prior_std = np.tile([10 * SIGMA, 0.1], (3, 1))
    off = replace(segments, start=begun, prior_std=prior_std)
    estimator = SegmentEstimator(off, np.ones(3, bool))
    alone = estimator._descended(Hill(), begun, estimator.squares(Hill(), begun)[1], 8)
    assert np.array_equal(alone.squares > 10 * segments.count, [False, False, True])
    found = estimator.started(Hill())
    assert np.all(found.squares < 1.5 * segments.count)
    assert found.start[:, 1] == pytest.approx(3 * [start[1]], abs=0.01)


def squares(runs, moved, **more):
    """What positions that are off by so much (m) add to a run's sum of squares: 1 for a motion in
    one way that is as uncertain as that, and far more where it is believed to be certain."""
    segments = segments_of(runs, [SIGMA] * len(runs), 1.0, 0.0, 1.0, STEP, 0.6, **more)
    return np.sum(segments.residuals(np.concatenate(moved)) ** 2) / len(runs)


@pytest.mark.parametrize("every", [1, 3])
def test_an_end_that_is_pressed_within_the_noise_may_throw_the_joint_back(every):
    """Pressed by a depth within the noise, a limit of 150 rad/s gives the joint a speed of 150
    times that: also where only every third sample is looked at."""
    rng = np.random.default_rng(every)
    time = STEP / every * np.arange(600 * every)
    since = np.maximum(time - 0.1, 0.0)
    runs, moved = [], []
    for k in range(40):
        moved.append(150 * SIGMA * abs(rng.standard_normal()) * since)
        position = 2.0 * since**2 + moved[-1] + SIGMA * rng.standard_normal(len(time))
        runs.append(Run(f"{k}.csv", time, position, None, 0.001 * np.ones(len(time)), True))
    assert 200 * squares(runs, moved, limit_rate=150.0) < squares(runs, moved)


def test_a_segment_that_begins_just_after_an_end_threw_the_joint_back_begins_within_the_range():
    """A parabola through the samples before and after the corner lies beyond the end."""
    rng = np.random.default_rng(5)
    noise, time = 8e-5, 0.0078 * np.arange(60)
    counted = 0
    for late in np.linspace(0, 0.0078, 9):
        since = time - 0.17 - late
        thrown = 0.34 * (since - 0.022) * (1 - (since - 0.022) / 0.08)  # a hop under gravity
        pressed = 0.004 * np.sin(np.pi * since / 0.022)
        position = 1 - np.where(since < 0, -3.7 * since, np.maximum(thrown, 0.0))
        position = np.where((since >= 0) & (since < 0.022), 1 + pressed, position)
        seen = position + noise * rng.standard_normal(len(time))
        run = Run("run.csv", time, seen, None, 0 * time, False)
        segments = segments_of([run], [noise], 1.0, 0.0, 1.0, STEP / 3, 0.097)
        first = segments.rows[:, 0]
        inside = (first >= 0) & (segments.position[first] < 1 - 5 * noise)
        assert np.all(segments.start[inside, 0] <= 1)
        counted += inside.sum()
    assert counted > 20


def test_a_gap_in_a_run_is_no_segment():
    time = STEP * np.r_[:300, 900:1200]
    position = np.where(time < 0.5, 0.0, time - 0.9) + SIGMA * np.cos(1e3 * time)
    run = Run("run.csv", time, position, None, np.ones(len(time)), True)
    segments = segments_of([run], [SIGMA], 1.0, 0.0, 1.0, STEP, 0.2, limit_rate=100.0)
    assert 2 <= (segments.count > 0).sum() <= 4


def test_when_a_force_jumped_between_two_samples_is_not_known():
    """A jump of 1 N at any moment between them gives 1 kg up to 1 N · 10 ms more or less."""
    rng = np.random.default_rng(3)
    time = 10 * STEP * np.arange(60)
    runs, moved = [], []
    for k in range(40):
        moment = 0.2 + 0.01 * rng.random()
        since = np.maximum(time - moment, 0.0)
        position = 0.2 + 0.5 * since**2
        noisy = position + SIGMA * rng.standard_normal(len(time))
        force = 0.01 * np.sin(5 * time) + (since > 0)
        runs.append(Run(f"{k}.csv", time, noisy, None, force, True))
        moved.append((0.205 - moment) * since)
    assert 0.5 < squares(runs, moved) < 2


def _spans(segments):
    """First and last times of the segments that have enough samples."""
    rows = [row[row >= 0] for row in segments.rows]
    return [segments.time[row[[0, -1]]] for row in rows if len(row) >= smoothing.MIN_SAMPLES]


def test_a_good_fit_stays_as_it_is(tmp_path):
    found = measured(tmp_path, 0.2 + 0.5 * (1 - np.exp(-STEP * np.arange(1000))))
    base = base_of(found.profile, joint_model_for(found, STEP), STEP)
    segments = segments_of(found.runs, found.sigma, 1.0, 0.0, 1.0, STEP, 0.2)
    estimator = SegmentEstimator(segments, np.ones(len(segments.count), bool))
    fit = estimator.fit(base.simulator, base.unknowns, np.ones(len(base.places)))
    assert estimator.refit(base.simulator, base.unknowns, fit) is fit


def test_a_fit_ends_where_it_promises_no_less_than_is_worth_it(tmp_path):
    """A slide that coasts with a damping of 1 N s/m may leave only noise, fitted from thrice that;
    one that speeds up may not, whatever its damping."""
    time, tried = STEP * np.arange(500), []
    for q in (0.1 + 0.8 * (1 - np.exp(-time)), 0.1 + 0.8 * time**3):
        joint = measured(tmp_path, q)
        segments = segments_for(joint)
        estimator, base = posed(joint, segments)
        made = []

        def make(x, base=base, made=made):
            made.append(x)
            return base.simulator(x)

        far = np.full(base.count, 3.0)
        whole = estimator.fit(make, base.unknowns, far)
        calls = len(made)
        worth = 2 * estimator.samples
        found = estimator.fit(make, base.unknowns, far, worth=worth)
        tried.append((calls, len(made) - calls, whole.loss, found.loss, worth))
    (calls, again, whole, found, worth), (_, few, least, left, _) = tried
    assert again == calls and found == whole < worth
    assert few < calls / 2 and left > 1.01 * least > worth


def test_derivatives_that_are_updated_are_those_along_the_step(rng):
    """What a straight law leaves asks for no change; what bends is met where the step ended, and
    nothing across the step changes."""
    m, n, k = 3, 8, 2
    J, S = rng.standard_normal((m, n, k)), rng.standard_normal((m, n, 2))
    about = Linearization(
        rng.standard_normal((m, n)), J, S, rng.standard_normal((m, 2)), np.ones(m)
    )
    move, own, unit = rng.standard_normal(k), rng.standard_normal((m, 2)), np.array([0.1, 3.0])
    straight = about.r + J @ move + np.einsum("mnd,md->mn", S, own)
    same = about.secant(straight, about.z + own, about.weight, move, unit)
    assert np.allclose(same.J, J) and np.allclose(same.S, S)
    bent = straight + rng.standard_normal((m, n))
    there = about.secant(bent, about.z + own, about.weight, move, unit)
    back = there.r - there.J @ move - np.einsum("mnd,md->mn", there.S, own)
    assert np.allclose(back, about.r)
    across = np.array([-move[1] / unit[1], move[0] / unit[0]]) * unit
    assert np.allclose(there.J @ across, J @ across)


# --- rest and pace
def test_rest_at_an_end_does_not_count_and_rest_elsewhere_does_by_few_samples():
    t = STEP * np.arange(1000)
    segments = cut(np.maximum(0.9 * (1 - (t / 0.15) ** 2), 0.0), 0.4 + 0 * t)
    told = segments.usable
    assert segments.rests[segments.run == 0].sum() == 5  # that with the knock ends in the first
    assert not told[segments.run == 0][2:].any()
    assert told[segments.run == 1][0] and 4 <= segments.count[segments.run == 1].sum() <= 16


@pytest.mark.parametrize("high", [True, False])
@pytest.mark.parametrize(
    ("pulled", "recorded", "friction", "missed"),
    [
        (0.5, True, 0.0, True),  # it would leave
        (0.5, True, 1.0, False),  # friction holds it
        (0.5, False, 0.0, False),  # a hand may have held it
        (-0.5, True, 0.0, False),  # it is pressed into the end, as deep as that lets it
    ],
)
def test_where_a_joint_stays_at_an_end_a_model_must_not_leave_it(
    pulled, recorded, friction, missed, high, tmp_path
):
    """1 kg at an end, which a force of 0.5 N pulls off it, or presses into it."""
    force = np.full(1000, -pulled if high else pulled)
    run = replace(run_of(np.full(1000, float(high))), force=force, forced=recorded)
    write_run(tmp_path / "run.csv", run)
    text = SLIDE.format(more=f'frictionloss="{friction}"')
    (tmp_path / "model.xml").write_text(text)
    found = read_measured(tmp_path / "model.xml", "slide", [tmp_path / "run.csv"])
    segments = segments_for(found, 0.2)
    estimator, base = posed(found, segments)
    assert segments.rests.all() and estimator.samples == 0  # of noise it tells nothing
    fit = estimator.begun(base.simulator, base.unknowns.mean)
    assert fit.loss == pytest.approx(0.0, abs=1e-9) or missed
    assert (fit.loss > 100) == missed


def test_a_long_segment_with_a_knock_ends_where_the_joint_stays():
    """It comes to the end in 0.15 s, stays for a second, and leaves it again."""
    t = STEP * np.arange(1500)
    path = np.where(t < 0.15, 0.9 * (1 - (t / 0.15) ** 2), 0.5 * np.maximum(t - 1.15, 0.0) ** 2)
    segments = segments_of([run_of(path)], [SIGMA], 1.0, 0.0, 1.0, STEP, 1.5)
    (leaves,) = np.flatnonzero(segments.usable & (segments.count > 100))
    own = segments.time[segments.rows[leaves]]
    assert 0.15 < own[own > 0].min() < 1.0 and own.max() > 1.4
    assert segments.impacts[:leaves].any() and not segments.impacts[leaves:].any()


def test_a_short_stroke_is_cut_into_short_segments_up_to_the_knock():
    """Full stroke in 20 ms, at 1 kHz, and then rest at the end."""
    t = STEP * np.arange(300)
    run = run_of(np.minimum(0.05 + (t / 0.02) ** 2, 1.0))
    segments = segments_of([run], [SIGMA], 1.0, 0.0, 1.0, STEP)
    assert segments.length < 0.03
    told = np.flatnonzero(segments.usable)
    assert len(told) >= 1
    assert segments.time[segments.rows[told[-1]].max()] > 0.015


@pytest.mark.parametrize(
    ("timestep", "length", "usual", "step"),
    [(2e-3, 0.1, 0.1, 1 / 1500), (5e-4, 0.45, 0.45, 3e-3), (5e-4, 1.5, 0.45, 3e-3)],
)
def test_steps_are_short_for_the_segments(timestep, length, usual, step):
    assert _step(timestep, length, usual, STEPS) == pytest.approx(step)


def test_forces_of_longer_steps_act_about_their_beginnings():
    """A force that grows steadily, in two runs: it is the same at the same time."""
    t = STEP * np.arange(600)
    runs = [Run("run.csv", t, 0.5 + 0 * t, None, force, True) for force in (t, 3 - t)]
    own = segments_of(runs, [SIGMA, SIGMA], 1.0, 0.0, 1.0, STEP, fine=False)
    longer = own.coarser()
    begins = longer.at[longer.fresh]
    inside = np.setdiff1d(np.arange(len(longer.force)), begins)
    inside = inside[inside < begins[1] - 1]
    np.testing.assert_allclose(longer.force[inside], own.force[::GRID][inside], rtol=1e-12)
    np.testing.assert_allclose(longer.force[begins], own.force[own.at[own.fresh]], atol=STEP)
