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
from joda.scenes.cavity import covered, open_above, seen
from joda.scenes.model import moves_with
from joda.scenes.outline import Box, box_along, corners, grip, own_geoms, rest_of_object, surface

Array = NDArray[np.float64]
End = Literal["low_end", "high_end"]

_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
DEPTHS = (0.1, 0.25, 0.45)
"""How far behind a part it is looked for a cavity, as shares of the object's depth there."""
MIDDLES = ((0.0, 0.0), (0.4, 0.4), (-0.4, -0.4), (0.4, -0.4), (-0.4, 0.4))
"""Where on the part's face, from its centre, in units of its half sizes."""
ALIKE = 0.03
"""Parts whose sizes differ by no more than this share are of equal shape."""
LEVEL = 0.15
"""A part that rises by less than this share of its size neither falls open nor shut."""
OUT, NEARLY = 0.12, 0.03
"""A part that is so much farther out of its object (in object sizes) at one end is open there,
against the model's reference position, and where that tells nothing."""


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
        slim: the middle one over the largest: 0 a rod, 1 a square plate or a cube.
        travel: hinge: degrees; slide: m.
        axis: "vertical", "level" or "slanted".
        faces: hinge: "along" an axis in the plane of a flat part, "normal" to it, or "none" where
            the part is not flat; slide: whether it moves along or normal to its face.
        offset: hinge: how far the axis is from the part's middle, in units of half its width: 0
            through the middle, 1 at the edge, more beyond it; slide: the travel over the part's
            size along it.
        weight: what its weight would do to a part of even density: "opens", "closes" or "level";
            "level" also where it does neither for most of the way.
        covers: share of the view from inside that the part takes where it closes a cavity; else 0.
        holds: whether the part is open above and closed else, as a tray.
        sticks_out: how much farther the part is out of the object when open, in object sizes.
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
    """

    length: float = 0.0
    width: float = 0.0
    thickness: float = 0.0
    size: float = 0.0
    flat: float = 1.0
    slim: float = 1.0
    travel: float = 0.0
    axis: Literal["vertical", "level", "slanted"] = "level"
    faces: Literal["along", "normal", "none"] = "none"
    offset: float = 0.0
    weight: Literal["opens", "closes", "level"] = "level"
    covers: float = 0.0
    holds: bool = False
    sticks_out: float = 0.0
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
    looks = {
        end: _Look.at(model, data, joint, q, own, rest)
        for end, q in zip(("low_end", "high_end"), described.range, strict=True)
    }
    tiny = float(max(looks["low_end"].box.size)) <= HAND and described.type == "slide"
    closed = _end(reference) if tiny else _closed(looks, reference, described.type == "slide")
    shut = closed if closed != "unknown" else "low_end"
    other: End = "high_end" if shut == "low_end" else "low_end"
    at, open_ = looks[shut], looks[other]
    data_at(model, data, joint, described.range[0 if shut == "low_end" else 1])
    alike, controls, doors = _neighbours(model, data, joint)
    shape = _features(model, described, at, open_, data)
    family = [k for k in (joint, *alike)]
    shape = shape.model_copy(
        update={
            "siblings": len(alike),
            "controls": controls + int(shape.size <= HAND),
            "doors": doors,
            "carried": _moved(model, int(model.body_parentid[body])),
            "carries": bool(
                np.isin(model.jnt_bodyid, np.flatnonzero(moves_with(model, body))).sum() > 1
            ),
        }
    )
    grips = None
    if described.type == "hinge":
        anchor, axis = data.xanchor[joint], data.xaxis[joint]
        grips = grip(model, data, body, anchor, axis, at.outward)
    return Seen(shape, _end(closed), grips, model.joint(min(family)).name or described.name)


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
        covers, holds: see Shape.
    """

    points: Array
    box: Box
    object: Array
    anchor: Array
    axis: Array
    outward: Array
    covers: float
    holds: bool

    @classmethod
    def at(
        cls,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        joint: int,
        position: float,
        own: Array,
        rest: Array,
    ) -> "_Look":
        data_at(model, data, joint, position)
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
        covers, holds = 0.0, False
        if len(others):
            depth = float(np.ptp(others @ outward))
            covers = _covers(model, data, box, outward, depth, own, points)
            hits = seen(model, data, box.centre, 2 * float(box.size.max()))
            holds = open_above(hits, own, _up(model))
        return cls(points, box, others, anchor, axis, outward, covers, holds)

    def out(self) -> float:
        """Mean distance of the part's corners from the box around the object, in its sizes."""
        if not len(self.object):
            return 0.0
        low, high = self.object.min(axis=0), self.object.max(axis=0)
        beyond = np.maximum(np.maximum(low - self.points, self.points - high), 0)
        return float(np.linalg.norm(beyond, axis=1).mean() / max(np.max(high - low), 1e-9))


