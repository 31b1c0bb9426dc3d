"""Profiles as the arrays that the kernel reads."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
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
from joda.warp.curves import Curves
from joda.warp.numbers import Curve, Number

Array = NDArray[np.float64]

SCENES = -1.0
"""Of an end stop whose restitution is the scene's."""
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
                out[Number.END_STOP_RESTITUTION_LOW] = core.stop_damping(effect.restitution)
            case EndStopRestitution(end="high"):
                out[Number.END_STOP_RESTITUTION_HIGH] = core.stop_damping(effect.restitution)
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
    """The table of all curves; the same curve stands in it once."""
    shape = (len(variants), len(variants[0]), len(Curve))
    first, pieces = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
    steepest = np.zeros(shape, np.float32)
    table: list[tuple[Array, ...]] = []
    found: dict[tuple[str, str], tuple[int, int, float]] = {}
    size = 0
    for k, profiles in enumerate(variants):
        for j, profile in enumerate(profiles.values()):
            for curve, text in curves_of(profile).items():
                if text not in found:
                    merged = _merge(*text)
                    found[text] = (size, len(merged[0]) - 1, float(merged[3].max()))
                    table.append(merged)
                    size += len(merged[0])
                first[k, j, curve], pieces[k, j, curve], steepest[k, j, curve] = found[text]
    knots, at, cubics, descents = (
        (np.concatenate(parts) for parts in zip(*table, strict=True))
        if table
        else (np.zeros(1), np.zeros(1), np.zeros((1, 4)), np.zeros(1))
    )
    out = Curves()
    out.first = wp.array(first, dtype=int, device=device)
    out.pieces = wp.array(pieces, dtype=int, device=device)
    out.steepest = wp.array(steepest, dtype=float, device=device)
    out.knots = wp.array(knots, dtype=float, device=device)
    out.at = wp.array(at, dtype=float, device=device)
    out.cubics = wp.array(cubics, dtype=wp.vec4, device=device)
    out.descents = wp.array(descents, dtype=float, device=device)
    return out


@lru_cache(maxsize=4096)
def _merge(text: str, combine: str) -> tuple[Array, Array, Array, Array]:
    """Knots, values there, cubics from each knot on, and their largest descents."""
    channel = core.Channel(text, combine)
    knots, cubics = channel.knots, channel.coefficients
    width = np.diff(knots)
    _, c1, c2, c3 = cubics
    slopes = [c1, c1 + width * (2 * c2 + 3 * width * c3)]
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = -c2 / (3 * c3)
    inside = (vertex > 0) & (vertex < width)
    vertex = np.where(inside, vertex, 0)
    slopes.append(c1 + vertex * (2 * c2 + 3 * vertex * c3))
    descents = np.maximum(0, -np.min(slopes, axis=0))
    last = np.zeros((1, 4))
    return knots, channel(knots)[0], np.vstack((cubics.T, last)), np.append(descents, 0)
