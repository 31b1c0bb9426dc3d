"""The effects beyond the templates as hypotheses."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, Literal

import numpy as np

from joda.component import Component
from joda.diagnosis.hypotheses.base import (
    FREE_CURVE,
    KNOWN_LAW,
    KNOWN_SHAPE,
    STRENGTH,
    TRIAL,
    Array,
    Bounds,
    Direction,
    Hypothesis,
    Number,
    Units,
    everywhere,
    unit_of,
    unknowns_of,
)
from joda.diagnosis.hypotheses.intervals import GRID, WHOLE, felt
from joda.effects import (
    AddedInertia,
    AnyEffect,
    AsymmetricFriction,
    Backlash,
    DirectionDependentDamping,
    EndStopRestitution,
    GravityOffset,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.effects.mechanics import ENDS, HEAVIEST, End
from joda.estimation.unknowns import Unknowns
from joda.profile import Profile

Way = Literal["positive", "negative"]

KNOTS = 9
"""Control points of a free curve."""
RAISED = 0.1
"""Part of its rise above its least value from which a free curve is told to act."""
VARIED = 0.5
"""How much a curve varies at least that differs along the way, in units of its mean."""
LEVEL = 0.25
"""By how much it is off its median where it is level, in units of that."""
KEPT = 3
"""Rough fits of a load behind a play that are fitted to the end: each impact may be or not."""
JAMMED = 1.0
"""Friction per load that no force moves."""
HEAVY = 300.0
"""Added inertia, in units of the joint's, up to which is looked."""
MOVED = 0.9
"""Part of the largest friction per load, or added inertia, from which no force is felt to move the
joint: something else does."""
BENDS = 2.0
"""How much a free curve bends at a control point (one standard deviation), in usual forces: where
no segment has been, what is beside tells it."""
FACTOR, UNEVEN = (-1.5, 1.5, 0.05), 0.3
"""Logarithms by which a size differs along the way: bounds and step, and by how much it usually
does (one standard deviation)."""
FINER = (KNOTS, 17, 33)
"""Control points of such a size: where it leaves more than noise, more."""
ONE_OF_TWO = 2 * float(np.log(2))
"""How much rarer each direction of an effect is than the effect, see `neg_log_prior`."""
TINY = 1e-12
"""As good as no force."""


def free_curves(units: Units) -> Iterator[Hypothesis]:
    """Friction and damping that differ along the way, level where no run has been."""
    yield _curve(units, "position_dependent_friction", "friction")
    yield _curve(units, "position_dependent_damping", "damping")


def _curve(units: Units, effect: str, channel: str) -> Hypothesis:
    power = int(channel == "damping")
    unit = units.force / units.speed**power
    knots, padded = _knots(units)

    def write(profile: Profile, x: Array) -> Profile:
        y = tuple(unit * padded(x))
        return profile.with_component(
            channel, Component(label=effect, interval=(0, 1), x=knots, y=y)
        )

    def raised(x: Array) -> tuple[float, float]:
        """Where the curve is above its least value."""
        y = tuple(padded(x - np.min(x) + TINY))
        return felt(Component(label=effect, interval=(0, 1), x=knots, y=y), RAISED, to_ends=False)

    def level(x: Array) -> bool:
        """Whether it is the same on so much of the range that it is called constant."""
        y = np.interp(np.linspace(0, 1, GRID), knots, padded(x))
        usual = float(np.median(y))
        near = np.abs(y - usual) <= LEVEL * usual
        return usual > VARIED * float(y.max()) and bool(np.mean(near) >= WHOLE)

    return Hypothesis(
        effect,
        "both",
        replace(unknowns_of(*[STRENGTH] * KNOTS), rough=np.diff(np.eye(KNOTS), 2, axis=0) / BENDS),
        np.full((1, KNOTS), 0.5 * TRIAL),
        write,
        raised,
        lambda x: unit * float(np.ptp(x)),
        unit_of(units, power),
        misfit_tolerance=FREE_CURVE,
        itself=lambda x: bool(np.ptp(x) > VARIED * np.mean(x)) and not level(x),
    )


def _knots(units: Units, count: int = KNOTS) -> tuple[tuple[float, ...], Callable[[Array], Array]]:
    """Control points of a curve that is level where no run has been, and how its values there
    follow from those where runs were."""
    at = np.linspace(*units.visited, count)
    beyond = int(at[0] > 0), int(at[-1] < 1)
    return tuple(map(float, np.unique([0.0, *at, 1.0]))), lambda x: np.pad(x, beyond, mode="edge")


