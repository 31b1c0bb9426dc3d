"""The table of a learned force in NumPy: the definition that all implementations are tested on."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda.effects.learned_force import EDGE, LearnedForce
from joda.field.reference import pchip_slopes

Array = NDArray[np.float64]


def resistance(table: LearnedForce, s: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
    """The table's resistance R(s, v), without its memory.

    A mean of two rows resists as both rows do, and PCHIP lies between neighbouring values: where
    the table only resists, what is between its points does, too.

    Args:
        table: the effect.
        s: normalised joint positions; beyond [0, 1] the value at that end is held.
        v: velocities, rad/s or m/s; broadcast with s.

    Returns:
        R, N·m or N, and its slope dR/dv, both of the shape of s and v together.
    """
    s, v = np.broadcast_arrays(np.clip(np.asarray(s, float), 0, 1), np.asarray(v, float))
    at, x = np.asarray(table.velocities), np.asarray(table.positions)
    inside = np.clip(v, at[0], at[-1])
    k = np.clip(np.searchsorted(at, inside, side="right") - 1, 0, len(at) - 2)
    t = inside - at[k]
    c0, c1, c2, c3 = np.moveaxis(cubics(table), 2, 0)[:, :, k]
    slopes = np.where(inside == v, c1 + t * (2 * c2 + 3 * t * c3), 0.0)
    place = np.interp(s, x, np.arange(len(x)))
    low = np.minimum(place.astype(int), max(len(x) - 2, 0))
    part, high = place - low, np.minimum(low + 1, len(x) - 1)
    weight = fade(table.interval, s)
    value, slope = (
        weight * ((1 - part) * _pick(of, low) + part * _pick(of, high))
        for of in (c0 + t * (c1 + t * (c2 + t * c3)), slopes)
    )
    return value, slope


def cubics(table: LearnedForce) -> Array:
    """Coefficients of the rows' cubics about their left velocities, constant first.

    Args:
        table: the effect, with n positions and m velocities.

    Returns:
        shape (n, m - 1, 4).
    """
    at, y = np.asarray(table.velocities), np.asarray(table.y)
    d = np.array([pchip_slopes(at, row) for row in y])
    h = np.diff(at)
    m = np.diff(y) / h
    c2 = (3 * m - 2 * d[:, :-1] - d[:, 1:]) / h
    return np.stack((y[:, :-1], d[:, :-1], c2, (d[:, :-1] + d[:, 1:] - 2 * m) / h**2), axis=2)


def fade(interval: tuple[float, float], s: Array) -> Array:
    """How much of the table is there, 0 to 1: a cubic step inside ends that are not the range's."""
    a, b = interval
    width = min(EDGE, (b - a) / 2)
    left = np.ones_like(s) if a == 0 else np.clip((s - a) / width, 0, 1)
    right = np.ones_like(s) if b == 1 else np.clip((b - s) / width, 0, 1)
    return left**2 * (3 - 2 * left) * right**2 * (3 - 2 * right)


def _pick(rows: Array, index: NDArray[np.intp]) -> Array:
    """Of rows, shape (rows, ...), the one with the index at each place, shape (...)."""
    picked: Array = np.take_along_axis(rows, index[None], axis=0)[0]
    return picked
