"""What a part looks like from before its face: how much of the box around it it fills."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.outline import Box, surface

Array = NDArray[np.float64]

CELLS = 32
"""Of the grid over the box's face, along each edge."""
SPOTS = 20_000
"""On a mesh's faces, so that hardly a cell that one covers is missed."""


def filled(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: NDArray[np.intp],
    box: Box,
    outward: Array,
) -> float:
    """The share of a box's face that geoms cover when seen along a direction; 1 a rectangle.

    Meshes are seen as they are, with their holes, not by their hulls.

    Args:
        model: compiled.
        data: with kinematics.
        geoms: to look at.
        box: around them.
        outward: the direction, one of the box's axes.
    """
    across = np.abs(box.axes @ outward) < 0.5
    axes, size = box.axes[across], np.maximum(box.size[across], 1e-9)
    seen = np.zeros((CELLS, CELLS), bool)
    for geom in geoms:
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            spots = _spots(model, data, int(geom))
            flat = (spots - box.centre) @ axes.T / size + 0.5
            column, row = np.clip((flat * CELLS).astype(int), 0, CELLS - 1).T
            seen[row, column] = True
        else:
            seen |= _shade((surface(model, data, [geom]) - box.centre) @ axes.T / size + 0.5)
    return float(seen.mean())


def _shade(points: Array) -> NDArray[np.bool_]:
    """The cells whose middles lie within the points' convex hull; points in units of the grid."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        sides = ConvexHull(points).equations
    except QhullError:  # a plane, seen from its edge
        return np.zeros((CELLS, CELLS), bool)
    middle = (np.arange(CELLS) + 0.5) / CELLS
    u, v = np.meshgrid(middle, middle)
    inside = np.multiply.outer(sides[:, 0], u) + np.multiply.outer(sides[:, 1], v)
    return np.asarray(np.all(inside + sides[:, 2, None, None] <= 1e-9, axis=0))


def _spots(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Array:
    """Points on a mesh's faces, as many per area everywhere, in the world, m; shape (n, 3)."""
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float)
    start, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    corners = vertices[model.mesh_face[start : start + faces]]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.cumsum(np.linalg.norm(np.cross(a, b), axis=1))
    k = np.arange(SPOTS) + 0.5
    face = np.searchsorted(area, k / SPOTS * area[-1]).clip(max=faces - 1)
    u, v = k * 0.7548776662 % 1, k * 0.5698402910 % 1  # evenly over a square (Roberts' R2)
    beyond = u + v > 1
    u, v = np.where(beyond, 1 - u, u), np.where(beyond, 1 - v, v)
    local = corners[face, 0] + u[:, None] * a[face] + v[:, None] * b[face]
    turn = data.geom_xmat[geom].reshape(3, 3)
    return np.asarray(data.geom_xpos[geom] + local @ turn.T)
