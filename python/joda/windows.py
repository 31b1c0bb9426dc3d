"""Measured runs in short windows for the joint by itself in C++, and how much they are missed.

Each window begins at a state of its own, which is fitted with everything else: errors do not pile
up, and the misfit stays smooth in a model's numbers. What has a memory (friction, play) keeps it
from window to window. Noise of the recorded force moves the joint too; residuals are weighted with
the covariance of both noises.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from joda import smoothing
from joda._core import Solo
from joda.runs import Run

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

SHORTEST, LONGEST = 0.1, 0.5
"""Of windows, s."""
TRAVEL = 0.15
"""What part of the range a window goes through at the usual speed."""
FEWEST = 12
"""Samples that a window has at least."""
MOST = 160
"""Samples of a window that count at most; of more, every second or third does."""
STEPS = 300
"""Steps that a window has at least."""
STOP = 0.004
"""How near an end of the range, in normalised position, counts as touching it."""
LOOSE = 10.0
"""How much further than its measurement's error a start may be from the measured one."""


@dataclass(frozen=True)
class Windows:
    """Windows of runs, simulated side by side.

    Attributes:
        h: step, s.
        force: at each step, N·m or N, shape (steps,).
        at: step at which each window begins, shape (m,).
        fresh: whether it begins a run, shape (m,).
        start: measured position and velocity there, shape (m, 2).
        doubt: their standard deviations, shape (m, 2).
        step, share: step of each sample, and how far it is into it; shape (n,).
        position: measured, rad or m, shape (n,).
        time: s, shape (n,).
        run: number of each window's run, shape (m,).
        rows: sample of each place, -1 for filling; shape (m, most samples).
        whitener: turns each window's misfit into residuals of variance 1, shape (m, most, most).
        knocks: whether the joint hits an end of its range there, shape (m,).
    """

    h: float
    force: Array
    at: Integers
    fresh: NDArray[np.bool_]
    start: Array
    doubt: Array
    step: Integers
    share: Array
    position: Array
    time: Array
    run: Integers
    rows: Integers
    whitener: Array
    knocks: NDArray[np.bool_]

    @property
    def length(self) -> float:
        """Of a usual window, s."""
        ends = np.append(self.at, len(self.force))
        return self.h * float(np.median(np.diff(ends)))

    @property
    def count(self) -> Integers:
        """Samples of each window, shape (m,)."""
        return np.asarray((self.rows >= 0).sum(axis=1))

    def misfit(self, solo: Solo, start: Array) -> Array:
        """Predicted minus measured positions, rad or m, shape (n,)."""
        before, after = solo.replay(self.force, self.at, start, self.fresh, self.h)
        here = before[self.step]
        return np.asarray(here + self.share * (after[self.step] - here) - self.position)

    def residuals(self, misfit: Array) -> Array:
        """Of variance 1 where the model is true; filling is 0. Shape (m, most samples)."""
        padded = np.where(self.rows >= 0, misfit[self.rows], 0.0)
        out = np.matmul(self.whitener, padded[:, :, None])[:, :, 0]
        return np.nan_to_num(np.clip(out, -HUGE, HUGE), nan=HUGE)

    def of_runs(self, runs: Sequence[int]) -> NDArray[np.bool_]:
        """Which windows are of these runs."""
        return np.isin(self.run, runs)


CLEAR = 1.5
"""How much larger the noise of fast samples must be to count as such."""
HUGE = 1e4
"""Largest residual: a simulation that goes astray counts as one that is far off."""


