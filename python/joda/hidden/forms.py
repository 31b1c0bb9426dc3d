"""Effects that a diagnosis knows by name, in a form that a family chooses."""

from collections.abc import Callable

import numpy as np

from joda.hidden import friction_laws, laws, masses, stops, truth
from joda.hidden.laws import Force, Friction, Shape
from joda.hidden.sampler import Builder, Hidden, Sampler, everywhere
from joda.hidden.shapes import Well, extent, peak
from joda.hidden.truth import Presliding, Rebound

ShapeOf = Callable[[Sampler], Shape]
EDGE = 0.02
"""Part of the range that a stop is said to lie in."""


def _placed(shape: Shape) -> tuple[float, float]:
    """Where it acts; the whole range if it leaves out next to nothing."""
    a, b = extent(shape)
    return (0.0, 1.0) if b - a > 1 - EDGE else (a, b)


def force(shape_of: ShapeOf, least: float = 0.25, most: float = 0.8, way: int = 1) -> Builder:
    """A conservative force over position, of a largest size between two natural forces."""

    def build(sampler: Sampler) -> Hidden:
        shape, size = shape_of(sampler), sampler.force(least, most)
        law = laws.ForceAlong(way * size / peak(shape), shape)
        return Hidden((law,), _placed(shape), size, sampler.unit())

    return build


def friction(shape_of: ShapeOf, least: float, most: float, one_way: bool = False) -> Builder:
    """Dry friction over position, perhaps in one direction only."""

    def build(sampler: Sampler) -> Hidden:
        shape, size, way = shape_of(sampler), sampler.force(least, most), sampler.way() * one_way
        law = friction_laws.PositionFriction(size / peak(shape), shape, way)
        if one_way:
            return everywhere(law, size, sampler.unit(), way)
        return Hidden((law,), _placed(shape), size, sampler.unit())

    return build


def damping(shape_of: ShapeOf, one_way: bool = False) -> Builder:
    """Damping over position, perhaps in one direction only."""

    def build(sampler: Sampler) -> Hidden:
        shape, size, way = shape_of(sampler), sampler.damping(0.2, 0.7), sampler.way() * one_way
        law = laws.ViscousAlong(size / peak(shape), shape, way)
        if one_way:
            return everywhere(law, size, sampler.unit("s"), way)
        return Hidden((law,), _placed(shape), size, sampler.unit("s"))

    return build


def barrier(lobe: Callable[[laws.Array], laws.Array], ratios: tuple[float, float]) -> ShapeOf:
    """A pull towards an end over the distance x from it, and beyond its dead centre away."""

    def shape(sampler: Sampler) -> Shape:
        top = sampler.between(0.06, 0.15)
        return Well(lobe, top, top * sampler.between(1.2, 1.9), sampler.between(*ratios))

    return shape


def stribeck(law: Callable[[Sampler, float, float], Friction]) -> Builder:
    """Friction that falls with velocity: of a size, gone above a velocity."""

    def build(sampler: Sampler) -> Hidden:
        size, slow = sampler.force(0.12, 0.4), sampler.between(0.03, 0.2)
        made = law(sampler, size, slow * sampler.joint.span / sampler.joint.time)
        return everywhere(made, size, sampler.unit())

    return build


def presliding(
    law: Callable[[Sampler, float, float], Presliding], lasts: tuple[float, float]
) -> Builder:
    """Of the base's friction; its stiffness makes it slip after such a part of the range."""

    def build(sampler: Sampler) -> Hidden:
        size = sampler.bare.friction
        stiffness = size / (sampler.size(*lasts) * sampler.joint.span)
        return everywhere(law(sampler, size, stiffness), stiffness, sampler.unit("1"))

    return build


def loaded(law: Callable[[Sampler, float], Friction]) -> Builder:
    """Friction with load; of a coefficient."""

    def build(sampler: Sampler) -> Hidden:
        coefficient = sampler.size(0.12, 0.5)
        return everywhere(law(sampler, coefficient), coefficient, "1")

    return build


def quadratic(law: Callable[[Sampler, float], Force]) -> Builder:
    """Drag of a size."""

    def build(sampler: Sampler) -> Hidden:
        size = sampler.damping(0.2, 0.7) * sampler.joint.time / sampler.joint.span
        return everywhere(law(sampler, size), size, sampler.unit("s²"))

    return build


def inertia(law: Callable[[Sampler, float], laws.Law]) -> Builder:
    """A part more of inertia."""

    def build(sampler: Sampler) -> Hidden:
        size = sampler.size(0.25, 0.8) * sampler.joint.inertia
        return everywhere(
            law(sampler, size), size, "kg·m²" if sampler.joint.kind == "hinge" else "kg"
        )

    return build


def rigid(sampler: Sampler, size: float) -> laws.Law:
    """Mass that is fixed to the joint."""
    return truth.Inertia(size)


def linked(sampler: Sampler, size: float) -> laws.Law:
    """Mass that moves along by a linkage."""
    return masses.Linkage(size, sampler.way() * sampler.between(0.1, 0.25), sampler.joint.span)


def attached(sampler: Sampler, size: float) -> laws.Law:
    """Mass on a stiff mount."""
    frequency = sampler.between(60, 100) / sampler.joint.time
    return masses.Attached(size, size * frequency**2, 2 * 0.2 * size * frequency)


def weight(turned: Callable[[Sampler], float]) -> Builder:
    """A weight more, its angle (rad) from where gravity has its cosine."""

    def build(sampler: Sampler) -> Hidden:
        size, angle = sampler.force(0.15, 0.5), turned(sampler)
        if sampler.joint.kind == "slide":
            law = laws.Tilt(0.0, 0.0, size * (1.0 if np.cos(angle) > 0 else -1.0))
        else:
            law = laws.Tilt(size * float(np.sin(angle)), size * float(np.cos(angle)), 0.0)
        return everywhere(law, size, sampler.unit())

    return build


def handle(widths: tuple[float, float], shares: tuple[float, float]) -> Builder:
    """Backlash between a handle, which is pushed, and the joint, which is measured."""

    def build(sampler: Sampler) -> Hidden:
        width = sampler.size(*widths) * sampler.joint.span
        law = truth.Play(width, sampler.between(*shares) * sampler.joint.inertia)
        return everywhere(law, width, _length(sampler))

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

    def build(sampler: Sampler) -> Hidden:
        bare, width, share = (
            sampler.bare,
            sampler.size(*widths) * sampler.joint.span,
            sampler.between(*shares),
        )
        part = share * sampler.joint.inertia
        reduced = part * (1 - share)
        frequency = sampler.between(*frequencies) / sampler.joint.time
        dry, viscous = sampler.between(0.7, 0.95), sampler.between(0.6, 0.95)
        law = masses.Behind(
            width,
            part,
            dry * bare.friction,
            viscous * bare.damping,
            reduced * frequency**2,
            2 * sampler.between(0.3, 0.8) * reduced * frequency,
        )
        return everywhere(law, width, _length(sampler))

    return build


def rebound(soft: bool, both: float) -> Builder:
    """Stops that throw back: buffers or pads, at both ends with this probability, else at one."""

    def build(sampler: Sampler) -> Hidden:
        coefficient, joint = sampler.size(0.4, 0.8), sampler.joint
        assert sampler.bare.stops
        ends = (False, True) if sampler.rng.random() < both else (sampler.chance(),)
        laws = []
        for high in ends:
            frequency = float(np.sqrt(sampler.bare.stops[high].stiffness / joint.inertia))
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


def _length(sampler: Sampler) -> str:
    return "rad" if sampler.joint.kind == "hinge" else "m"
