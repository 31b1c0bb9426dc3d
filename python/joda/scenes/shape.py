"""What an object is, from its shape: features of a joint that need no names.

All are told at the closed end, from the boxes around geoms and from rays, with all other joints at
their reference positions. Along an axis of gravity that the model lacks, z is up.
"""

from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.component import Frozen
from joda.profile import Joint
from joda.scenes.cavity import covered, open_above, view
from joda.scenes.clearance import clearance
from joda.scenes.machine import of_machine
from joda.scenes.model import moves_with
from joda.scenes.outline import Box, box_along, corners, grip, own_geoms, rest_of_object, surface
from joda.scenes.silhouette import filled

Array = NDArray[np.float64]
End = Literal["low_end", "high_end"]
Faces = Literal["along", "normal", "none"]

_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
DEPTHS = (0.1, 0.25, 0.45)
"""How far behind a part it is looked for a cavity, as shares of the object's depth there."""
MIDDLES = ((0.0, 0.0), (0.4, 0.4), (-0.4, -0.4), (0.4, -0.4), (-0.4, 0.4))
"""Where on the part's face, from its centre, in units of its half sizes."""
WITNESSES = 3
"""From at least so many of these places the part must be seen to close a cavity."""
ALIKE = 0.03
"""Parts whose sizes differ by no more than this share are of equal shape."""
UPRIGHT = 0.85
"""Cosine to the vertical from which a direction is upright."""
LEVEL = 0.15
"""A part that rises by less than this share of its size neither falls open nor shut."""
SLIT = 0.015
"""Walls nearer than this share of a part's size make a slit: a lid that lies on its base has one
behind it, and covers nothing."""
OUT, NEARLY = 0.12, 0.03
"""A part that is so much farther out of its object (in its own sizes) at one end is open there: one
that slides, against the model's reference position; any, where that tells nothing."""


HAND = 0.12
"""Parts up to this size (m) are worked by fingers; one that slides is at rest where the model has
it, be that out of its object, as a button, or in it."""


class Shape(Frozen):
    """Features of a joint's part and of the object that it belongs to. SI units and degrees.

    Attributes:
        length, width, thickness: of the part: along the joint's axis, and the longer and the
            shorter edge across it; m.
        size: the largest of these, m.
        flat: the smallest of these over the middle one: 0 a sheet, 1 a rod or a cube.
        aspect: width over length.
        fill: share of its box's face that the part covers, seen from before it: 1 a rectangle, 0.79
            a disc, less a lever, spokes or a frame.
        slim: the middle one over the largest: 0 a rod, 1 a square plate or a cube.
        travel: hinge: degrees; slide: m.
        centred: whether its reference position lies in the middle of its range.
        axis: "vertical", "level" or "slanted".
        faces: hinge: "along" an axis in the plane of a flat part, "normal" to it, or "none" where
            the part is not flat; slide: whether it moves along or normal to its face.
        lies: whether the part's thinnest edge is upright, as a tray's, and not level, as a panel's.
        offset: hinge: how far the axis is from the part's middle, in units of half its width: 0
            through the middle, 1 at the edge, more beyond it; slide: the travel over the part's
            size along it.
        weight: what its weight would do to a part of even density: "opens", "closes" or "level";
            "level" also where it does neither for most of the way.
        covers: share of the view from inside that the part takes where it closes a cavity; else 0.
        holds: whether the part is open above and closed else, as a tray.
        sticks_out: how much farther the part is out of the object when open, in its own sizes.
        room_closed, room_open: how far the part could go on beyond its closed end and its open end
            before the object is in its way, in its own sizes; 1 that much or more.
        object_size: the largest edge of the box around the object, without the part; m, 0 if none.
        object_flat: the smallest edge of that box over its largest.
        share: the part's size over that.
        height: of the part's middle in the object: 0 at its bottom, 1 at its top.
        top: whether the part's centre lies in the upper tenth of the object or above it.
        siblings: how many other joints of the object move parts of equal shape.
        controls: how many joints of the object move parts smaller than a hand, this one included.
        doors: how many other joints of the object move parts larger than a hand.
        carried: whether the part is mounted on something that a joint moves itself.
        carries: whether other joints are mounted on the part.
        linked: whether it carries, or is carried by, a part of like size, as the links of an arm.
        machine: whether it is one of a robot's joints, see `joda.scenes.machine`.
    """

    length: float = 0.0
    width: float = 0.0
    thickness: float = 0.0
    size: float = 0.0
    flat: float = 1.0
    slim: float = 1.0
    travel: float = 0.0
    centred: bool = False
    axis: Literal["vertical", "level", "slanted"] = "level"
    faces: Faces = "none"
    lies: bool = False
    offset: float = 0.0
    weight: Literal["opens", "closes", "level"] = "level"
    covers: float = 0.0
    holds: bool = False
    sticks_out: float = 0.0
    fill: float = 1.0
    room_closed: float = 1.0
    room_open: float = 1.0
    object_size: float = 0.0
    object_flat: float = 1.0
    aspect: float = 1.0
    share: float = 0.0
    height: float = 0.5
    top: bool = False
    siblings: int = 0
    controls: int = 0
    doors: int = 0
    carried: bool = False
    carries: bool = False
    linked: bool = False
    machine: bool = False


