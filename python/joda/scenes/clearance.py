"""Clearance: how far a part could go on beyond an end of its range before its object is met."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.outline import own_geoms, surface
from joda.scenes.rays import PAST, ray

Array = NDArray[np.float64]

PLACES = 48
"""From at most so many points of the part, evenly among those that it has."""
BACK = 0.02
"""Rays start so far behind the part's points, as a share of its size: what touches is met, too."""
WITHIN = 0.03
"""How far within their geom the points are, as a share of its size: along faces rays graze."""


def clearance(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, rest: NDArray[np.intp], sign: float
) -> float:
    """The way that is free ahead of a part, in units of its size; at most 1, and 1 for nothing.

    Rays go from points of the part's surface the way that each would move; meshes are met as they
    are, not by their hulls.

    Args:
        model: compiled.
        data: with the joint where it is looked from.
        joint: its id.
        rest: geoms of the object, without the part.
        sign: 1 for motion towards larger positions, -1 for smaller.
    """
    body = int(model.jnt_bodyid[joint])
    own = own_geoms(model, body)
    outer = [surface(model, data, [geom]) for geom in own]
    size = max(float(np.ptp(np.concatenate(outer), axis=0).max()), 1e-9)
    points = np.concatenate([each + WITHIN * (each.mean(axis=0) - each) for each in outer])
    points = points[np.linspace(0, len(points) - 1, min(PLACES, len(points))).astype(int)]
    axis, anchor = data.xaxis[joint], data.xanchor[joint]
    slide = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
    ways = np.tile(axis, (len(points), 1)) if slide else np.cross(axis, points - anchor)
    lengths = np.linalg.norm(ways, axis=1)
    mine, others, free = set(own.tolist()), set(rest.tolist()), 1.0
    for point, way, length in zip(points, ways, lengths, strict=True):
        if length < 0.3 * lengths.max():
            continue
        ahead = sign * way / length
        begin, left = point - BACK * size * ahead, (1 + BACK) * size
        while left > 0:
            geom, far, behind = ray(model, data, begin, ahead, body)
            if far < 0 or far > left:
                break
            if geom in others and not behind:
                free = min(free, max(1 - (left - far) / size, 0.0))
                break
            if geom not in mine and geom not in others:
                break
            begin, left = begin + (far + PAST) * ahead, left - far - PAST
    return free
