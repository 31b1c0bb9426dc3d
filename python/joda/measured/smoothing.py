"""Position, velocity and noise from a measured position: the one smoother there is.

Around each time a parabola is fitted by least squares to the samples near it (Savitzky and Golay's
smoother, for uneven sampling too), in the widest of a few windows whose velocity agrees with those
of all narrower ones: the rule of intersecting confidence intervals (Goldenshluger and Nemirovski,
1997). What the parabola bends is told by a cubic in the same window.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import ndtri

Array = NDArray[np.float64]

WINDOWS = (0.02, 0.03, 0.045, 0.07)
"""Half widths (s) that are tried, from the narrowest on, of a motion of usual pace."""
USUAL_PACE = 0.15
"""Pace (s) from which a motion counts as usual; a faster one has narrower windows in proportion."""
FASTEST = 0.9
"""Quantile of a motion's speeds that tells its pace."""
CLEAR_MOTION, BURST = 10.0, 3
"""Displacement, in noises, that tells a speed; so many of them one after the other and to the same
side tell a pace: two outliers make fewer."""
MIN_SAMPLES = 7
"""Fewest samples in a window."""
EXACT = 1e-3
"""How exactly, in steps, values lie on a lattice that are not rounded."""
DIGITS, FEW_DIGITS = 13, 6
"""Decimals that are looked for; units of the last one that make a step which rounding hides not."""
COARSE = 8
"""Samples for each step between values from which a signal of few values is quantised."""
REST = 2.0
"""Errors within which a velocity counts as zero."""
SOON = 0.8
"""Part of the velocity soon after that a joint which begins at rest does not have at once."""
SHOWN, GROWS = 6.0, 1.7
"""Displacement, in noises, that is one; and in the same time again a joint that began at rest goes
more than so many times as far: at constant acceleration three times, at constant velocity once."""
CUBIC, LONGER, SUITS = 8, 1.25, 3.0
"""Fewest samples of the stretches through which a cubic is laid, by how much each is longer than
the one before, and how much more than noise it may leave, in standard deviations of that."""
MOVES = 4.0
"""Standard errors of such a stretch's velocity that are one."""
KEPT = 0.8
"""Part of the departures, the smaller ones, that tell the noise."""
JUMP = 2.0
"""How many times as much as before and after it a force changes from one sample to the next where
it jumps between them."""
CONFIDENCE = 1.0
"""Half width of the intervals, in standard deviations."""


@dataclass(frozen=True)
class Smooth:
    """Smoothed samples; arrays of shape (n,).

    Attributes:
        position: rad or m.
        velocity: rad/s or m/s.
        position_error, velocity_error: their standard deviations, twice what the noise makes, as
            the widest window may bend the motion by as much; to the velocity's is added, as squares
            add, by how much a cubic's velocity differs.
    """

    position: Array
    velocity: Array
    position_error: Array
    velocity_error: Array


def noise(time: Array, position: Array) -> float:
    """Standard deviation of the noise in a position, see `pooled_noise`.

    Args:
        time: s, shape (n,).
        position: shape (n,).

    Returns:
        in the position's unit; 0 for fewer than 5 samples.
    """
    return pooled_noise([(time, position)])


def pooled_noise(signals: Sequence[tuple[Array, Array]]) -> float:
    """Standard deviation of one sensor's noise, from what a local cubic cannot follow.

    Fourth divided differences, scaled to that of white noise; the root mean square of the smaller
    ones, so that impacts and stops hardly count. Stretches in which a quantised position does not
    change tell nothing. At least the steps' own, a twelfth of their square.

    Args:
        signals: time (s) and position of each run, shape (n,) each.

    Returns:
        in the positions' unit; 0 where all have fewer than 5 samples.
    """
    long = [(time, position) for time, position in signals if len(time) >= 5]
    if not long:
        return 0.0
    away = np.concatenate([departures(time, position) for time, position in long])
    changes = np.concatenate([_changes(position) for _, position in long])
    white = trimmed_deviation(away[changes] if changes.any() else away)
    return max(white, resolution(np.concatenate([position for _, position in long])) / 12**0.5)


def _changes(position: Array) -> NDArray[np.bool_]:
    """Whether any two of five successive samples differ, shape (n - 4,)."""
    five = np.lib.stride_tricks.sliding_window_view(position, 5)
    return np.asarray(np.ptp(five, axis=1) > 0)


def trimmed_deviation(values: Array) -> float:
    """Standard deviation of noise about zero, from the smaller `KEPT` of the values: those of a
    normal distribution make the part kept - 2 z phi(z) of its variance, for kept = P(|x| < z)."""
    size = np.sort(np.abs(values))[: max(int(KEPT * len(values)), 1)]
    z = ndtri(0.5 + KEPT / 2)
    part = KEPT - 2 * z * np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    return float(np.sqrt(np.sum(size**2) / len(values) / part))