def windows_of(
    runs: Sequence[Run],
    sigmas: Sequence[float],
    span: float,
    lo: float,
    inertia: float,
    timestep: float,
    length: float | None = None,
) -> Windows:
    """Cuts runs into windows; parts where the force is not known are left out.

    Args:
        runs: measured.
        sigmas: noise of each run's position, rad or m.
        span, lo: of the joint's range, rad or m.
        inertia: kg·m² or kg: how far the force's noise moves the joint.
        timestep: the scene's, s.
        length: of the windows, s; None: by the joint's pace.
    """
    length = length or _length(runs, sigmas, span)
    h = timestep / np.ceil(timestep * STEPS / length)
    parts: list[tuple[Array, ...]] = []
    samples: list[tuple[Array, ...]] = []
    step, count = 0, 0
    for number, (run, sigma) in enumerate(zip(runs, sigmas, strict=True)):
        for piece in _known(run):
            time, position = run.time[piece], run.position[piece]
            steps = int(np.ceil((time[-1] - time[0]) / h - 1e-9)) + 1
            each = max(round(length / h), 1)
            many = max(round(steps / each), 1)
            begins = np.round(np.arange(many) * steps / many).astype(int)
            place = (time - time[0]) / h
            index = np.minimum(np.floor(place + 1e-9).astype(int), steps - 1)
            window = np.searchsorted(begins, index, side="right") - 1
            enough = np.bincount(window, minlength=many) >= smoothing.LEAST
            begun = smoothing.smooth(time, position, time[0] + h * begins, sigma)
            velocity, doubt = begun.velocity.copy(), begun.velocity_error.copy()
            if smoothing.rests(velocity[0], doubt[0]):
                velocity[0], doubt[0] = 0.0, 0.1 * doubt[0] / LOOSE
            force = np.interp(time[0] + h * np.arange(steps), run.time, run.force)
            fresh = np.arange(many) == 0
            start = np.stack([begun.position, velocity], axis=1)
            doubts = np.stack([begun.position_error, doubt], axis=1)
            same = np.full(many, number)
            parts.append((force, step + begins, fresh, start, doubts, same, enough))
            window = np.where(enough[window] & _thinned(window), window + count, -1)
            spread = _spread(time, position, sigma), _rough(time, run.force[piece], run.forced)
            samples.append((step + index, place - index, position, time, window, *spread))
            step, count = step + steps, count + many
    force, at, fresh, start, doubts, run_of, enough = (
        np.concatenate(x) for x in zip(*parts, strict=True)
    )
    index, share, position, time, window, sigma, noise = (
        np.concatenate(x) for x in zip(*samples, strict=True)
    )
    rows = _rows(window, count)
    return Windows(
        h=h,
        force=force,
        at=at,
        fresh=fresh,
        start=start,
        doubt=LOOSE * doubts,
        step=index,
        share=share,
        position=position,
        time=time,
        run=run_of,
        rows=rows,
        whitener=_whitener(rows, time, sigma, noise / inertia),
        knocks=_knocks(rows, time, position, (position - lo) / span, sigma / span),
    )