def _covers(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    box: Box,
    outward: Array,
    depth: float,
    own: Array,
    points: Array,
) -> float:
    """The largest cover that is seen from behind the part's face."""
    back = float((points @ outward).min())
    across = [(axis, half) for axis, half in zip(box.axes, box.size / 2, strict=True)
              if abs(axis @ outward) < 0.5]  # fmt: skip
    best = 0.0
    reach = 2 * (depth + float(box.size.max()))
    for share in DEPTHS:
        inner = box.centre + (back - share * depth - box.centre @ outward) * outward
        for u, v in MIDDLES:
            (first, a), (second, b) = across
            point = inner + u * a * first + v * b * second
            best = max(best, covered(seen(model, data, point, reach), own))
            if best > 0.1:  # it is one; the rest would only say how large
                return best
    return best


def _closed(looks: dict[str, _Look], reference: str, slide: bool) -> End | Literal["unknown"]:
    """The end at which a part covers its object, or a sliding one is within it.

    That of the reference position where neither tells; of a slide whose reference is at an end,
    only if it sticks out far there.
    """
    low, high = looks["low_end"], looks["high_end"]
    covers, out = low.covers - high.covers, low.out() - high.out()
    if not slide and abs(covers) > 0.03 and min(low.covers, high.covers) < 0.02:
        return "low_end" if covers > 0 else "high_end"
    if abs(out) > (OUT if reference != "unknown" else NEARLY):
        return "low_end" if out < 0 else "high_end"
    return _end(reference)


def _features(
    model: mujoco.MjModel, described: Joint, at: _Look, open_: _Look, data: mujoco.MjData
) -> Shape:
    slide = described.type == "slide"
    lo, hi = described.range
    box, up = at.box, _up(model)
    small, middle, large = np.sort(box.size)
    rise = abs(float(at.axis @ up))
    thin = int(np.argmin(box.size))
    is_flat = small < 0.45 * middle
    faces = "none" if not is_flat else "normal" if thin == 0 else "along"
    across = at.anchor - box.centre
    across = across - (across @ at.axis) * at.axis
    half = max(float(box.size[1]) / 2, 1e-9)
    offset = (hi - lo) / max(float(box.size[0]), 1e-9) if slide else np.linalg.norm(across) / half
    others = at.object
    extent = np.ptp(others, axis=0) if len(others) else np.zeros(3)
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
        axis="vertical" if rise > 0.85 else "level" if rise < 0.35 else "slanted",
        faces=faces,
        offset=_round(float(offset)),
        weight=_weight(slide, at, open_, up),
        covers=_round(at.covers),
        holds=at.holds,
        sticks_out=_round(open_.out() - at.out()),
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
        kin = model.jnt_type[other] == model.jnt_type[joint] and mine is not None
        spans = np.ptp(model.jnt_range[[joint, other]], axis=1)
        if kin and mine is not None and np.allclose(sizes, mine, rtol=ALIKE, atol=1e-4):
            if abs(spans[0] - spans[1]) <= ALIKE * spans.max():
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


def _moved(model: mujoco.MjModel, body: int) -> bool:
    """Whether a hinge or slide moves the body."""
    while body:
        first = int(model.body_jntadr[body])
        if first >= 0 and model.jnt_type[first] >= _SLIDE:
            return True
        body = int(model.body_parentid[body])
    return False


def _up(model: mujoco.MjModel) -> Array:
    length = float(np.linalg.norm(model.opt.gravity))
    return -np.asarray(model.opt.gravity) / length if length else np.array([0.0, 0.0, 1.0])


def _round(value: float) -> float:
    return float(f"{value:.4g}")
