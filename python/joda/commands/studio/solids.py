"""A scene's geoms as triangles for the 3D view: still ones, and those that the joint moves."""

import struct
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.motion import at_home
from joda.scenes.part import groups, moving

Array = NDArray[np.float64]

ROUND = 28
"""Faces around a full turn."""
_KIND = mujoco.mjtGeom


@dataclass(frozen=True)
class Solid:
    """Geoms of one colour that move together, as triangles.

    Attributes:
        moves: whether the joint moves them.
        rgba: red, green, blue and opacity, 0 to 1.
        triangles: corners in the world, m, counter-clockwise from outside, shape (n, 3, 3).
    """

    moves: bool
    rgba: tuple[float, float, float, float]
    triangles: Array

    def stl(self) -> bytes:
        """As a binary STL file."""
        sides = self.triangles[:, 1:] - self.triangles[:, :1]
        normal = np.cross(sides[:, 0], sides[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        rows = np.zeros(len(normal), [("numbers", "<f4", 12), ("end", "<u2")])
        rows["numbers"] = np.hstack([normal, self.triangles.reshape(-1, 9)])
        return bytes(80) + struct.pack("<I", len(rows)) + rows.tobytes()


@dataclass(frozen=True)
class Shape:
    """A scene with its joint at `reference`, ready to be moved.

    Attributes:
        solids: what is seen.
        hinge: whether the joint turns.
        anchor, axis: of the joint, in the world, shape (3,).
        reference: position (rad or m) at which the solids stand.
    """

    solids: tuple[Solid, ...]
    hinge: bool
    anchor: Array
    axis: Array
    reference: float

    def pose(self, position: float) -> tuple[Array, Array]:
        """Where the moving solids go with the joint at a position (rad or m).

        Returns:
            rotation (3, 3) and then translation (3,), m.
        """
        way = position - self.reference
        if not self.hinge:
            return np.eye(3), way * self.axis
        turn = np.empty(9)
        quaternion = np.array([np.cos(way / 2), *(np.sin(way / 2) * self.axis)])
        mujoco.mju_quat2Mat(turn, quaternion)
        rotation = turn.reshape(3, 3)
        return rotation, self.anchor - rotation @ self.anchor

    def reach(self, *positions: float) -> Array:
        """Corners of the moving solids at these positions (rad or m), shape (n, 3)."""
        own = [solid.triangles.reshape(-1, 3) for solid in self.solids if solid.moves]
        points = np.concatenate(own) if own else self.anchor[None]
        poses = [self.pose(position) for position in positions]
        return np.concatenate([points @ turn.T + shift for turn, shift in poses])


def shape(model: mujoco.MjModel, joint: int) -> Shape:
    """The scene at home, the joint at the low end of its range; planes and height fields are left
    out.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
    """
    data = at_home(model)
    low = float(model.jnt_range[joint, 0])
    data.qpos[model.jnt_qposadr[joint]] = low
    mujoco.mj_kinematics(model, data)
    own, shown = set(moving(model, joint)), groups(model, joint)
    parts: dict[tuple[bool, tuple[float, ...]], list[Array]] = {}
    for geom in range(model.ngeom):
        rgba = _rgba(model, geom)
        local = _triangles(model, geom)
        if local is None or rgba[3] == 0 or model.geom_group[geom] not in shown:
            continue
        placed = local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        parts.setdefault((geom in own, rgba), []).append(placed)
    solids = tuple(
        Solid(moves, rgba, np.concatenate(placed))  # type: ignore[arg-type]
        for (moves, rgba), placed in parts.items()
    )
    return Shape(
        solids=solids,
        hinge=bool(model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_HINGE)),
        anchor=data.xanchor[joint].copy(),
        axis=data.xaxis[joint].copy(),
        reference=low,
    )


def _rgba(model: mujoco.MjModel, geom: int) -> tuple[float, ...]:
    """Its own colour, or its material's where it has none, as MuJoCo draws it."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    plain = np.allclose(own, [0.5, 0.5, 0.5, 1])
    colour = model.mat_rgba[material] if plain and material >= 0 else own
    return tuple(round(float(part), 3) for part in colour)


def _triangles(model: mujoco.MjModel, geom: int) -> Array | None:
    """In the geom's frame, shape (n, 3, 3); None for what is not drawn."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind in (int(_KIND.mjGEOM_MESH), int(_KIND.mjGEOM_SDF)):
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        corners = model.mesh_vert[first : first + count].astype(float)
        begin, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        return np.asarray(corners[model.mesh_face[begin : begin + faces]])
    if kind == int(_KIND.mjGEOM_BOX):
        return _box(size)
    if kind in (int(_KIND.mjGEOM_SPHERE), int(_KIND.mjGEOM_ELLIPSOID)):
        radii = size if kind == int(_KIND.mjGEOM_ELLIPSOID) else np.full(3, size[0])
        angles = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)
        return np.asarray(_turned(np.cos(angles), np.sin(angles)) * radii)
    if kind == int(_KIND.mjGEOM_CAPSULE):
        angles = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 2)
        ends = np.where(angles > 0, size[1], -size[1])
        return _turned(size[0] * np.cos(angles), size[0] * np.sin(angles) + ends)
    if kind == int(_KIND.mjGEOM_CYLINDER):
        return _turned(size[0] * np.array([0, 1, 1, 0]), size[1] * np.array([-1, -1, 1, 1]))
    return None


def _box(half: Array) -> Array:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array(
        [corners[[a, b, c]] for p, q, r, s in faces for a, b, c in [(p, q, r), (p, r, s)]]
    )


def _turned(radius: Array, height: Array) -> Array:
    """The surface that a line from below to above sweeps around z, shape (n, 3, 3)."""
    angle = np.linspace(0, 2 * np.pi, ROUND + 1)
    grid = np.stack(
        np.broadcast_arrays(
            radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle), height[:, None]
        ),
        axis=-1,
    )
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3, 3)
    sides = faces[:, 1:] - faces[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return np.asarray(faces[area > 1e-12 * area.max()])