def force_error(time: Array, force: Array, forced: bool) -> Array:
    """Standard deviations of a recorded force: its noise, and what it does between samples.

    Args:
        time: s, shape (n,).
        force: N·m or N, known, shape (n,).
        forced: whether it was recorded; else there is none.

    Returns:
        shape (n,).
    """
    if not forced:
        return np.zeros(len(time))
    bends = np.zeros(len(force))
    bends[1:-1] = np.abs(np.diff(force, 2)) / 8  # a line through a parabola misses it by as much
    between = np.maximum(bends, np.roll(bends, -1))
    step = np.abs(np.diff(force))
    around = np.pad(step, 1)
    jumps = step > JUMP * np.maximum(around[:-2], around[2:])
    # when it jumped is not known: its mean from sample to sample is uniformly distributed
    between[:-1][jumps] = np.maximum(between[:-1], step / np.sqrt(12))[jumps]
    return np.hypot(noise(time, force), between)


def deviation(values: Array) -> float:
    """Standard deviation of noise about zero, from the median, which outliers hardly move."""
    # Median of |x| of a normal distribution is 0.6745 of its standard deviation.
    return float(np.median(np.abs(values)) / 0.6745)


def departures(time: Array, position: Array) -> Array:
    """Fourth divided differences of a position, scaled to white noise's standard deviation.

    Args:
        time: s, shape (n,), at least 5.
        position: shape (n,).

    Returns:
        about the samples from the third to the last but two, in their unit; shape (n - 4,).
    """
    n = len(time) - 4
    t = [time[k : n + k] for k in range(5)]
    difference, square = np.zeros(n), np.zeros(n)
    for k in range(5):
        weight = np.ones(n)
        for other in range(5):
            if other != k:
                weight /= t[k] - t[other]
        difference += weight * position[k : n + k]
        square += weight**2
    return difference / np.sqrt(square)


def resolution(position: Array) -> float:
    """Smallest step of a quantised signal, in its unit; 0 where it is not seen to be quantised.

    Its values lie on a lattice as exactly as they are written: a steady motion has nearly even
    steps too.
    """
    values = np.unique(position)
    steps = np.diff(values)
    steps = steps[steps > 1e-6 * (values[-1] - values[0])]  # smaller ones are rounding
    if len(steps) < 3:  # many samples of two or three values are coarse steps
        return float(steps.min()) if len(steps) and len(position) > COARSE * len(steps) else 0.0
    rounding = _rounding(values)
    for parts in range(1, 7):  # the smallest difference that occurs may be a few steps
        step = steps.min() / parts
        near = steps[steps < 10 * step * parts]
        counts = np.round(near / step)
        mean = float(near.sum() / counts.sum())
        off = np.abs(near - mean * counts)
        within = rounding if mean > FEW_DIGITS * rounding else 0.0
        exact = np.mean(off <= max(within, EXACT * mean)) > 0.95
        steady = len(values) == len(position) and counts.max() == counts.min()
        if 2 * len(near) > len(steps) and exact and not steady:
            return mean
    return 0.0


def _rounding(values: Array) -> float:
    """Unit of the last decimal that numbers are written with; 0 where they are not rounded."""
    for digits in range(DIGITS):
        scaled = values * 10.0**digits
        if np.abs(scaled - np.round(scaled)).max() < 1e-6 * max(1.0, np.abs(scaled).max() * 1e-6):
            return 1.01 * 10.0**-digits
    return 0.0


def smooth(time: Array, position: Array, at: Array, sigma: float) -> Smooth:
    """Position and velocity at some times.

    Args:
        time: s, increasing, shape (n,).
        position: shape (n,).
        at: times, shape (m,).
        sigma: noise of the position.

    Returns:
        arrays of shape (m,).
    """
    halves = _half_widths(time, position, sigma)
    low = np.maximum(np.searchsorted(time, at - 1.01 * halves[-1]) - MIN_SAMPLES, 0)
    high = np.searchsorted(time, at + 1.01 * halves[-1]) + MIN_SAMPLES
    near = [slice(a, b) for a, b in zip(low, high, strict=True)]  # what no window reaches is left
    pairs = zip(near, at, strict=True)
    local = [_local(time[k], position[k], t0, sigma, halves) for k, t0 in pairs]
    return Smooth(*np.array(local).T)