@dataclass(frozen=True)
class Seen:
    """What is seen of a joint.

    Attributes:
        shape: its features; None of a part without geoms.
        closed_end: where its reference position, or else the object that it covers, tells.
        grip: distance (m) of a hinge's grip from its axis; None where there is none.
        twin: the name of the first joint of the object that moves a part of equal shape.
    """

    shape: Shape | None
    closed_end: End | Literal["unknown"]
    grip: float | None
    twin: str


def look(model: mujoco.MjModel, joint: int, described: Joint, reference: End | str) -> Seen:
    """Looks at a joint's part, its object and its neighbours.

    Args:
        model: compiled.
        joint: its id.
        described: the joint, with its range.
        reference: the end at which its reference position lies, "unknown" if at neither.
    """
    body = int(model.jnt_bodyid[joint])
    own = own_geoms(model, body)
    if not len(own):
        return Seen(None, _end(reference), None, described.name)
    data = mujoco.MjData(model)
    rest = rest_of_object(model, data_at(model, data, joint, described.range[0]), body)
    low, high = described.range
    looks = {
        "low_end": _Look.at(model, data, joint, (low, high), own, rest),
        "high_end": _Look.at(model, data, joint, (high, low), own, rest),
    }
    tiny = float(max(looks["low_end"].box.size)) <= HAND and described.type == "slide"
    closed = _end(reference) if tiny else _closed(looks, reference, described.type == "slide")
    shut = closed if closed != "unknown" else "low_end"
    other: End = "high_end" if shut == "low_end" else "low_end"
    at, open_ = looks[shut], looks[other]
    data_at(model, data, joint, described.range[0 if shut == "low_end" else 1])
    fill = filled(model, data, own, at.box, at.outward)
    alike, controls, doors = _neighbours(model, data, joint)
    shape = _features(model, joint, described, at, open_)
    below, above = _carriers(model, body), _carried(model, body)
    shape = shape.model_copy(
        update={
            "siblings": len(alike),
            "controls": controls + int(shape.size <= HAND),
            "doors": doors,
            "carried": bool(below),
            "carries": bool(above),
            "fill": _round(fill),
            "linked": any(_like(model, data, joint, other) for other in (*below, *above)),
            "machine": of_machine(model, joint),
        }
    )
    grips = None
    if described.type == "hinge":
        anchor, axis = data.xanchor[joint], data.xaxis[joint]
        grips = grip(model, data, body, anchor, axis, at.outward)
    first = model.joint(min(joint, *alike, joint)).name
    return Seen(shape, _end(closed), grips, first or described.name)


def data_at(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, position: float
) -> mujoco.MjData:
    """The data with one joint at a position, all others at their reference."""
    data.qpos[model.jnt_qposadr[joint]] = position
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def _end(text: str) -> End | Literal["unknown"]:
    return text if text in ("low_end", "high_end") else "unknown"  # type: ignore[return-value]


