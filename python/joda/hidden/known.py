"""Effects that a diagnosis knows by name: the templates, and those beyond them."""

import numpy as np

from joda.hidden import friction_laws, laws, truth
from joda.hidden.laws import Law
from joda.hidden.sampler import Builder, Hidden, Sampler, everywhere


def _whole(sampler: Sampler, native: float) -> tuple[float, float, float]:
    """Interval and edge: the whole range in half of the draws, if the base has nothing like it."""
    if native == 0 and sampler.chance():
        return -1.0, 2.0, 0.0
    return *sampler.stretch(0.2, 0.6), sampler.edge()


def _clip(a: float, b: float) -> tuple[float, float]:
    return max(a, 0.0), min(b, 1.0)


def _catch(sampler: Sampler, force: float, interval: tuple[float, float]) -> tuple[Law, ...]:
    """Friction in the interval of a latch, in half of the draws."""
    if sampler.chance():
        return ()
    return (friction_laws.IntervalFriction(force * sampler.between(0.05, 0.2), *interval, 0.01),)


def _constant_friction(sampler: Sampler) -> Hidden:
    force, (a, b, edge) = sampler.force(0.15, 0.6), _whole(sampler, sampler.bare.friction)
    return Hidden(
        (friction_laws.IntervalFriction(force, a, b, edge),), _clip(a, b), force, sampler.unit()
    )


def _constant_damping(sampler: Sampler) -> Hidden:
    size, (a, b, edge) = sampler.damping(), _whole(sampler, sampler.bare.damping)
    return Hidden((laws.Viscous(size, a, b, edge),), _clip(a, b), size, sampler.unit("s"))


def _constant_force(way: int) -> Builder:
    def build(sampler: Sampler) -> Hidden:
        force, (a, b, edge) = sampler.force(), _whole(sampler, 0.0)
        return Hidden((laws.Constant(way * force, a, b, edge),), _clip(a, b), force, sampler.unit())

    return build


def _detent(sampler: Sampler) -> Hidden:
    a, b = sampler.stretch(0.08, 0.3)
    force = sampler.force()
    well = laws.Wells(force, (0.5 * (a + b),), (b - a) / 5)
    return Hidden((well, *_catch(sampler, force, (a, b))), (a, b), force, sampler.unit())


def _bistable(sampler: Sampler) -> Hidden:
    force = sampler.force(0.2)
    law = laws.OverCentre(force, sampler.between(0.4, 0.6), sampler.between(0.1, 0.4))
    return Hidden((law,), (0.0, 1.0), force, sampler.unit())


def _bistable_internal(sampler: Sampler) -> Hidden:
    a, b = sampler.stretch(0.25, 0.5)
    force = sampler.force()
    wells = laws.Wells(force, (a + 0.25 * (b - a), a + 0.75 * (b - a)), (b - a) / 9)
    return Hidden((wells, *_catch(sampler, force, (a, b))), (a, b), force, sampler.unit())


def _magnet(high: bool) -> Builder:
    def build(sampler: Sampler) -> Hidden:
        force, gap = sampler.force(0.3), sampler.between(0.03, 0.09)
        # the force has fallen to 5 % there
        end = gap * (0.05**-0.5 - 1)
        interval = (1 - end, 1.0) if high else (0.0, end)
        law = laws.Magnet(force, high, gap)
        return Hidden((law, *_catch(sampler, force, interval)), interval, force, sampler.unit())

    return build


def _spring(high: bool) -> Builder:
    def build(sampler: Sampler) -> Hidden:
        force, reach = sampler.force(0.2), 2.0 if sampler.chance() else sampler.between(0.3, 0.6)
        preload = force * sampler.between(0.1, 0.5)
        law = laws.Spring(preload, (force - preload) / min(reach, 1.0), high, reach)
        end = min(reach, 1.0)
        return Hidden((law,), (1 - end, 1.0) if high else (0.0, end), force, sampler.unit())

    return build


def _snap(high: bool) -> Builder:
    def build(sampler: Sampler) -> Hidden:
        force, top = sampler.force(0.2), sampler.between(0.06, 0.14)
        width = top / sampler.between(1.6, 2.2)
        end = top + 2.5 * width
        interval = (1 - end, 1.0) if high else (0.0, end)
        barrier = laws.Wells(-force, (1 - top if high else top,), width)
        return Hidden((barrier, *_catch(sampler, force, interval)), interval, force, sampler.unit())

    return build


def _along(sampler: Sampler) -> tuple[laws.Along, tuple[float, float]]:
    """A course over position, and where it is."""
    shape = sampler.rng.choice(["bump", "wave", "ramp"])
    if shape == "bump":
        at, width = sampler.between(0.2, 0.8), sampler.between(0.06, 0.15)
        return laws.Along("bump", at, width), _clip(at - 2 * width, at + 2 * width)
    if shape == "wave":
        return laws.Along("wave", sampler.between(0, 1), sampler.between(0.4, 1.0)), (0.0, 1.0)
    at, width = sampler.between(0.0, 0.3), sampler.between(0.5, 0.7)
    if sampler.chance():
        return laws.Along("ramp", at, width), (at, 1.0)
    return laws.Along("ramp", 1 - at, -width), (0.0, 1 - at)


