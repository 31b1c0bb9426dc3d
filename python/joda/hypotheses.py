"""What may be missing from a joint's model: each effect with unknown numbers, and where to begin.

The numbers are in the joint's own units: forces in its usual force, positions normalised, speeds in
its usual speed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.effects import (
    AddedInertia,
    AsymmetricFriction,
    Backlash,
    DirectionDependentDamping,
    Effect,
    EndStopRestitution,
    GravityOffset,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.judge import Unknowns
from joda.profile import Channel, Profile
from joda.template import Template

Array = NDArray[np.float64]
Write = Callable[[Profile, Array], Profile]

WIDTHS = (0.08, 0.15, 0.28, 0.5)
"""Of the intervals that are tried, in normalised position."""
NARROWEST = 0.02
KNOTS = 9
"""Control points of a free curve."""
FORCES = (0.0, 30.0)
TRIAL = 0.1
"""Strength with which an effect is tried, in usual forces."""
RARE = 3.0
"""Rarity of a constant force all over a slide's range: a tilt is the same, and more usual."""
KNOWN_LAW, KNOWN_SHAPE = 0.12, 0.3
"""Part of the excess misfit that a true effect may leave, by what is known of it."""
TINY = 1e-12
"""As good as no force."""
Direction = Literal["both", "positive", "negative"]


@dataclass(frozen=True)
class Units:
    """A joint's own units.

    Attributes:
        force: usual force, N·m or N.
        speed: usual speed, rad/s or m/s.
        inertia: kg·m² or kg.
        span: of the range, rad or m.
        lo, hi: of the range.
        friction: usual dry friction of the model, N·m or N; 0 for none.
        forced: whether a force was recorded.
        weight: largest force of gravity, N·m or N.
        step: of the windows, s.
        hinge: whether it is a hinge.
    """

    force: float
    speed: float
    inertia: float
    span: float
    friction: float
    forced: bool
    weight: float
    hinge: bool


@dataclass(frozen=True)
class Hypothesis:
    """An effect that may be missing.

    Attributes:
        effect: its name.
        direction: both, positive or negative.
        unknowns: its numbers.
        trials: values to begin with, shape (trials, k).
        write: the profile with the effect.
        interval: where it acts, in normalised position.
        magnitude: how large it is, in `unit`.
        unit: of the magnitude.
        ends: how many of the last numbers are ends of its interval.
        rarity: twice the logarithm of how much rarer it is than others.
        remains: part of the excess misfit that it may leave where it is the true one: more where
            only the rough shape of its curve is known.
    """

    effect: str
    direction: str
    unknowns: Unknowns
    trials: Array
    write: Write
    interval: Callable[[Array], tuple[float, float]]
    magnitude: Callable[[Array], float]
    unit: str
    ends: int = 0
    rarity: float = 0.0
    remains: float = KNOWN_LAW


def with_component(profile: Profile, channel: str, component: Component) -> Profile:
    """As `Profile.with_component`, without checking everything again."""
    old: Channel = getattr(profile.channels, channel)
    new = old.model_copy(update={"components": (*old.components, component)})
    channels = profile.channels.model_copy(update={channel: new})
    return profile.model_copy(update={"channels": channels})


def with_effect(profile: Profile, effect) -> Profile:
    """As `Profile.with_effect`, without checking everything again."""
    kept = tuple(other for other in profile.effects if other.key != effect.key)
    return profile.model_copy(update={"effects": (*kept, effect)})


def _unit(units: Units, power: int = 0) -> str:
    """Of a force, or of one per speed to that power."""
    force, length = ("N·m", "rad") if units.hinge else ("N", "m")
    return force + ("", f"·s/{length}", f"·s²/{length}²")[power]


def everywhere(x: Array) -> tuple[float, float]:
    """All over the range."""
    return 0.0, 1.0


def _unknowns(*rows: tuple[float, float, float]) -> Unknowns:
    """From low, high and step of each number."""
    low, high, step = np.array(rows).T
    return Unknowns(low, high, step, np.zeros(len(low)), np.full(len(low), np.inf))


STRENGTH = (*FORCES, 0.005)
END = (0.0, 1.0, 0.004)
EDGE = (0.002, 0.3, 0.01)
"""Of a constant on a part of the range, in units of that part."""
WIDEST = 0.5
"""Of a latch."""