def from_effects(units: Units) -> Iterator[Hypothesis]:
    """The effects beyond the channels that can show in such a joint's motion."""
    yield from _resistances(units)
    if units.friction:
        yield _presliding(units)
    yield from _mechanics(units)


def _effect(
    name: str,
    bounds: Bounds,
    trials: Sequence[Sequence[float]],
    make: Callable[[Array], AnyEffect],
    magnitude: Callable[[Array], float],
    unit: str,
    direction: Direction = "both",
    misfit_tolerance: float = KNOWN_LAW,
    itself: Callable[[Array], bool] = lambda x: True,
) -> Hypothesis:
    """One of the effects beyond the channels."""
    return Hypothesis(
        name,
        direction,
        unknowns_of(*bounds),
        np.array(trials, float),
        lambda profile, x: profile.with_effect(make(x)),
        everywhere,
        magnitude,
        unit,
        misfit_tolerance=misfit_tolerance,
        itself=itself,
    )


def _along(
    units: Units,
    power: int,
    name: str,
    make: Callable[[Array, dict[str, Any]], AnyEffect],
    others: Sequence[tuple[Number, Sequence[float]]] = (),
    direction: Direction = "both",
    misfit_tolerance: float = KNOWN_LAW,
) -> Hypothesis:
    """An effect whose size is a curve over the range: the same everywhere, or uneven.

    Args:
        units: the joint's.
        power: of speed, in its unit.
        name: the effect's.
        make: the effect, of its numbers and its curve.
        others: what is known of its numbers after the size, and values to try.
        direction, misfit_tolerance: see Hypothesis.
    """
    size, unit = units.force / units.speed**power, unit_of(units, power)
    bounds = [STRENGTH, *(number for number, _ in others)]
    flat = _effect(
        name,
        bounds,
        list(product((TRIAL,), *(tries for _, tries in others))),
        lambda x: make(x, {"y": (size * float(x[0]),) * 2}),
        lambda x: size * float(x[0]),
        unit,
        direction,
        misfit_tolerance,
    )
    flat = replace(flat, neg_log_prior=0.0 if direction == "both" else ONE_OF_TWO)

    def uneven(count: int, finer: Hypothesis | None) -> Hypothesis:
        knots, padded = _knots(units, count)

        def curve(x: Array) -> Array:
            return padded(size * x[0] * np.exp(x[-count:]))

        return replace(
            flat,
            unknowns=flat.unknowns.and_(_factors(count)),
            trials=np.zeros((0, len(bounds) + count)),
            write=lambda profile, x: profile.with_effect(
                make(x, {"x": knots, "y": tuple(curve(x))})
            ),
            magnitude=lambda x: float(curve(x).max()),
            misfit_tolerance=max(misfit_tolerance, FREE_CURVE),
            uneven=finer,
            factors=count,
        )

    finer = None
    for count in reversed(FINER):
        finer = uneven(count, finer)
    return replace(flat, uneven=finer)


def _factors(count: int) -> Unknowns:
    """Logarithms of so many factors of a size along the way."""
    low, high, step = (np.full(count, value) for value in FACTOR)
    return Unknowns(low, high, step, np.zeros(count), np.full(count, UNEVEN))


def _resistances(units: Units) -> Iterator[Hypothesis]:
    """Effects of friction and damping."""
    V = units.speed

    def asymmetric(way: Way) -> Hypothesis:
        return _along(
            units,
            0,
            "asymmetric_friction",
            lambda x, curve: AsymmetricFriction(direction=way, **curve),
            direction=way,
        )

    def one_way(way: Way) -> Hypothesis:
        return _along(
            units,
            1,
            "direction_dependent_damping",
            lambda x, curve: DirectionDependentDamping(direction=way, **curve),
            direction=way,
        )

    for build in (asymmetric, one_way):
        yield build("positive")
        yield build("negative")
    yield _along(units, 2, "quadratic_damping", lambda x, curve: QuadraticDamping(**curve))
    speeds = [np.log(v) for v in (0.02, 0.06, 0.2, 0.6)]
    yield _along(
        units,
        0,
        "stribeck_friction",
        lambda x, curve: StribeckFriction(velocity=V * float(np.exp(x[1])), **curve),
        [((np.log(1e-3), np.log(3.0), 0.05, np.nan, np.log(6.0)), speeds)],
        misfit_tolerance=KNOWN_SHAPE,
    )
    if units.forced or units.weight:
        yield _effect(
            "load_dependent_friction",
            [(0.0, 0.7, 0.002, np.nan, JAMMED)],
            [[0.05]],
            lambda x: LoadDependentFriction(coefficient=float(x[0])),
            lambda x: float(x[0]),
            "1",
            misfit_tolerance=KNOWN_SHAPE,  # a contact's grows less than its load, a bearing's later
            itself=lambda x: bool(x[0] < MOVED * JAMMED),
        )