@dataclass(frozen=True)
class _Look:
    """A part and its object with the joint at one end.

    Attributes:
        points: corners of the part's boxes, m.
        box: around the part, along the joint's axis.
        object: corners of the object's boxes, m; empty if there are none.
        anchor, axis: of the joint, in the world.
        outward: across the part's face, away from the object.
        up: against gravity.
        covers, holds: see Shape.
        room: how far it could go on beyond this end, see `joda.scenes.clearance`.
    """

    points: Array
    box: Box
    object: Array
    anchor: Array
    axis: Array
    outward: Array
    up: Array
    covers: float
    holds: bool
    room: float

    @classmethod
    def at(
        cls,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        joint: int,
        ends: tuple[float, float],
        own: NDArray[np.intp],
        rest: NDArray[np.intp],
    ) -> "_Look":
        """With the joint at the first of its ends; the cover is that which the other removes."""
        data_at(model, data, joint, ends[0])
        points, others = surface(model, data, own), corners(model, data, rest)
        axis, anchor = data.xaxis[joint].copy(), data.xanchor[joint].copy()
        box = box_along(points, axis)
        slide = model.jnt_type[joint] == _SLIDE
        thin = int(np.argmin(box.size))
        outward = box.axes[0] if slide else box.axes[thin]
        inside = others.mean(axis=0) if len(others) else box.centre - outward
        if others.size:
            inside = (others.min(axis=0) + others.max(axis=0)) / 2
        if outward @ (box.centre - inside) < 0:
            outward = -outward
        covers, holds, room = 0.0, False, 1.0
        if len(others):
            hits = view(model, data, box.centre, 2 * float(box.size.max())).geoms
            holds = open_above(hits, own, _up(model))
            room = clearance(model, data, joint, rest, float(np.sign(ends[0] - ends[1])))
            depth = float(np.ptp(others @ outward))
            places = _behind(box, outward, depth, float((points @ outward).min()))
            reach = 2 * (depth + float(box.size.max()))
            shut = [view(model, data, place, reach) for place in places]
            data_at(model, data, joint, ends[1])
            covers = sorted(
                covered(one, view(model, data, place, reach), own, SLIT * float(box.size.max()))
                for one, place in zip(shut, places, strict=True)
            )[-WITNESSES]
        return cls(points, box, others, anchor, axis, outward, _up(model), covers, holds, room)

    def out(self) -> float:
        """Mean distance of the part's points from the object's box, in the part's sizes."""
        if not len(self.object):
            return 0.0
        around = box_along(self.object, self.up)
        apart = np.abs((self.points - around.centre) @ around.axes.T) - around.size / 2
        far = np.linalg.norm(np.maximum(apart, 0), axis=1).mean()
        return float(far / max(self.box.size.max(), 1e-9))


def _behind(box: Box, outward: Array, depth: float, back: float) -> list[Array]:
    """Places behind a part's face, in an object of that depth (m) there."""
    (first, a), (second, b) = (
        (axis, half)
        for axis, half in zip(box.axes, box.size / 2, strict=True)
        if abs(axis @ outward) < 0.5
    )
    out = []
    for share in DEPTHS:
        inner = box.centre + (back - share * depth - box.centre @ outward) * outward
        out += [inner + u * a * first + v * b * second for u, v in MIDDLES]
    return out


def _closed(looks: dict[str, _Look], reference: str, slide: bool) -> End | Literal["unknown"]:
    """The end at which a hinge's part covers its object, or a slide's part is within it.

    Where that does not tell it is that of the reference position; where that does not tell either,
    that at which the part is nearer to its object.
    """
    low, high = looks["low_end"], looks["high_end"]
    covers, out = low.covers - high.covers, low.out() - high.out()
    if not slide and abs(covers) > 0.03 and min(low.covers, high.covers) < 0.02:
        return "low_end" if covers > 0 else "high_end"
    if (slide and abs(out) > OUT) or (reference == "unknown" and abs(out) > NEARLY):
        return "low_end" if out < 0 else "high_end"
    return _end(reference)


def _features(
    model: mujoco.MjModel, joint: int, described: Joint, at: _Look, open_: _Look
) -> Shape:
    slide = described.type == "slide"
    lo, hi = described.range
    box, up = at.box, _up(model)
    small, middle, large = np.sort(box.size)
    rise = abs(float(at.axis @ up))
    thin = int(np.argmin(box.size))
    is_flat = small < 0.45 * middle
    faces: Faces = "none" if not is_flat else "normal" if thin == 0 else "along"
    across = at.anchor - box.centre
    across = across - (across @ at.axis) * at.axis
    half = max(float(box.size[1]) / 2, 1e-9)
    offset = (hi - lo) / max(float(box.size[0]), 1e-9) if slide else np.linalg.norm(across) / half
    others = at.object
    extent = box_along(others, up).size if len(others) else np.zeros(3)
    object_size = float(extent.max())
    heights = others @ up if len(others) else np.zeros(1)
    height = (float(box.centre @ up) - heights.min()) / max(float(np.ptp(heights)), 1e-9)
    return Shape(
        length=_round(box.size[0]),
        width=_round(box.size[1]),
        thickness=_round(box.size[2]),
        size=_round(large),
        flat=_round(small / max(middle, 1e-9)),
        aspect=_round(float(box.size[1] / max(box.size[0], 1e-9))),
        slim=_round(middle / max(large, 1e-9)),
        travel=_round(hi - lo if slide else np.degrees(hi - lo)),
        centred=bool(abs(model.qpos0[model.jnt_qposadr[joint]] - (lo + hi) / 2) < 0.1 * (hi - lo)),
        axis="vertical" if rise > UPRIGHT else "level" if rise < 0.35 else "slanted",
        faces=faces,
        lies=abs(float(box.axes[thin] @ up)) > UPRIGHT,
        offset=_round(float(offset)),
        weight=_weight(slide, at, open_, up),
        covers=_round(at.covers),
        holds=at.holds,
        sticks_out=_round(open_.out() - at.out()),
        room_closed=_round(at.room),
        room_open=_round(open_.room),
        object_size=_round(object_size),
        object_flat=_round(float(extent.min()) / object_size) if object_size else 1.0,
        share=_round(large / object_size) if object_size else 0.0,
        height=_round(float(np.clip(height, -1, 2))) if len(others) else 0.5,
        top=bool(len(others) and height > 0.9),
    )


