"""Effects that a diagnosis knows by name, in a form that a family chooses."""

from collections.abc import Callable

import numpy as np

from joda.hidden import laws, masses, rubbing, stops, truth
from joda.hidden.die import Builder, Die, Hidden, everywhere
from joda.hidden.laws import Force, Friction, Shape
from joda.hidden.shapes import Well, extent, peak
from joda.hidden.truth import Presliding, Rebound

ShapeOf = Callable[[Die], Shape]
EDGE = 0.02
"""Part of the range that a stop is said to lie in."""


def _placed(shape: Shape) -> tuple[float, float]:
    """Where it acts; the whole range if it leaves out next to nothing."""
    a, b = extent(shape)
    return (0.0, 1.0) if b - a > 1 - EDGE else (a, b)


def force(shape_of: ShapeOf, least: float = 0.25, most: float = 0.8, way: int = 1) -> Builder:
    """A conservative force over position, of a largest size between two natural forces."""

    def build(die: Die) -> Hidden:
        shape, size = shape_of(die), die.force(least, most)
        law = laws.ForceAlong(way * size / peak(shape), shape)
        return Hidden((law,), _placed(shape), size, die.unit())

    return build


def friction(shape_of: ShapeOf, least: float, most: float, one_way: bool = False) -> Builder:
    """Dry friction over position, perhaps in one direction only."""

    def build(die: Die) -> Hidden:
        shape, size, way = shape_of(die), die.force(least, most), die.way() * one_way
        law = rubbing.FrictionAlong(size / peak(shape), shape, way)
        if one_way:
            return everywhere(law, size, die.unit(), way)
        return Hidden((law,), _placed(shape), size, die.unit())

    return build


def damping(shape_of: ShapeOf, one_way: bool = False) -> Builder:
    """Damping over position, perhaps in one direction only."""

    def build(die: Die) -> Hidden:
        shape, size, way = shape_of(die), die.damping(0.2, 0.7), die.way() * one_way
        law = laws.ViscousAlong(size / peak(shape), shape, way)
        if one_way:
            return everywhere(law, size, die.unit("s"), way)
        return Hidden((law,), _placed(shape), size, die.unit("s"))

    return build


def barrier(lobe: Callable[[laws.Array], laws.Array], ratios: tuple[float, float]) -> ShapeOf:
    """A pull towards an end over the distance x from it, and beyond its dead centre away."""

    def shape(die: Die) -> Shape:
        top = die.between(0.06, 0.15)
        return Well(lobe, top, top * die.between(1.2, 1.9), die.between(*ratios))

    return shape


def stribeck(law: Callable[[Die, float, float], Friction]) -> Builder:
    """Friction that falls with velocity: of a size, gone above a velocity."""

    def build(die: Die) -> Hidden:
        size, slow = die.force(0.12, 0.4), die.between(0.03, 0.2)
        made = law(die, size, slow * die.joint.span / die.joint.time)
        return everywhere(made, size, die.unit())

    return build


def presliding(
    law: Callable[[Die, float, float], Presliding], lasts: tuple[float, float]
) -> Builder:
    """Of the base's friction; its stiffness makes it slip after such a part of the range."""

    def build(die: Die) -> Hidden:
        size = die.bare.friction
        stiffness = size / (die.size(*lasts) * die.joint.span)
        return everywhere(law(die, size, stiffness), stiffness, die.unit("1"))

    return build


def loaded(law: Callable[[Die, float], Friction]) -> Builder:
    """Friction with load; of a coefficient."""

    def build(die: Die) -> Hidden:
        coefficient = die.size(0.12, 0.5)
        return everywhere(law(die, coefficient), coefficient, "1")

    return build


def quadratic(law: Callable[[Die, float], Force]) -> Builder:
    """Drag of a size."""

    def build(die: Die) -> Hidden:
        size = die.damping(0.2, 0.7) * die.joint.time / die.joint.span
        return everywhere(law(die, size), size, die.unit("s²"))

    return build