def hypotheses(
    units: Units, templates: Mapping[str, Template], profile: Profile
) -> list[Hypothesis]:
    """All that may be missing."""
    out = [*_templates(units, templates), *_curves(units), *_effects(units)]
    present = {effect.key for effect in profile.effects}
    return [h for h in out if not _there(h, present)]


def _there(h: Hypothesis, present: set[str]) -> bool:
    key = h.effect if h.direction == "both" else f"{h.effect} {h.direction}"
    return key in present or f"{h.effect} both" in present


# --- templates
def _templates(units: Units, templates: Mapping[str, Template]) -> Iterator[Hypothesis]:
    for name, template in templates.items():
        if name.startswith("constant_"):
            yield from _constant(units, name, template)
        elif name.startswith("spring_return"):
            yield from _spring(units, name)
        elif name.startswith("spring_loaded_snap"):
            yield _snap(units, name)
        elif name.startswith("magnetic"):
            yield _magnet(units, name)
        elif name == "bistable_mechanism":
            yield _bistable(units, name)
        elif name == "bistable_mechanism_internal":
            yield _wells(units, name, (1.0, -1.0, 1.0, -1.0))
        elif name == "detent_internal":
            yield _wells(units, name, (1.0, -1.0))


def _ends(place: str, x: Array) -> tuple[float, float]:
    """The interval, of which the last numbers are the ends."""
    if place == "whole":
        return 0.0, 1.0
    if place == "low":
        return 0.0, max(float(x[-1]), NARROWEST)
    if place == "high":
        return min(float(x[-1]), 1.0 - NARROWEST), 1.0
    a, b = sorted((float(x[-2]), float(x[-1])))
    a = min(a, 1.0 - NARROWEST)
    return a, max(b, a + NARROWEST)


Bounds = list[tuple[float, float, float]]


def _places(place: str, widest: float = 1.0) -> tuple[Bounds, list[tuple[float, ...]]]:
    """Bounds and steps of the numbers of an interval, and values to try."""
    widths = [w for w in (*WIDTHS, 0.8) if w <= widest]
    if place == "whole":
        return [], [()]
    if place == "low":
        return [(NARROWEST, widest, 0.004)], [(w,) for w in widths]
    if place == "high":
        return [(1 - widest, 1 - NARROWEST, 0.004)], [(1 - w,) for w in widths]
    tries = [(a, a + w) for w in WIDTHS for a in np.arange(0, 1 - w + 1e-9, w / 3)]
    return [END, END], tries


CATCH = (0.0, 0.6, 0.01)
"""Dry friction of a catch, in units of its force."""


def _caught(profile: Profile, name: str, interval: tuple[float, float], most: float) -> Profile:
    """With the dry friction of a catch."""
    if most <= 0:
        return profile
    part = Component(label=name, interval=interval, x=(0, 0.15, 0.85, 1), y=(0, most, most, 0))
    return with_component(profile, "friction", part)