def _friction_along(sampler: Sampler) -> Hidden:
    (course, interval), force = _along(sampler), sampler.force(0.2, 0.7)
    return Hidden((friction_laws.PositionFriction(force, course),), interval, force, sampler.unit())


def _damping_along(sampler: Sampler) -> Hidden:
    (course, interval), size = _along(sampler), sampler.damping(0.2, 0.7)
    return Hidden((laws.ViscousAlong(size, course),), interval, size, sampler.unit("s"))


def _stribeck(sampler: Sampler) -> Hidden:
    force, joint = sampler.force(0.1, 0.35), sampler.joint
    slow = sampler.between(0.03, 0.2) * joint.span / joint.time
    return everywhere(friction_laws.Stribeck(force, slow), force, sampler.unit())


def _asymmetric(sampler: Sampler) -> Hidden:
    force, way = sampler.force(0.15, 0.5), sampler.way()
    return everywhere(
        friction_laws.IntervalFriction(force, -1.0, 2.0, 0.0, way), force, sampler.unit(), way
    )


def _one_way_damping(sampler: Sampler) -> Hidden:
    size, way = sampler.damping(), sampler.way()
    return everywhere(laws.Viscous(size, -1.0, 2.0, 0.0, way), size, sampler.unit("s"), way)


def _quadratic(sampler: Sampler) -> Hidden:
    size = sampler.damping() * sampler.joint.time / sampler.joint.span
    return everywhere(laws.Drag(size), size, sampler.unit("s²"))


def _presliding(sampler: Sampler) -> Hidden:
    joint, friction = sampler.joint, sampler.bare.friction
    stiffness = friction / (sampler.size(0.002, 0.015) * joint.span)
    damping = (
        sampler.between(0.1, 0.6) * np.sqrt(stiffness * joint.inertia) if sampler.chance() else 0.0
    )
    return everywhere(
        truth.Bristle(friction, stiffness, float(damping)), stiffness, sampler.unit("1")
    )


def _loaded(sampler: Sampler) -> Hidden:
    coefficient = sampler.size(0.12, 0.5)
    return everywhere(friction_laws.LoadFriction(coefficient), coefficient, "1")


def _inertia(sampler: Sampler) -> Hidden:
    size = sampler.size(0.2, 0.8) * sampler.joint.inertia
    return everywhere(truth.Inertia(size), size, "kg·m²" if sampler.joint.kind == "hinge" else "kg")


def _gravity(sampler: Sampler) -> Hidden:
    force, angle = sampler.force(0.15, 0.5), sampler.between(0, 2 * np.pi)
    if sampler.joint.kind == "slide":
        return everywhere(laws.Tilt(0.0, 0.0, sampler.way() * force), force, sampler.unit())
    tilt = laws.Tilt(force * np.sin(angle), force * np.cos(angle), 0.0)
    return everywhere(tilt, force, sampler.unit())


def _backlash(sampler: Sampler) -> Hidden:
    width = sampler.size(0.01, 0.04) * sampler.joint.span
    handle = truth.Play(width, sampler.between(0.05, 0.2) * sampler.joint.inertia)
    return everywhere(handle, width, "rad" if sampler.joint.kind == "hinge" else "m")


def _bounce(sampler: Sampler) -> Hidden:
    restitution = sampler.size(0.4, 0.8)
    return everywhere(truth.Bounce(restitution), restitution, "1")


KNOWN: dict[str, Builder] = {
    "constant_friction_hinge": _constant_friction,
    "constant_damping_hinge": _constant_damping,
    "constant_positive_conservative_hinge": _constant_force(1),
    "constant_negative_conservative_hinge": _constant_force(-1),
    "detent_internal": _detent,
    "bistable_mechanism": _bistable,
    "bistable_mechanism_internal": _bistable_internal,
    "magnetic_return_to_low_end": _magnet(False),
    "magnetic_return_to_high_end": _magnet(True),
    "spring_return_to_low_end": _spring(False),
    "spring_return_to_high_end": _spring(True),
    "spring_loaded_snap_detent_to_low_end": _snap(False),
    "spring_loaded_snap_detent_to_high_end": _snap(True),
    "position_dependent_friction": _friction_along,
    "position_dependent_damping": _damping_along,
    "stribeck_friction": _stribeck,
    "asymmetric_friction": _asymmetric,
    "direction_dependent_damping": _one_way_damping,
    "quadratic_damping": _quadratic,
    "presliding_friction": _presliding,
    "load_dependent_friction": _loaded,
    "added_inertia": _inertia,
    "gravity_offset": _gravity,
    "backlash": _backlash,
    "end_stop_restitution": _bounce,
}
