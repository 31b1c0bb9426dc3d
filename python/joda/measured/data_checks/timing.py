"""When the joint was measured: uneven times, gaps, repeated positions, too few of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from joda.measured import smoothing
from joda.measured.runs import Run

Array = NDArray[np.float64]

SIDES = 20
"""Samples on either side within which a joint must have moved, to be moving."""


def uneven(run: Run) -> str:
    """Speaks where many intervals are not the usual one."""
    intervals = np.diff(run.time)
    intervals = intervals[intervals <= longest(intervals)]
    usual = np.median(intervals)
    share = np.mean(np.abs(intervals - usual) > 0.5 * usual)
    if share < 0.05:
        return ""
    low, high = 1e3 * np.quantile(intervals, (0.05, 0.95))
    return (
        f"time is uneven, {100 * share:.0f} % of the intervals differ from the usual "
        f"{1e3 * usual:.3g} ms by more than half (mostly {low:.3g} to {high:.3g} ms); it can be "
        "used, but check that the times are those of the measurement"
    )


def longest(intervals: Array) -> float:
    """Intervals longer than this are gaps; s."""
    return 5 * float(np.quantile(intervals, 0.9))


def gapped(run: Run) -> str:
    """Speaks where samples are missing."""
    intervals = np.diff(run.time)
    gaps = np.flatnonzero(intervals > longest(intervals))
    if not len(gaps):
        return ""
    worst = gaps[np.argmax(intervals[gaps])]
    count = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest"
    return (
        f"{count} of {intervals[worst]:.3g} s after {run.time[worst]:.4g} s, where "
        f"{1e3 * np.median(intervals):.3g} ms is usual; cut the file there into two"
    )


def repeated(run: Run, position: Array, step: float) -> str:
    """Repeats of a moving joint's position beyond those that steps and noise make."""
    n = len(position)
    first = np.append(0, np.flatnonzero(np.diff(position)) + 1)  # of samples that are the same
    value, length = position[first], np.diff(np.append(first, n))
    if len(first) < 10:
        return ""
    step = max(step, float(np.abs(np.diff(value)).min()))
    sigma = smoothing.noise(run.time[first], value)
    # values that differ are off by a step at the least, so that they seem to be noisier
    analogue = np.sqrt(max(smoothing.noise(run.time, position) ** 2 - step**2 / 4, 0.0))
    before = value - position[np.maximum(first - SIDES, 0)]
    after = position[np.minimum(first + length - 1 + SIDES, n - 1)] - value
    moving = _least(before, after) > 6 * (sigma + step)
    chance = step / np.hypot(step, 3.5 * analogue)
    chance *= np.maximum(1 - _pace(first, value) / (step + 2.5 * analogue), 0.0)
    surplus = float((length - 1 - length * chance)[moving].sum())
    share = surplus / max(length[moving].sum(), 1)
    if surplus < 8 or share < 0.15:
        return ""
    return (
        f"while the joint moves, {100 * share:.0f} % of the positions repeat the one "
        "before, as of a logger faster than its sensor; record each measured value once"
    )


def repeats(runs: Sequence[Run]) -> bool:
    """Whether positions of a moving joint repeat in any run: what seems to be noise is motion."""
    return any(repeated(run, run.position, smoothing.resolution(run.position)) for run in runs)


def _pace(first: NDArray[np.intp], value: Array) -> Array:
    """Speed per sample over three different values before and after; 0 where it turns."""
    k = np.arange(len(first))
    a, b = np.maximum(k - 3, 0), np.minimum(k + 3, len(first) - 1)
    with np.errstate(invalid="ignore"):
        before = (value - value[a]) / (first - first[a])
        after = (value[b] - value) / (first[b] - first)
    return np.nan_to_num(_least(before, after))


def _least(before: Array, after: Array) -> Array:
    """The lesser magnitude of two motions, 0 where they have different directions."""
    return np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)


def slowly_sampled(run: Run, position: Array, step: float, unit: str) -> str:
    """Speaks where the joint moves far, or turns, between a few samples."""
    intervals, moves, visited = np.diff(run.time), np.diff(position), float(np.ptp(position))
    usual = np.median(intervals)
    farthest = float(np.abs(moves[intervals < 1.5 * usual]).max())
    turns = np.flatnonzero(moves[:-1] * moves[1:] < 0) + 1
    swings = (np.diff(turns) <= 3) & (np.abs(np.diff(position[turns])) > 0.2 * visited)
    shakes = bool(np.any(swings[:-1] & swings[1:]))
    if not shakes and (farthest < 0.1 * visited or farthest < 1.5 * step):
        return ""
    what = (
        "turns every few samples"
        if shakes
        else f"moves up to {farthest:.3g} {unit} between two samples, "
        f"{100 * farthest / visited:.0f} % of all it visited"
    )
    faster = max(20 * farthest / visited, 5.0)
    return f"the joint {what}; record at {faster / usual:.0f} Hz or more"
