"""Profiles as the arrays that the kernel reads."""

from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from joda import _core as core
from joda.effects import (
    Backlash,
    CurveEffect,
    EndStopRestitution,
    GravityOffset,
    LearnedForce,
    LoadDependentFriction,
    PreslidingFriction,
    StribeckFriction,
)
from joda.profile import CHANNELS, Profile
from joda.warp.curves import BUCKETS, Curves
from joda.warp.numbers import Curve, Number

Array = NDArray[np.float64]

SCENES = -1.0
"""Of an end stop whose restitution is the scene's."""
DAMPINGS = 1025
"""Of end stops, whose restitution is listed."""
SIDED = {
    "direction_dependent_damping": Curve.DAMPING_UP,
    "quadratic_damping": Curve.QUADRATIC_UP,
    "asymmetric_friction": Curve.ASYMMETRY_UP,
}
"""Effects with a curve for each direction, that of negative motion behind that of positive."""


def numbers_of(profile: Profile) -> Array:
    """A profile's numbers, by `Number`; what it lacks does nothing."""
    out = np.zeros(len(Number))
    out[[Number.RANGE_LO, Number.RANGE_HI]] = profile.joint.range
    for number in Number:
        if number.name.endswith("STRENGTH"):
            out[number] = 1
    out[[Number.STRIBECK_FRICTION_VELOCITY, Number.STRIBECK_FRICTION_EXPONENT]] = 1
    out[Number.LEARNED_FORCE_TIME] = 1
    out[[Number.END_STOP_RESTITUTION_LOW, Number.END_STOP_RESTITUTION_HIGH]] = SCENES
    for effect in profile.effects:
        match effect:
            case StribeckFriction():
                out[Number.STRIBECK_FRICTION_VELOCITY] = effect.velocity
                out[Number.STRIBECK_FRICTION_EXPONENT] = effect.exponent
            case LoadDependentFriction():
                out[Number.LOAD_DEPENDENT_FRICTION_COEFFICIENT] = effect.coefficient
            case PreslidingFriction():
                out[Number.PRESLIDING_FRICTION_STIFFNESS] = effect.stiffness
                out[Number.PRESLIDING_FRICTION_DAMPING] = effect.damping
                out[Number.PRESLIDING_FRICTION_BREAKAWAY] = effect.breakaway
            case GravityOffset():
                out[Number.GRAVITY_OFFSET_SIN] = effect.sin
                out[Number.GRAVITY_OFFSET_COS] = effect.cos
                out[Number.GRAVITY_OFFSET_FORCE] = effect.force
            case Backlash():
                out[Number.BACKLASH_PLAY] = effect.play
                out[Number.BACKLASH_HANDLE] = effect.handle
                out[Number.BACKLASH_LOAD] = effect.load
                out[Number.BACKLASH_SHARE] = effect.share
            case LearnedForce():
                out[Number.LEARNED_FORCE_TIME] = effect.time
                position = effect.memory == "position"
                gain = Number.LEARNED_FORCE_STIFFNESS if position else Number.LEARNED_FORCE_CHANGE
                out[gain] = effect.gain
            case EndStopRestitution(end="low"):
                out[Number.END_STOP_RESTITUTION_LOW] = effect.restitution
            case EndStopRestitution(end="high"):
                out[Number.END_STOP_RESTITUTION_HIGH] = effect.restitution
    return out


def curves_of(profile: Profile) -> dict[Curve, tuple[str, str]]:
    """A profile's curves: text and how components are combined, as in the plugin's attributes."""
    out = {}
    for curve, name in zip(
        (Curve.CONSERVATIVE, Curve.FRICTION, Curve.DAMPING), CHANNELS, strict=True
    ):
        channel = getattr(profile.channels, name)
        if channel.components:
            out[curve] = (channel.text(), channel.combine)
    for effect in profile.effects:
        if not isinstance(effect, CurveEffect):
            continue
        text = (effect.curve_text(), "sum")
        if effect.effect not in SIDED:
            out[Curve.STRIBECK] = text
            continue
        up, way = SIDED[effect.effect], getattr(effect, "direction")  # noqa: B009
        if way != "negative":
            out[up] = text
        if way != "positive":
            out[Curve(up + 1)] = text
    return out


