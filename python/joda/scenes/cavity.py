"""Cavities: whether a part covers a hollow, or is one itself, told by rays from inside."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.rays import rays

Array = NDArray[np.float64]

RAYS = 96
"""How many directions are looked at from a point, evenly over the sphere."""
FREED = 0.005
"""How much farther (m) a ray must go when the part is away: faces that touch hide nothing."""
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


class View(NamedTuple):
    """What rays from a point hit, one per direction.

    Attributes:
        geoms: -1 for none, or a plane: floors and walls are no part of any object.
        distances: m, infinite for none.
        within: whether the surface is met from behind: the point lies within a solid.
    """

    geoms: NDArray[np.int32]
    distances: Array
    within: NDArray[np.bool_]


def view(model: mujoco.MjModel, data: mujoco.MjData, point: Array, reach: float) -> View:
    """What rays from a point hit within `reach` (m)."""
    geoms, distances, within = rays(model, data, point, DIRECTIONS, reach)
    planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    none = (geoms < 0) | np.isin(geoms, planes)
    return View(np.where(none, -1, geoms), np.where(none, np.inf, distances), within & ~none)


def covered(shut: View, open_: View, own: NDArray[np.intp], deep: float) -> float:
    """The share of a point's view that a part takes, if all else in view is wall; else 0.

    Args:
        shut: with the part where it may cover a cavity.
        open_: with the part at the other end; what is as near then was no cover.
        own: the geoms of the part.
        deep: how far away (m) half of the wall is at least: what is nearer is a slit, no cavity.
    """
    part = np.isin(shut.geoms, own)
    wall = ((shut.geoms >= 0) & ~shut.within)[~part]
    walled = len(wall) == 0 or float(np.mean(wall)) >= WALLED
    walled = walled and float(np.median(shut.distances[~part] if len(wall) else [np.inf])) >= deep
    frees = open_.distances > shut.distances + FREED
    return float(np.mean(part & frees)) if walled else 0.0


def open_above(hits: NDArray[np.int32], own: NDArray[np.intp], up: Array) -> bool:
    """Whether a part surrounds a point at the sides and below, and leaves it open above."""
    part, height = np.isin(hits, own), DIRECTIONS @ up
    below, above = part[height < 0.2], part[height > 0.7]
    return bool(below.mean() > 0.75 and above.mean() < 0.3)