def _presliding(units: Units) -> Hypothesis:
    """Bristles by how far they give way, how they are damped, and when they begin to slide."""
    soft = units.friction / units.span

    def make(x: Array) -> PreslidingFriction:
        stiffness = soft * float(np.exp(x[0]))
        damping = float(x[1]) * (stiffness * units.inertia) ** 0.5
        return PreslidingFriction(stiffness=stiffness, damping=damping, breakaway=float(x[2]))

    return _effect(
        "presliding_friction",
        [
            (np.log(20.0), np.log(5e3), 0.05, np.log(4.0), np.log(5e3)),
            (0.0, 1.5, 0.02),
            (0.0, 0.95, 0.03),
        ],
        [
            (np.log(1 / part), 0.0, begin)
            for part, begin in product((0.001, 0.003, 0.01, 0.03), (0.0, 0.6))
        ],
        make,
        lambda x: soft * float(np.exp(x[0])),
        "N·m/rad" if units.hinge else "N/m",
        misfit_tolerance=KNOWN_SHAPE,
    )


def _mechanics(units: Units) -> Iterator[Hypothesis]:
    """Effects of masses, tilt, play and end stops."""
    F, M = units.force, units.inertia
    yield _effect(
        "added_inertia",
        [(1e-4, 5.0, 0.002, np.nan, HEAVY)],
        [[0.1]],
        lambda x: AddedInertia(inertia=M * float(x[0])),
        lambda x: M * float(x[0]),
        "kg·m²" if units.hinge else "kg",
        itself=lambda x: bool(x[0] < MOVED * HEAVY),
    )
    if units.hinge:
        yield _effect(
            "gravity_offset",
            [(-300.0, 300.0, 0.005)] * 2,
            [(TRIAL, 0.0), (0.0, TRIAL)],
            lambda x: GravityOffset(sin=F * float(x[0]) or TINY, cos=F * float(x[1])),
            lambda x: F * float(np.hypot(*x)),
            "N·m",
        )
    else:
        yield _effect(
            "gravity_offset",
            [(-300.0, 300.0, 0.005)],
            [[TRIAL]],
            lambda x: GravityOffset(force=F * float(x[0]) or TINY),
            lambda x: F * abs(float(x[0])),
            "N",
        )
    yield from _backlash(units)
    for end in ENDS:
        yield _restitution(end)


def _backlash(units: Units) -> Iterator[Hypothesis]:
    """Play before the joint, where something pushes it through that, and behind it; how its contact
    yields and knocks is not known."""
    M, span = units.inertia, units.span
    play = (3e-3, 0.2, 0.002, np.nan, 0.5)

    def size(x: Array) -> float:
        return span * float(x[0])

    def before(x: Array) -> Backlash:
        return Backlash(play=size(x), inertia=M * float(np.exp(x[1])))

    def behind(x: Array) -> Backlash:
        inertia = M * float(np.exp(x[1]))
        return Backlash(play=size(x), inertia=inertia, side="motor", share=float(x[2]))

    unit = "rad" if units.hinge else "m"
    if units.forced:
        yield _effect(
            "backlash",
            [play, (np.log(3e-3), np.log(HEAVIEST["load"]), 0.05)],
            list(product((0.01, 0.03), (np.log(0.03), np.log(0.15)))),
            before,
            size,
            unit,
            misfit_tolerance=KNOWN_SHAPE,
        )
    load = _effect(
        "backlash",
        [
            (3e-3, 0.2, 0.003, np.nan, 0.5),
            (np.log(0.01), np.log(HEAVIEST["motor"]), 0.1),
            (0.0, 0.98, 0.04),
        ],
        list(product((0.015, 0.05), (np.log(0.12), np.log(0.5)), (0.85,))),
        behind,
        size,
        unit,
        misfit_tolerance=KNOWN_SHAPE,
    )
    yield replace(load, kept=KEPT)


def _restitution(end: End) -> Hypothesis:
    """How much of its speed the joint gets back at one end of its range, or at both."""
    return replace(
        _effect(
            "end_stop_restitution",
            [(0.05, 0.95, 0.02)],
            [[0.3], [0.6]],
            lambda x: EndStopRestitution(restitution=float(x[0]), end=end),
            lambda x: float(x[0]),
            "1",
        ),
        interval=lambda x: ENDS[end],
    )
