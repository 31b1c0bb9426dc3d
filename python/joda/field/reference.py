"""The channels of a profile in NumPy: the definition that all implementations are tested on."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda.component import Component
from joda.profile import Channel

Array = NDArray[np.float64]


def pchip_slopes(x: Array, y: Array) -> Array:
    """Slopes of the shape-preserving piecewise cubic Hermite interpolant (PCHIP).

    Inside, the weighted harmonic mean of Fritsch & Butland (1984); at the ends, the one-sided
    three-point formula with its limiter: the rule of `scipy.interpolate.PchipInterpolator`.

    Args:
        x: knots, shape (n,), n >= 2, strictly increasing.
        y: values, shape (n,).

    Returns:
        dy/dx at the knots, shape (n,).
    """
    h = np.diff(x)
    m = np.diff(y) / h
    if len(x) == 2:
        return np.repeat(m, 2)
    w1 = 2 * h[1:] + h[:-1]
    w2 = h[1:] + 2 * h[:-1]
    monotone = np.sign(m[1:]) * np.sign(m[:-1]) > 0
    left, right = np.where(monotone, m[:-1], 1.0), np.where(monotone, m[1:], 1.0)
    with np.errstate(over="ignore"):  # next to a slope of nearly 0 the mean is 0
        inside = np.where(monotone, (w1 + w2) / (w1 / left + w2 / right), 0.0)
    return np.concatenate(
        ([_end_slope(h[0], h[1], m[0], m[1])], inside, [_end_slope(h[-1], h[-2], m[-1], m[-2])])
    )


def _end_slope(h0: float, h1: float, m0: float, m1: float) -> float:
    slope = ((2 * h0 + h1) * m0 - h0 * m1) / (h0 + h1)
    if np.sign(slope) != np.sign(m0):
        return 0.0
    if np.sign(m0) != np.sign(m1) and abs(slope) > 3 * abs(m0):
        return 3 * m0
    return slope


def _component(component: Component, s: Array) -> tuple[Array, Array]:
    """Value and slope d/ds of one component at s inside its interval."""
    a, b = component.interval
    x, y = np.asarray(component.x), np.asarray(component.y)
    u = (s - a) / (b - a)
    d = pchip_slopes(x, y)
    k = np.clip(np.searchsorted(x, u, side="right") - 1, 0, len(x) - 2)
    h = np.diff(x)[k]
    m = np.diff(y)[k] / h
    t = u - x[k]
    c2 = (3 * m - 2 * d[k] - d[k + 1]) / h
    c3 = (d[k] + d[k + 1] - 2 * m) / h**2
    value = y[k] + t * (d[k] + t * (c2 + t * c3))
    slope = d[k] + t * (2 * c2 + 3 * t * c3)
    return value, slope / (b - a)


def evaluate(channel: Channel, s: ArrayLike) -> tuple[Array, Array]:
    """Value and slope of a channel.

    Args:
        channel: its components and how they are combined.
        s: normalised joint positions, any shape; beyond [0, 1] the value at that end is held.

    Returns:
        value in the channel's unit and slope d/ds, arrays of the shape of s. Where two components
        of a maximum are equal, the slope is one of theirs.
    """
    position = np.asarray(s, dtype=float)
    inside = np.clip(position, 0, 1)
    start = 0.0 if channel.combine == "sum" else -np.inf
    value, slope = np.full(inside.shape, start), np.zeros(inside.shape)
    covered = np.zeros(inside.shape, dtype=bool)
    for component in channel.components:
        a, b = component.interval
        active = (a <= inside) & (inside <= b)
        v, d = _component(component, np.clip(inside, a, b))
        if channel.combine == "sum":
            value = value + np.where(active, v, 0)
            slope = slope + np.where(active, d, 0)
        else:
            larger = active & (v > value)
            value, slope = np.where(larger, v, value), np.where(larger, d, slope)
        covered |= active
    return np.where(covered, value, 0.0), np.where(covered & (inside == position), slope, 0.0)