def make_curves(variants: Sequence[Mapping[str, Profile]], device: Any) -> Curves:
    """The lists of all curves; joints with the same curves share them."""
    shape = (len(variants), len(variants[0]))
    where = np.zeros((*shape, 4), np.int32)
    slots = np.full((*shape, len(Curve) + 1), -1, np.int32)
    steepest = np.zeros(shape, np.float32)
    lists: dict[str, list[Array]] = {
        "knots": [],
        "descents": [],
        "starts": [],
        "at": [np.zeros(1)],
        "cubics": [np.zeros((1, 4))],
    }
    found: dict[Any, tuple[list[int], float]] = {}
    for k, profiles in enumerate(variants):
        for j, profile in enumerate(profiles.values()):
            own = curves_of(profile)
            key = tuple(own.items())
            if key not in found:
                joint = _joint(own)
                place = [sum(map(len, lists[name])) for name in ("knots", "starts", "cubics")]
                place.insert(1, len(joint["knots"]) - 1)
                found[key] = (place, float(joint["descents"].max()))
                for name, more in joint.items():
                    lists[name].append(more)
            where[k, j], steepest[k, j] = found[key]
            slots[k, j, list(own)] = range(len(own))
            slots[k, j, -1] = len(own)
    out = Curves()
    out.where = wp.array(where, dtype=wp.vec4i, device=device)
    out.slots = wp.array(slots, dtype=int, device=device)
    out.steepest = wp.array(steepest, dtype=float, device=device)
    for name, dtype in (
        ("knots", float),
        ("descents", float),
        ("starts", int),
        ("at", float),
        ("cubics", wp.vec4),
    ):
        setattr(out, name, wp.array(np.concatenate(lists[name]), dtype=dtype, device=device))
    return out


def _joint(curves: Mapping[Curve, tuple[str, str]]) -> dict[str, Array]:
    """A joint's part of each list of `Curves`."""
    channels = [_merged(*text) for text in curves.values()]
    knots = np.unique(np.concatenate([[0.0, 1.0], *(channel.knots for channel in channels)]))
    at = np.array([channel(knots)[0] for channel in channels]).reshape(len(channels), len(knots))
    cubics = np.array([_about(channel, knots) for channel in channels]).reshape(*at.shape, 4)
    begins = np.arange(BUCKETS) / BUCKETS
    starts = np.searchsorted(knots.astype(np.float32), begins, side="right") - 1
    descents = np.zeros(len(knots))
    if Curve.CONSERVATIVE in curves:
        descents = _descents(channels[list(curves).index(Curve.CONSERVATIVE)], knots)
    return {
        "knots": knots,
        "descents": descents,
        "starts": starts,
        "at": at.T.ravel(),
        "cubics": cubics.swapaxes(0, 1).reshape(-1, 4),
    }


@cache
def rebounds() -> Array:
    """Restitution of an end stop with a damping of 0 to 1, in equal steps; it falls."""
    return np.array([core.stop_rebound(damping) for damping in np.linspace(0, 1, DAMPINGS)])


@lru_cache(maxsize=4096)
def _merged(text: str, combine: str) -> core.PiecewiseCubic:
    return core.PiecewiseCubic(text, combine)


def _pieces(
    channel: core.PiecewiseCubic, knots: Array
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Which piece of a channel begins at or before each knot, and whether it reaches beyond."""
    piece = np.searchsorted(channel.knots, knots, side="right") - 1
    inside = (piece >= 0) & (piece < len(channel.knots) - 1)
    return np.where(inside, piece, 0), inside


def _about(channel: core.PiecewiseCubic, knots: Array) -> Array:
    """Coefficients about each of these knots, shape (knots, 4); 0 outside the channel's own."""
    piece, inside = _pieces(channel, knots)
    c0, c1, c2, c3 = channel.cubics[piece].T
    t = knots - channel.knots[piece]
    about = (((c3 * t + c2) * t + c1) * t + c0, (3 * c3 * t + 2 * c2) * t + c1, 3 * c3 * t + c2, c3)
    return np.where(inside[:, None], np.stack(about, axis=1), 0)


def _descents(channel: core.PiecewiseCubic, knots: Array) -> Array:
    """The largest descent on the channel's piece that begins at or before each knot, or 0."""
    piece, inside = _pieces(channel, knots)
    return np.where(inside, channel.descents[piece], 0)