def pace(time: Array, position: Array, sigma: float) -> float:
    """Time in which a motion goes through all that it visits, at its higher speeds.

    Args:
        time: s, increasing, shape (n,).
        position: shape (n,).
        sigma: noise of the position.

    Returns:
        s; infinite where the position hardly changes.
    """
    lag = 2
    while lag < len(time) // 2:
        moved = position[lag:] - position[:-lag]
        clear = np.abs(moved) > CLEAR_MOTION * sigma
        way = sliding_window_view(np.sign(moved) * clear, BURST)
        if np.any(np.abs(way.sum(axis=1)) == BURST):
            speed = np.abs(moved[clear]) / (time[lag:] - time[:-lag])[clear]
            return float(np.ptp(position) / np.quantile(speed, FASTEST))
        lag *= 2
    return np.inf


def begins_at_rest(time: Array, position: Array, sigma: float) -> bool:
    """Whether a joint is at rest at the first sample: slow within the error, and no slowing down.

    Args:
        time: s, increasing, shape (n,).
        position: shape (n,).
        sigma: noise of the position.
    """
    half = _half_widths(time, position, sigma)[0]
    soon = time[min(max(MIN_SAMPLES, int(np.searchsorted(time, time[0] + half))), len(time) - 1)]
    found = smooth(time, position, np.array([time[0], soon]), sigma)
    first, later = np.abs(found.velocity)
    zero = REST * found.velocity_error
    slow = first < zero[0] and (later < zero[1] or first < SOON * later)
    return bool(slow and not _slows_down(position, sigma) and not _moves(time, position, sigma))


def _moves(time: Array, position: Array, sigma: float) -> bool:
    """Whether the longest stretch from the first sample on that a cubic suits begins with a
    velocity: it tells that much better than what is near the sample."""
    t, longest, count = time - time[0], 0, CUBIC
    while count <= len(t):
        A = np.vander(t[:count] / t[count - 1], 4, increasing=True)
        squares = np.linalg.lstsq(A, position[:count], rcond=None)[1].sum()
        free = count - 4
        if squares > sigma**2 * (free + SUITS * np.sqrt(2 * free)):
            break
        longest, count = count, int(np.ceil(LONGER * count))
    if not longest:
        return False
    _, slope, _, error = _polynomial(t[:longest], position[:longest], sigma, 3)
    return bool(abs(slope) > MOVES * error)


def _slows_down(position: Array, sigma: float) -> bool:
    """Whether a joint goes less and less far from the first sample on."""
    away = np.abs(position - position[0])
    shown = np.flatnonzero(away > SHOWN * sigma)
    if not len(shown) or 2 * (first := shown[0]) >= len(position):
        return False
    return bool(abs(position[2 * first] - position[first]) < GROWS * away[first])


def _half_widths(time: Array, position: Array, sigma: float) -> Array:
    """Of the windows, s, from the narrowest on."""
    return np.array(WINDOWS) * min(pace(time, position, sigma) / USUAL_PACE, 1.0)


def _local(
    time: Array, position: Array, t0: float, sigma: float, halves: Array
) -> tuple[float, ...]:
    """Position, velocity and their errors at one time."""
    near = _window(time, position, t0, sigma, halves)
    t, y = time[near] - t0, position[near]
    value, slope, value_error, slope_error = _polynomial(t, y, sigma, 2)
    bent = _polynomial(t, y, sigma, 3)[1] - slope
    return value, slope, 2 * value_error, float(np.hypot(2 * slope_error, bent))


def _window(
    time: Array, position: Array, t0: float, sigma: float, halves: Array
) -> NDArray[np.intp]:
    """The widest window, as indices, whose velocity agrees with those of all narrower ones."""
    away = np.abs(time - t0)
    widest = np.sort(np.argsort(away, kind="stable")[: min(MIN_SAMPLES, len(time))])
    least = len(widest)
    low, high = -np.inf, np.inf
    for half in halves:
        near = np.flatnonzero(away <= half)
        if len(near) < least:
            continue
        _, slope, _, error = _polynomial(time[near] - t0, position[near], sigma, 2)
        low, high = max(low, slope - CONFIDENCE * error), min(high, slope + CONFIDENCE * error)
        if low > high:
            break
        widest = near
    return widest


def _polynomial(t: Array, y: Array, sigma: float, degree: int) -> tuple[float, float, float, float]:
    """Value and slope at t = 0, and their standard deviations."""
    scale = np.abs(t).max()
    A = np.vander(t / scale, min(degree + 1, len(t)), increasing=True)
    covariance = np.linalg.inv(A.T @ A)
    fit = covariance @ A.T @ y
    errors = sigma * np.sqrt(np.diag(covariance))
    return fit[0], fit[1] / scale, errors[0], errors[1] / scale
