"""The table of a learned force, in C++."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda import _core as core
from joda.effects.learned_force import LearnedForce

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
    return _table(table)(*np.broadcast_arrays(s, v))


def cubics(table: LearnedForce) -> Array:
    """Coefficients of the rows' cubics about their left velocities, constant first.

    Args:
        table: the effect, with n positions and m velocities.

    Returns:
        shape (n, m - 1, 4).
    """
    return _table(table).cubics


def _table(table: LearnedForce) -> core.Table:
    return core.Table(table.interval, table.positions, table.velocities, table.y)
