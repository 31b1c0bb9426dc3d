"""Position, velocity and noise from a measured position: the one smoother there is.

Around each time a parabola is fitted by least squares to the samples within `WINDOW` seconds on
either side (at least `LEAST` samples): Savitzky and Golay's smoother, for uneven sampling too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOW = 0.04
LEAST = 7


@dataclass(frozen=True)
class Smooth:
    """Smoothed samples; arrays of shape (n,).

    Attributes:
        position: rad or m.
        velocity: rad/s or m/s.
        position_error, velocity_error: their standard deviations from the measurement's noise.
    """

    position: Array
    velocity: Array
    position_error: Array
    velocity_error: Array


def noise(time: Array, position: Array) -> float:
    """Standard deviation of the noise in a position, from what a local cubic cannot follow.

    Fourth divided differences, scaled to that of white noise; their median, so that knocks and
    stops hardly count.

    Args:
        time: s, shape (n,).
        position: shape (n,).

    Returns:
        in the position's unit; 0 for fewer than 5 samples.
    """
    n = len(time)
    if n < 5:
        return 0.0
    t = np.stack([time[k : n - 4 + k] for k in range(5)], axis=1)
    y = np.stack([position[k : n - 4 + k] for k in range(5)], axis=1)
    gaps = t[:, :, None] - t[:, None, :]
    np.einsum("nkk->nk", gaps)[:] = 1.0
    weights = 1 / gaps.prod(axis=2)
    weights /= np.sqrt((weights**2).sum(axis=1, keepdims=True))
    # Median of |x| of a normal distribution is 0.6745 of its standard deviation.
    return float(np.median(np.abs((weights * y).sum(axis=1))) / 0.6745)


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
    out = np.empty((4, len(at)))
    least = min(LEAST, len(time))
    for k, t0 in enumerate(at):
        near = np.flatnonzero(np.abs(time - t0) <= WINDOW)
        if len(near) < least:
            near = np.sort(np.argsort(np.abs(time - t0), kind="stable")[:least])
        t = time[near] - t0
        A = np.stack([np.ones_like(t), t, t * t], axis=1)[:, : min(3, len(near))]
        covariance = np.linalg.inv(A.T @ A)
        fit = covariance @ A.T @ position[near]
        errors = sigma * np.sqrt(np.diag(covariance))
        out[:, k] = fit[0], fit[1], errors[0], errors[1]
    return Smooth(*out)
