"""Outlines: the boxes around what a joint moves and around what it moves against, and the grip."""

import re
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.model import moves_with

Array = NDArray[np.float64]

_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(-1, 3)
_RING = np.stack([np.cos(t := np.arange(32) * np.pi / 16), np.sin(t), np.ones(32)], axis=1)
_POLES = np.array([[0.0, 0, 1], [0, 0, -1]])
_BALL = np.concatenate(
    [_POLES, *(_RING * [np.cos(u), np.cos(u), np.sin(u)] for u in np.arange(-5, 6) * np.pi / 12)]
)
_VERTICES = 2000
"""Of meshes with more vertices, the outermost are taken."""
_TURNS = np.radians(np.arange(0, 90, 3))
_GRIP = re.compile(r"handle|grip|griff|maniglia|poign|tirador|manija|puxador|ruchka|handgre|pull")
_SMALL = 0.7
"""A grip is at most so long, as a share of the largest size of the part that it is on."""
_LIGHT = 0.15
"""Its box holds at most this share of the part's box."""
_PROUD = 0.008
"""It stands out so far from the face at least, m: less is a badge or a frame."""
_REACH = 0.35
"""It is at least this share of the farthest point's distance from the axis."""


def own_geoms(model: mujoco.MjModel, body: int) -> NDArray[np.intp]:
    """The geoms of a body and of all below it."""
    return np.flatnonzero(moves_with(model, body)[model.geom_bodyid])