def _weight(slide: bool, at: _Look, open_: _Look, up: Array) -> Literal["opens", "closes", "level"]:
    """By the middle of the part's box, on its way from the closed to the open end."""
    rises = float((open_.box.centre - at.box.centre) @ up)
    if not slide:
        middle = at.box.centre - at.anchor
        arm = middle - (middle @ at.axis) * at.axis
        reach = float(np.linalg.norm(arm))
        if reach < 0.3 * max(float(at.box.size[1]), 1e-9) / 2:
            return "level"
        rises /= 2 * reach
    else:
        rises /= max(float(np.linalg.norm(open_.box.centre - at.box.centre)), 1e-9)
    return "level" if abs(rises) < LEVEL else "closes" if rises > 0 else "opens"


def _neighbours(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int
) -> tuple[list[int], int, int]:
    """Joints of the object whose parts are of equal shape; how many small and large parts."""
    parent = int(model.body_parentid[model.jnt_bodyid[joint]])
    mine = _sizes(model, data, joint)
    alike, controls, doors = [], 0, 0
    for other in range(model.njnt):
        body = int(model.jnt_bodyid[other])
        if other == joint or model.jnt_type[other] < _SLIDE:
            continue
        if body == int(model.jnt_bodyid[joint]) or int(model.body_parentid[body]) != parent:
            continue
        sizes = _sizes(model, data, other)
        if sizes is None:
            continue
        small = bool(sizes.max() <= HAND)
        controls, doors = controls + int(small), doors + int(not small)
        if mine is None or model.jnt_type[other] != model.jnt_type[joint]:
            continue
        spans = np.ptp(model.jnt_range[[joint, other]], axis=1)
        alike_in = (np.append(sizes, spans[1]), np.append(mine, spans[0]))
        if np.allclose(*alike_in, rtol=ALIKE, atol=1e-4):
            alike.append(other)
    return alike, controls, doors


def _sizes(model: mujoco.MjModel, data: mujoco.MjData, joint: int) -> Array | None:
    """Sizes of a joint's part along its own frame, sorted, m; None without geoms."""
    body = int(model.jnt_bodyid[joint])
    geoms = own_geoms(model, body)
    if not len(geoms):
        return None
    frame = data.xmat[body].reshape(3, 3)
    return np.asarray(np.sort(np.ptp(corners(model, data, geoms) @ frame, axis=0)))


def _carriers(model: mujoco.MjModel, body: int) -> list[int]:
    """The hinges and slides that move a body from below."""
    out, above = [], int(model.body_parentid[body])
    while above:
        first = int(model.body_jntadr[above])
        if first >= 0 and model.jnt_type[first] >= _SLIDE:
            out.append(first)
        above = int(model.body_parentid[above])
    return out


def _carried(model: mujoco.MjModel, body: int) -> list[int]:
    """The hinges and slides of what a body carries."""
    inside = moves_with(model, body)
    inside[body] = False
    return [int(k) for k in np.flatnonzero(inside[model.jnt_bodyid] & (model.jnt_type >= _SLIDE))]


def _like(model: mujoco.MjModel, data: mujoco.MjData, joint: int, other: int) -> bool:
    mine, its = _sizes(model, data, joint), _sizes(model, data, other)
    return mine is not None and its is not None and bool(0.5 < mine.max() / its.max() < 2)


def _up(model: mujoco.MjModel) -> Array:
    length = float(np.linalg.norm(model.opt.gravity))
    return -np.asarray(model.opt.gravity) / length if length else np.array([0.0, 0.0, 1.0])


def _round(value: float) -> float:
    return float(f"{value:.4g}")
