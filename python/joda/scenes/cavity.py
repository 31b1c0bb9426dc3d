"""Cavities: whether a part covers a hollow, or is one itself, told by rays from inside."""

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RAYS = 96
"""How many directions are looked at from a point, evenly over the sphere."""
WALLED = 0.8
"""From inside a cavity, at least this share of what the part leaves free is wall."""


def _sphere(count: int) -> Array:
    """Directions, evenly over the sphere (a Fibonacci lattice); shape (count, 3)."""
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    return np.stack(
        [np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1
    )


DIRECTIONS = _sphere(RAYS)


def seen(model: mujoco.MjModel, data: mujoco.MjData, point: Array, reach: float) -> Array:
    """The geoms that rays from a point hit within `reach` (m), -1 for none; one per direction."""
    geoms, distances = np.full(RAYS, -1, np.int32), np.empty(RAYS)
    mujoco.mj_multiRay(
        model, data, point, DIRECTIONS.ravel(), None, 1, -1, geoms, distances, None, RAYS, reach
    )
    planes = np.isin(geoms, np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE))
    return np.where(planes, -1, geoms)


def covered(hits: Array, own: Array) -> float:
    """The share of a point's view that a part takes, if all else in view is wall; else 0.

    Args:
        hits: what `seen` found there.
        own: the geoms of the part.
    """
    part = np.isin(hits, own)
    rest = hits[~part]
    walled = len(rest) == 0 or float(np.mean(rest >= 0)) >= WALLED
    return float(part.mean()) if walled else 0.0


def open_above(hits: Array, own: Array, up: Array) -> bool:
    """Whether a part surrounds a point at the sides and below, and leaves it open above."""
    part, height = np.isin(hits, own), DIRECTIONS @ up
    below, above = part[height < 0.2], part[height > 0.7]
    return bool(below.mean() > 0.75 and above.mean() < 0.3)
