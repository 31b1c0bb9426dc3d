"""Rays through a scene, and whether they meet a surface from behind, in any MuJoCo."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NORMALS = "normal" in (mujoco.mj_multiRay.__doc__ or "")
"""Whether this MuJoCo tells the normals where rays hit."""
PAST = 1e-6
"""How far behind a surface a ray goes on, m."""


class Hits(NamedTuple):
    """What rays hit.

    Attributes:
        geoms: ids, -1 for none; shape (n,).
        distances: in lengths of the directions, -1 for none; shape (n,).
        behind: whether the surface is met from behind: the ray comes from within a solid.
    """

    geoms: NDArray[np.int32]
    distances: Array
    behind: NDArray[np.bool_]


def rays(
    model: mujoco.MjModel, data: mujoco.MjData, point: Array, ways: Array, reach: float
) -> Hits:
    """What rays from a point hit first.

    Args:
        model: compiled.
        data: with the bodies where they are.
        point: m, shape (3,).
        ways: directions of length 1, shape (n, 3).
        reach: how far they are followed, m.
    """
    n = len(ways)
    geoms, distances, normals = np.full(n, -1, np.int32), np.full(n, -1.0), np.zeros(3 * n)
    line = model, data, point, ways.ravel(), None, 1, -1, geoms, distances
    mujoco.mj_multiRay(*line, *([normals] if NORMALS else []), n, reach)
    if NORMALS:
        return Hits(geoms, distances, np.sum(normals.reshape(-1, 3) * ways, axis=1) > 0)
    ends = zip(geoms, ways, distances, strict=True)
    behind = [geom >= 0 and _leaves(model, data, int(geom), point, *end) for geom, *end in ends]
    return Hits(geoms, distances, np.array(behind, bool))


def ray(
    model: mujoco.MjModel, data: mujoco.MjData, begin: Array, way: Array, without: int
) -> tuple[int, float, bool]:
    """The same of one ray through all bodies but one: geom, distance, whether from behind."""
    geom, normal = np.full(1, -1, np.int32), np.zeros(3)
    line = model, data, begin, way, None, 1, without, geom
    far = float(mujoco.mj_ray(*line, *([normal] if NORMALS else [])))
    hit = int(geom[0]) if far >= 0 else -1
    if NORMALS or hit < 0:
        return hit, far, bool(normal @ way > 0)
    return hit, far, _leaves(model, data, hit, begin, way, far)


def _leaves(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, begin: Array, way: Array, far: float
) -> bool:
    """Whether a ray that hits a geom after `far` leaves it there: it crosses it an odd number of
    times, as only from within a closed surface."""
    odd = False
    while far >= 0:
        odd = not odd
        begin = begin + (far + PAST) * way
        far = _through(model, data, geom, begin, way)
    return odd


def _through(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, begin: Array, way: Array
) -> float:
    """Distance to one geom along a ray, -1 if it is not met."""
    kind = mujoco.mjtGeom(model.geom_type[geom])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return float(mujoco.mj_rayMesh(model, data, geom, begin, way))
    if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
        return float(mujoco.mj_rayHfield(model, data, geom, begin, way))
    place = data.geom_xpos[geom], data.geom_xmat[geom], model.geom_size[geom]
    return float(mujoco.mju_rayGeom(*place, begin, way, kind))