def _wells(units: Units, name: str, lobes: Sequence[float]) -> Hypothesis:
    """Potential wells: strength, where within its part each pulls most, friction, the interval.

    Args:
        units: of the joint.
        name: of the template.
        lobes: signs of the force from one end of the interval to the other, of even count.
    """
    parts = len(lobes)
    zeros = np.arange(parts // 2 + 1) * 2 / parts
    centres = 0.5 * (zeros[1:] + zeros[:-1])

    def write(profile: Profile, x: Array) -> Profile:
        half = float(x[1]) / parts
        tops = np.stack([centres - half, centres + half], axis=1).ravel()
        at = np.concatenate([zeros, centres, tops])
        order = np.argsort(at)
        y = np.concatenate([np.zeros(len(zeros) + len(centres)), lobes])[order]
        interval = _ends("anywhere", x)
        own = tuple(units.force * x[0] * y)
        part = Component(label=name, interval=interval, x=tuple(at[order]), y=own)
        most = units.force * x[0] * x[2]
        return _caught(with_component(profile, "conservative", part), name, interval, most)

    bounds, tries = _places("anywhere")
    return Hypothesis(
        name,
        "both",
        _unknowns(STRENGTH, (0.3, 0.7, 0.02), CATCH, *bounds),
        np.array([(TRIAL, 0.45, 0.0, *t) for t in tries]),
        write,
        lambda x: _ends("anywhere", x),
        lambda x: units.force * float(x[0]),
        _unit(units),
        len(bounds),
        remains=KNOWN_SHAPE,
    )


NEAR = np.array((0.0, 0.2, 0.5, 1.0, 1.7, 2.7, 4.2, 6.0))
"""Control points of a magnet, in units of its gap: there its force has fallen to 2 %."""
SEEN = 3.47
"""Where it has fallen to 5 %."""


def _magnet(units: Units, name: str) -> Hypothesis:
    """An attraction 1 / (distance + gap)²: strength, friction, gap."""
    low = name.endswith("low_end")
    law = (1 + NEAR) ** -2.0 - (1 + NEAR[-1]) ** -2.0
    law /= law[0]

    def write(profile: Profile, x: Array) -> Profile:
        reach = min(float(x[2]) * NEAR[-1], 1.0)
        at, y = NEAR * float(x[2]) / reach, units.force * x[0] * law
        kept = at < 1
        end = np.interp(1.0, at, y)
        at, y = np.append(at[kept], 1.0), np.append(y[kept], end)
        interval = (0.0, reach) if low else (1 - reach, 1.0)
        at, y = (at, -y) if low else (1 - at[::-1], y[::-1])
        part = Component(label=name, interval=interval, x=tuple(at), y=tuple(y))
        most = units.force * x[0] * x[1]
        return _caught(with_component(profile, "conservative", part), name, interval, most)

    def interval(x: Array) -> tuple[float, float]:
        reach = min(SEEN * float(x[2]), 1.0)
        return (0.0, reach) if low else (1 - reach, 1.0)

    return Hypothesis(
        name,
        "both",
        _unknowns(STRENGTH, CATCH, (0.004, 0.4, 0.002)),
        np.array([(2 * TRIAL, 0.0, gap) for gap in (0.02, 0.04, 0.08, 0.16)]),
        write,
        interval,
        lambda x: units.force * float(x[0]),
        _unit(units),
        remains=KNOWN_SHAPE,
    )


def _spring(units: Units, name: str) -> Iterator[Hypothesis]:
    """Its largest force, what part of that is preload, and how far it reaches."""
    low = name.endswith("low_end")
    place = "low" if low else "high"

    def write(profile: Profile, x: Array, reach: str) -> Profile:
        most = units.force * x[0]
        # the force is largest at the far end
        y = (-x[1] * most, -most) if low else (most, x[1] * most)
        part = Component(label=name, interval=_ends(reach, x), x=(0, 1), y=y)
        return with_component(profile, "conservative", part)

    for reach in ("whole", place):
        bounds, tries = _places(reach)
        yield Hypothesis(
            name,
            "both",
            _unknowns(STRENGTH, (0.0, 0.7, 0.02), *bounds),
            np.array([(TRIAL, 0.25, *t) for t in tries]),
            lambda profile, x, reach=reach: write(profile, x, reach),
            lambda x, reach=reach: _ends(reach, x),
            lambda x: units.force * float(x[0]),
            _unit(units),
            len(bounds),
        )


def _snap(units: Units, name: str) -> Hypothesis:
    """A latch: how it holds, its barrier, the hold at the very end, where it tips over, where it
    holds most, friction, how far it reaches."""
    low = name.endswith("low_end")
    place = "low" if low else "high"

    def write(profile: Profile, x: Array) -> Profile:
        hold, barrier, end, tip, most = (float(value) for value in x[:5])
        rest = 1 - tip
        at = np.array((0.0, most * tip, tip, tip + 0.4 * rest, tip + 0.75 * rest, 1.0))
        y = units.force * np.array((-end * hold, -hold, 0.0, barrier, 0.35 * barrier, 0.0))
        if not low:
            at, y = 1 - at[::-1], -y[::-1]
        interval = _ends(place, x)
        part = Component(label=name, interval=interval, x=tuple(at), y=tuple(y))
        rubs = units.force * max(hold, barrier) * float(x[5])
        return _caught(with_component(profile, "conservative", part), name, interval, rubs)

    bounds, tries = _places(place, WIDEST)
    own = [STRENGTH, STRENGTH, (0.0, 1.0, 0.02), (0.3, 0.75, 0.01), (0.15, 0.7, 0.02), CATCH]
    return Hypothesis(
        name,
        "both",
        _unknowns(*own, *bounds),
        np.array([(TRIAL, TRIAL, 0.5, tip, 0.45, 0.0, *t) for t in tries for tip in (0.4, 0.6)]),
        write,
        lambda x: _ends(place, x),
        lambda x: units.force * float(x[:2].max()),
        _unit(units),
        len(bounds),
        remains=KNOWN_SHAPE,
    )


def _bistable(units: Units, name: str) -> Hypothesis:
    """Strength, where it tips over, and how far from there the force is largest."""

    def write(profile: Profile, x: Array) -> Profile:
        tip, far = float(x[1]), float(x[2])
        at = (0.0, tip * (1 - far), tip, tip + (1 - tip) * far, 1.0)
        y = tuple(units.force * x[0] * np.array((-0.6, -1.0, 0.0, 1.0, 0.6)))
        part = Component(label=name, interval=(0, 1), x=at, y=y)
        return with_component(profile, "conservative", part)

    return Hypothesis(
        name,
        "both",
        _unknowns(STRENGTH, (0.2, 0.8, 0.01), (0.15, 0.85, 0.01)),
        np.array(list(product((TRIAL,), (0.35, 0.5, 0.65), (0.3, 0.6)))),
        write,
        everywhere,
        lambda x: units.force * float(x[0]),
        _unit(units),
        remains=KNOWN_SHAPE,
    )


def _constant(units: Units, name: str, template: Template) -> Iterator[Hypothesis]:
    """A constant in one channel, all over the range or on a part of it."""
    channel, sign = next(
        (c, np.sign(curve.y[0]))
        for c in ("conservative", "friction", "damping")
        if (curve := getattr(template.channels, c)) is not None
    )
    unit = sign * units.force / (units.speed if channel == "damping" else 1.0)
    for place in ("whole", "anywhere"):
        bounds, tries = _places(place)
        soft = [] if place == "whole" else [EDGE]

        def write(profile: Profile, x: Array, place: str = place) -> Profile:
            y, interval = float(unit * x[0]), _ends(place, x)
            if place == "whole":
                part = Component(label=name, interval=interval, x=(0, 1), y=(y, y))
            else:
                edge = float(x[1])
                first, last = (0.0 if at in (0.0, 1.0) else y for at in interval)
                part = Component(
                    label=name,
                    interval=interval,
                    x=(0, edge, 1 - edge, 1),
                    y=(y - first, y, y, y - last),
                )
            return with_component(profile, channel, part)

        yield Hypothesis(
            name,
            "both",
            _unknowns(STRENGTH, *soft, *bounds),
            np.array([(TRIAL, *[EDGE[0]] * len(soft), *t) for t in tries]),
            write,
            lambda x, place=place: _ends(place, x),
            lambda x: abs(float(unit)) * float(x[0]),
            _unit(units, int(channel == "damping")),
            len(bounds),
            RARE if place == "whole" and channel == "conservative" and not units.hinge else 0.0,
        )


# --- free curves
def _curves(units: Units) -> Iterator[Hypothesis]:
    for effect, channel in (
        ("position_dependent_friction", "friction"),
        ("position_dependent_damping", "damping"),
    ):
        unit = units.force / (units.speed if channel == "damping" else 1.0)
        at = tuple(np.linspace(0, 1, KNOTS))

        def write(profile: Profile, x: Array, effect=effect, channel=channel, unit=unit) -> Profile:
            part = Component(label=effect, interval=(0, 1), x=at, y=tuple(unit * x))
            return with_component(profile, channel, part)

        yield Hypothesis(
            effect,
            "both",
            _unknowns(*[STRENGTH] * KNOTS),
            np.full((1, KNOTS), 0.5 * TRIAL),
            write,
            everywhere,
            lambda x, unit=unit: float(unit) * float(np.ptp(x)),
            _unit(units, int(channel == "damping")),
        )


# --- effects
def _effects(units: Units) -> Iterator[Hypothesis]:
    yield from _resistances(units)
    if units.friction:
        yield _presliding(units)
    yield from _mechanics(units)


def _effect(
    name: str,
    bounds: Bounds,
    trials: Sequence[Sequence[float]],
    make: Callable[[Array], Effect],
    magnitude: Callable[[Array], float],
    unit: str,
    direction: Direction = "both",
    remains: float = KNOWN_LAW,
) -> Hypothesis:
    """One of the effects beyond the channels."""
    return Hypothesis(
        name,
        direction,
        _unknowns(*bounds),
        np.array(trials, float),
        lambda profile, x: with_effect(profile, make(x)),
        everywhere,
        magnitude,
        unit,
        remains=remains,
    )


def _resistances(units: Units) -> Iterator[Hypothesis]:
    """Effects of friction and damping."""
    F, V = units.force, units.speed

    def flat(value: float) -> tuple[float, float]:
        return value, value

    for way in ("positive", "negative"):
        yield _effect(
            "asymmetric_friction",
            [STRENGTH],
            [[TRIAL]],
            lambda x, way=way: AsymmetricFriction(direction=way, y=flat(F * x[0])),
            lambda x: F * float(x[0]),
            _unit(units),
            way,
        )
        yield _effect(
            "direction_dependent_damping",
            [STRENGTH],
            [[TRIAL]],
            lambda x, way=way: DirectionDependentDamping(direction=way, y=flat(F / V * x[0])),
            lambda x: F / V * float(x[0]),
            _unit(units, 1),
            way,
        )
    yield _effect(
        "quadratic_damping",
        [STRENGTH],
        [[TRIAL]],
        lambda x: QuadraticDamping(y=flat(F / V**2 * x[0])),
        lambda x: F / V**2 * float(x[0]),
        _unit(units, 2),
    )
    yield _effect(
        "stribeck_friction",
        [STRENGTH, (np.log(1e-3), np.log(3.0), 0.05)],
        [(TRIAL, np.log(v)) for v in (0.02, 0.06, 0.2, 0.6)],
        lambda x: StribeckFriction(y=flat(F * x[0]), velocity=V * float(np.exp(x[1]))),
        lambda x: F * float(x[0]),
        _unit(units),
        remains=KNOWN_SHAPE,
    )
    if units.forced or units.weight:
        yield _effect(
            "load_dependent_friction",
            [(0.0, 0.7, 0.002)],
            [[0.05]],
            lambda x: LoadDependentFriction(coefficient=float(x[0])),
            lambda x: float(x[0]),
            "1",
        )


def _presliding(units: Units) -> Hypothesis:
    """Bristles by how far they give way, and how they are damped."""
    soft = units.friction / units.span

    def make(x: Array) -> PreslidingFriction:
        stiffness = soft * float(np.exp(x[0]))
        damping = float(x[1]) * (stiffness * units.inertia) ** 0.5
        return PreslidingFriction(stiffness=stiffness, damping=damping, breakaway=0.0)

    return _effect(
        "presliding_friction",
        [(np.log(20.0), np.log(5e3), 0.05), (0.0, 1.5, 0.02)],
        [(np.log(1 / part), 0.0) for part in (0.001, 0.003, 0.01, 0.03)],
        make,
        lambda x: soft * float(np.exp(x[0])),
        "N·m/rad" if units.hinge else "N/m",
    )


def _mechanics(units: Units) -> Iterator[Hypothesis]:
    """Effects of masses, tilt, play and end stops."""
    F, M, span = units.force, units.inertia, units.span
    yield _effect(
        "added_inertia",
        [(1e-4, 5.0, 0.002)],
        [[0.1]],
        lambda x: AddedInertia(inertia=M * float(x[0])),
        lambda x: M * float(x[0]),
        "kg·m²" if units.hinge else "kg",
    )
    if units.hinge:
        yield _effect(
            "gravity_offset",
            [(-20.0, 20.0, 0.005)] * 2,
            [(TRIAL, 0.0), (0.0, TRIAL)],
            lambda x: GravityOffset(sin=F * float(x[0]) or TINY, cos=F * float(x[1])),
            lambda x: F * float(np.hypot(*x)),
            "N·m",
        )
    else:
        yield _effect(
            "gravity_offset",
            [(-20.0, 20.0, 0.005)],
            [[TRIAL]],
            lambda x: GravityOffset(force=F * float(x[0]) or TINY),
            lambda x: F * abs(float(x[0])),
            "N",
        )
    if units.forced:
        yield _effect(
            "backlash",
            [(3e-3, 0.2, 0.002), (np.log(3e-3), np.log(1.0), 0.05)],
            list(product((0.01, 0.03), np.log((0.03, 0.15)))),
            lambda x: Backlash(play=span * float(x[0]), inertia=M * float(np.exp(x[1]))),
            lambda x: span * float(x[0]),
            "rad" if units.hinge else "m",
        )
    yield _effect(
        "end_stop_restitution",
        [(0.35, 0.95, 0.02)],
        [[0.45], [0.7]],
        lambda x: EndStopRestitution(restitution=float(x[0])),
        lambda x: float(x[0]),
        "1",
    )