def evenly(
    solo: Solo,
    force: Array,
    position: Array,
    velocity: Array,
    free: NDArray[np.bool_],
    h: float,
    length: float,
    sigma: float,
) -> Windows:
    """Windows of what a joint does under a force, without noise.

    Args:
        solo: the joint.
        force: at each step, shape (n,).
        position, velocity: where a window begins, the joint is put there; shape (n,).
        free: steps at which it is not: it goes on by itself.
        h: step, s.
        length: of the windows, s.
        sigma: noise to which misfits are compared, rad or m.
    """
    n = len(force)
    each = max(round(length / h), 2)
    at = np.arange(0, max(n - each // 2, 1), each)
    own = at[~free[at]]
    path = solo.replay(force, own, np.stack([position[own], velocity[own]], axis=1), own == 0, h)[0]
    speed = np.gradient(path, h)
    start = np.stack([path[at], np.where(free[at], speed[at], velocity[at])], axis=1)
    window = np.searchsorted(at, np.arange(n), side="right") - 1
    rows = _rows(window, len(at))
    most = rows.shape[1]
    return Windows(
        h=h,
        force=force,
        at=at,
        fresh=at == 0,
        start=start,
        doubt=np.tile([LOOSE * sigma, LOOSE * sigma / length], (len(at), 1)),
        step=np.arange(n),
        share=np.zeros(n),
        position=path,
        time=h * np.arange(n),
        run=np.zeros(len(at), int),
        rows=rows,
        whitener=np.tile(np.eye(most) / sigma, (len(at), 1, 1)),
        knocks=np.zeros(len(at), bool),
    )


def _length(runs: Sequence[Run], sigmas: Sequence[float], span: float) -> float:
    """Of the windows, by the joint's usual speed and the sampling, s."""
    speeds, gaps = [], []
    for run, sigma in zip(runs, sigmas, strict=True):
        apart = np.interp(run.time[0] + 0.05 * np.arange(10_000), run.time, run.position)
        apart = apart[: max(int(np.ptp(run.time) / 0.05), 2)]
        speed = np.abs(np.diff(apart)) / 0.05
        speeds.append(speed[speed > 4 * sigma / 0.05])
        gaps.append(np.diff(run.time))
    moving = np.concatenate(speeds)
    usual = float(np.median(moving)) if len(moving) else 0.0
    length = TRAVEL * span / usual if usual else LONGEST
    least = FEWEST * float(np.median(np.concatenate(gaps)))
    return max(min(max(length, SHORTEST), LONGEST), least)


def _thinned(window: Integers) -> NDArray[np.bool_]:
    """Which samples are kept: at most `MOST` of a window, evenly."""
    place = np.arange(len(window)) - np.searchsorted(window, window)
    each = -(-np.bincount(window, minlength=1) // MOST)
    return np.asarray(place % np.maximum(each, 1)[window] == 0)


def _known(run: Run) -> list[Integers]:
    """Parts of a run in which the force is known, as indices."""
    numbers = np.flatnonzero(~np.isnan(run.force))
    groups = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [group for group in groups if len(group) >= smoothing.LEAST]


def _rows(window: Integers, count: int) -> Integers:
    """Samples of each window, filled up with -1."""
    groups = [np.flatnonzero(window == k) for k in range(count)]
    out = np.full((count, max(map(len, groups), default=0)), -1)
    for row, group in zip(out, groups, strict=True):
        row[: len(group)] = group
    return out


def _spread(time: Array, position: Array, sigma: float) -> Array:
    """Standard deviations of the samples: the encoder's, and what uneven clocks make at speed."""
    slope = np.abs(np.gradient(position, time))
    smooth = np.convolve(slope, np.full(9, 1 / 9), mode="same")
    fast = smooth > np.quantile(smooth, 0.7)
    fast[[0, 1, -2, -1]] = False
    if len(time) < 5 or fast.sum() < FEWEST:
        return np.full(len(time), sigma)
    own = float(np.median(np.abs(smoothing.departures(time, position)[fast[2:-2]]))) / 0.6745
    late = np.sqrt(max(own**2 - (CLEAR * sigma) ** 2, 0.0)) / np.median(smooth[fast])
    return np.asarray(np.hypot(sigma, late * smooth))


def _rough(time: Array, force: Array, forced: bool) -> Array:
    """Standard deviations of the force: its noise, and what it does between samples."""
    if not forced:
        return np.zeros(len(time))
    bends = np.zeros(len(force))
    bends[1:-1] = np.abs(np.diff(force, 2)) / 8  # a line through a parabola misses it by as much
    return np.hypot(smoothing.noise(time, force), np.maximum(bends, np.roll(bends, -1)))


def _whitener(rows: Integers, time: Array, sigma: Array, push: Array) -> Array:
    """Inverse Cholesky factors of the windows' covariances.

    Besides the position's noise there is that of the force: an error of acceleration `push`, from
    one sample to the next, moves a free joint by that time, and on at the speed that it got.
    """
    m, most = rows.shape
    out = np.zeros((m, most, most))
    for k, row in enumerate(rows):
        own = row[row >= 0]
        if not len(own):
            continue
        t = time[own] - time[own[0]]
        gaps = np.diff(t, append=t[-1])
        moved = np.maximum(t[:, None] - t - 0.5 * gaps, 0.0) * (gaps * push[own])
        covariance = moved @ moved.T
        covariance[np.diag_indices(len(own))] += sigma[own] ** 2
        factor = np.linalg.cholesky(covariance)
        out[k, : len(own), : len(own)] = solve_triangular(factor, np.eye(len(own)), lower=True)
    return out


def _knocks(
    rows: Integers, time: Array, position: Array, s: Array, noise: Array
) -> NDArray[np.bool_]:
    """Whether the joint comes to an end of its range in a window, at some speed."""
    out = np.zeros(len(rows), bool)
    for k, row in enumerate(rows):
        own = row[row >= 0]
        if len(own) < 3:
            continue
        near = STOP + 3 * noise[own]
        touches = (s[own] < near) | (s[own] > 1 - near)
        moves = np.ptp(s[own]) > 0.02 + 6 * noise[own[0]]
        arrives = touches[1:] & ~touches[:-1]
        out[k] = bool(moves and arrives.any())
    return out