def rest_of_object(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> NDArray[np.intp]:
    """The geoms of the object that a body is a part of, the body and all below it left out.

    That is the nearest body above with solid geoms, and all below it. Of the world, only what lies
    as near to the part as the part is large; planes are floors and walls and never count.
    """
    solid = model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    moved = moves_with(model, body)[model.geom_bodyid]
    above = int(model.body_parentid[body])
    while above and not (solid & ~moved & (model.geom_bodyid == above)).any():
        above = int(model.body_parentid[above])
    inside = moves_with(model, above)[model.geom_bodyid] & solid & ~moved
    found = np.flatnonzero(inside)
    if above or not len(found) or not moved.any():
        return found
    part = corners(model, data, np.flatnonzero(moved))
    low, high = part.min(axis=0), part.max(axis=0)
    margin = float(np.max(high - low))
    near = [geom for geom in found if _near(corners(model, data, [geom]), low, high, margin)]
    return np.array(near, dtype=np.intp)


def _near(points: Array, low: Array, high: Array, margin: float) -> bool:
    return bool(np.all((points.max(axis=0) > low - margin) & (points.min(axis=0) < high + margin)))


def corners(model: mujoco.MjModel, data: mujoco.MjData, geoms: object) -> Array:
    """Corners of the boxes around geoms, in the world, m; shape (8 n, 3)."""
    points = [np.empty((0, 3))]
    for geom in np.atleast_1d(np.asarray(geoms, dtype=int)):
        centre, half = np.split(model.geom_aabb[geom], 2)
        turn = data.geom_xmat[geom].reshape(3, 3)
        points.append(data.geom_xpos[geom] + (centre + _CORNERS * half) @ turn.T)
    return np.concatenate(points)


def surface(model: mujoco.MjModel, data: mujoco.MjData, geoms: object) -> Array:
    """Points on geoms that reach as far as these do, in the world, m; shape (n, 3).

    A mesh's vertices, a box's corners, of round shapes as many points as make no odds.
    """
    points = [np.empty((0, 3))]
    for geom in np.atleast_1d(np.asarray(geoms, dtype=int)):
        turn = data.geom_xmat[geom].reshape(3, 3)
        points.append(data.geom_xpos[geom] + _local(model, int(geom)) @ turn.T)
    return np.concatenate(points)


def _local(model: mujoco.MjModel, geom: int) -> Array:
    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        vertices = model.mesh_vert[first : first + count].astype(float)
        if count <= _VERTICES:
            return np.asarray(vertices)
        farthest = (_BALL @ vertices.T).argmax(axis=1)  # in any of these directions
        return np.asarray(vertices[np.unique(farthest)])
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return np.concatenate([_RING * [size[0], size[0], z] for z in (-size[1], size[1])])
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return np.asarray(_BALL * size[0] + np.sign(_BALL) * [0, 0, size[1]])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.asarray(_BALL * size[0])
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return np.asarray(_BALL * size)
    centre, half = np.split(model.geom_aabb[geom], 2)
    return np.asarray(centre + _CORNERS * half)


@dataclass(frozen=True)
class Box:
    """The smallest box around points that has a given direction as one edge.

    Attributes:
        centre: of the box, in the world, m.
        axes: unit vectors of its edges: the given direction, the longer and the shorter of the
            other two; shape (3, 3), by row.
        size: along these, m.
    """

    centre: Array
    axes: Array
    size: Array

    def place(self, point: Array) -> Array:
        """Where a point lies: 0 at the centre, 1 and -1 on the faces, along each axis."""
        return np.asarray(2 * self.axes @ (point - self.centre) / np.maximum(self.size, 1e-9))


def box_along(points: Array, direction: Array) -> Box:
    """The box of least face across a direction, to three degrees."""
    across = np.linalg.svd(direction[None])[2][1:]
    flat = points @ across.T
    best: tuple[float, Array] | None = None
    for turn in _TURNS:
        c, s = np.cos(turn), np.sin(turn)
        rotation = np.array([[c, s], [-s, c]])
        area = float(np.prod(np.ptp(flat @ rotation.T, axis=0)))
        if best is None or area < best[0] * (1 - 1e-6):
            best = area, rotation
    assert best is not None
    edges = best[1] @ across
    if np.ptp(points @ edges[0]) < np.ptp(points @ edges[1]):
        edges = edges[::-1]
    axes = np.vstack([direction, edges])
    along = points @ axes.T
    middle = (along.min(axis=0) + along.max(axis=0)) / 2
    return Box(middle @ axes, axes, np.ptp(along, axis=0))


def grip(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    body: int,
    anchor: Array,
    axis: Array,
    outward: Array,
) -> float | None:
    """Distance (m) from a hinge's axis to the grip on what it moves; None where there is none.

    A grip is a geom that is called one, or one that is small, fast on the part and lies wholly
    before the outer face of the largest geom: what turns by itself there is a dial or a knob.

    Args:
        model: compiled.
        data: with the joint at its closed end.
        body: what the joint moves.
        anchor, axis: a point on the axis, its direction; in the world.
        outward: the direction away from the object, in the world.
    """
    geoms = own_geoms(model, body)
    if len(geoms) < 2:
        return None
    points = corners(model, data, geoms)
    size, far = float(np.ptp(points, axis=0).max()), float(_away(points, anchor, axis).max())
    boxes = 8 * np.prod(model.geom_aabb[geoms, 3:], axis=1)
    main = int(geoms[int(np.argmax(boxes))])
    face = float((corners(model, data, [main]) @ outward).max())
    named, seen = [], []
    for geom, volume in zip(geoms, boxes, strict=True):
        own = corners(model, data, [geom])
        reach = float(_away(own.mean(axis=0)[None], anchor, axis)[0])
        if reach < _REACH * far or np.ptp(own, axis=0).max() > _SMALL * size:
            continue
        texts = (model.geom(geom).name, model.body(model.geom_bodyid[geom]).name)
        if _GRIP.search(" ".join(texts).lower()):
            named.append(reach)
        small = geom != main and volume < _LIGHT * boxes.max()
        fast = model.body_weldid[model.geom_bodyid[geom]] == model.body_weldid[body]
        out = own @ outward - face
        if small and fast and out.min() > -1e-3 * size and out.max() >= _PROUD:
            seen.append(reach)
    found = named or seen
    return max(found) if found else None


def _away(points: Array, anchor: Array, axis: Array) -> Array:
    """Distances from an axis, m."""
    apart = points - anchor
    return np.asarray(np.linalg.norm(apart - np.outer(apart @ axis, axis), axis=1))