def inertia(law: Callable[[Die, float], laws.Law]) -> Builder:
    """A part more of inertia."""

    def build(die: Die) -> Hidden:
        size = die.size(0.25, 0.8) * die.joint.inertia
        return everywhere(law(die, size), size, "kg·m²" if die.joint.kind == "hinge" else "kg")

    return build


def rigid(die: Die, size: float) -> laws.Law:
    """Mass that is fixed to the joint."""
    return truth.Inertia(size)


def linked(die: Die, size: float) -> laws.Law:
    """Mass that moves along by a linkage."""
    return masses.Linkage(size, die.way() * die.between(0.1, 0.25), die.joint.span)


def attached(die: Die, size: float) -> laws.Law:
    """Mass on a stiff mount."""
    frequency = die.between(60, 100) / die.joint.time
    return masses.Attached(size, size * frequency**2, 2 * 0.2 * size * frequency)


def weight(turned: Callable[[Die], float]) -> Builder:
    """A weight more, its angle (rad) from where gravity has its cosine."""

    def build(die: Die) -> Hidden:
        size, angle = die.force(0.15, 0.5), turned(die)
        if die.joint.kind == "slide":
            law = laws.Tilt(0.0, 0.0, size * (1.0 if np.cos(angle) > 0 else -1.0))
        else:
            law = laws.Tilt(size * float(np.sin(angle)), size * float(np.cos(angle)), 0.0)
        return everywhere(law, size, die.unit())

    return build


def handle(widths: tuple[float, float], shares: tuple[float, float]) -> Builder:
    """Backlash between a handle, which is pushed, and the joint, which is measured."""

    def build(die: Die) -> Hidden:
        width = die.size(*widths) * die.joint.span
        law = truth.Play(width, die.between(*shares) * die.joint.inertia)
        return everywhere(law, width, _length(die))

    return build


def behind(
    widths: tuple[float, float], shares: tuple[float, float], frequencies: tuple[float, float]
) -> Builder:
    """Backlash behind what is pushed and measured: most of the friction and inertia lie there.

    Args:
        widths: of the play, of the range.
        shares: of the inertia.
        frequencies: on a flank, rad per natural time.
    """

    def build(die: Die) -> Hidden:
        bare, width, share = die.bare, die.size(*widths) * die.joint.span, die.between(*shares)
        part = share * die.joint.inertia
        reduced = part * (1 - share)
        frequency = die.between(*frequencies) / die.joint.time
        dry, viscous = die.between(0.7, 0.95), die.between(0.6, 0.95)
        law = masses.Behind(
            width,
            part,
            dry * bare.friction,
            viscous * bare.damping,
            reduced * frequency**2,
            2 * die.between(0.3, 0.8) * reduced * frequency,
        )
        return everywhere(law, width, _length(die))

    return build


def rebound(soft: bool, both: float) -> Builder:
    """Stops that throw back: buffers or pads, at both ends with this probability, else at one."""

    def build(die: Die) -> Hidden:
        coefficient, joint = die.size(0.4, 0.8), die.joint
        assert die.bare.stops
        ends = (False, True) if die.rng.random() < both else (die.chance(),)
        laws = []
        for high in ends:
            frequency = float(np.sqrt(die.bare.stops[high].stiffness / joint.inertia))
            if soft:
                ratio = stops.damping_ratio(coefficient)
                stop: stops.Stop = stops.buffer(joint.inertia, frequency, ratio)
            else:
                speed = joint.span / joint.time
                stop = stops.pad(joint.inertia, frequency, speed, coefficient)
            laws.append(Rebound(high, stop))
        place = (0.0, 1.0) if len(ends) > 1 else ((1 - EDGE, 1.0) if ends[0] else (0.0, EDGE))
        return Hidden(tuple(laws), place, coefficient, "1")

    return build


def _length(die: Die) -> str:
    return "rad" if die.joint.kind == "hinge" else "m"
