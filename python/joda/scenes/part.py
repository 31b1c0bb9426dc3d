"""The part that a joint moves: its geoms, and their shape."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.model import moves_with

Array = NDArray[np.float64]


def moving(model: mujoco.MjModel, joint: int) -> list[int]:
    """The geoms that the joint moves and the pictures show."""
    shown = groups(model, joint)
    return [
        g for g in _subtree(model, int(model.jnt_bodyid[joint])) if model.geom_group[g] in shown
    ]


def groups(model: mujoco.MjModel, joint: int) -> list[int]:
    """The groups to show: MuJoCo's default, and if the moving part has none of it, its own."""
    geoms = _subtree(model, int(model.jnt_bodyid[joint]))
    own = sorted({int(model.geom_group[g]) for g in geoms})
    return [0, 1, 2] if not own or own[0] <= 2 else [0, 1, 2, own[0]]


def _subtree(model: mujoco.MjModel, body: int) -> list[int]:
    """The geoms of a body and of all below it that are not wholly transparent."""
    inside = moves_with(model, body)[model.geom_bodyid]
    return np.flatnonzero(inside & (_alpha(model) > 0)).tolist()


def _alpha(model: mujoco.MjModel) -> Array:
    """Opacity with which MuJoCo draws each geom: its own, or its material's."""
    own = model.geom_rgba
    material = (model.geom_matid >= 0) & np.all(
        own == np.array([0.5, 0.5, 0.5, 1], np.float32), axis=1
    )
    alpha: Array = own[:, 3].astype(float)
    alpha[material] = model.mat_rgba[model.geom_matid[material], 3]
    return alpha


def outline(model: mujoco.MjModel, geom: int) -> Array:
    """Points in the geom's frame that it nearly lies within, shape (n, 3)."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    end = np.outer(np.sign(directions[:, 2]), [0, 0, 1])
    if kind == int(mujoco.mjtGeom.mjGEOM_MESH):
        mesh = int(model.geom_dataid[geom])
        first, number = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        vertices = model.mesh_vert[first : first + number].astype(float)
        return np.asarray(vertices[np.unique(np.argmax(vertices @ directions.T, axis=0))])
    if kind == int(mujoco.mjtGeom.mjGEOM_SPHERE):
        return np.asarray(size[0] * directions)
    if kind == int(mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        return np.asarray(size * directions)
    if kind == int(mujoco.mjtGeom.mjGEOM_CAPSULE):
        return np.asarray(size[0] * directions + size[1] * end)
    if kind == int(mujoco.mjtGeom.mjGEOM_CYLINDER):
        flat = directions * [1, 1, 0]
        rim = flat / np.linalg.norm(flat, axis=1, keepdims=True)
        return np.asarray(size[0] * rim + size[1] * end)
    centre, half = np.split(model.geom_aabb[geom], 2)
    corners = np.stack(np.meshgrid(*[[-1, 1]] * 3), -1).reshape(-1, 3)
    return np.asarray(centre + corners * half)
