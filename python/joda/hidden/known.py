"""Effects that a diagnosis knows by name: the templates, and those beyond them."""

import numpy as np

from joda.hidden import laws, rubbing, truth
from joda.hidden.die import Builder, Die, Hidden, everywhere
from joda.hidden.laws import Law


def _whole(die: Die, native: float) -> tuple[float, float, float]:
    """Interval and edge: the whole range in half of the draws, if the base has nothing like it."""
    if native == 0 and die.chance():
        return -1.0, 2.0, 0.0
    return *die.stretch(0.2, 0.6), die.edge()


def _clip(a: float, b: float) -> tuple[float, float]:
    return max(a, 0.0), min(b, 1.0)


def _catch(die: Die, force: float, interval: tuple[float, float]) -> tuple[Law, ...]:
    """Friction in the interval of a latch, in half of the draws."""
    if die.chance():
        return ()
    return (rubbing.Rub(force * die.between(0.05, 0.2), *interval, 0.01),)


def _constant_friction(die: Die) -> Hidden:
    force, (a, b, edge) = die.force(0.15, 0.6), _whole(die, die.bare.friction)
    return Hidden((rubbing.Rub(force, a, b, edge),), _clip(a, b), force, die.unit())


def _constant_damping(die: Die) -> Hidden:
    size, (a, b, edge) = die.damping(), _whole(die, die.bare.damping)
    return Hidden((laws.Viscous(size, a, b, edge),), _clip(a, b), size, die.unit("s"))


def _constant_force(way: int) -> Builder:
    def build(die: Die) -> Hidden:
        force, (a, b, edge) = die.force(), _whole(die, 0.0)
        return Hidden((laws.Constant(way * force, a, b, edge),), _clip(a, b), force, die.unit())

    return build


def _detent(die: Die) -> Hidden:
    a, b = die.stretch(0.08, 0.3)
    force = die.force()
    well = laws.Wells(force, (0.5 * (a + b),), (b - a) / 5)
    return Hidden((well, *_catch(die, force, (a, b))), (a, b), force, die.unit())


def _bistable(die: Die) -> Hidden:
    force = die.force(0.2)
    law = laws.OverCentre(force, die.between(0.4, 0.6), die.between(0.1, 0.4))
    return Hidden((law,), (0.0, 1.0), force, die.unit())


def _bistable_internal(die: Die) -> Hidden:
    a, b = die.stretch(0.25, 0.5)
    force = die.force()
    wells = laws.Wells(force, (a + 0.25 * (b - a), a + 0.75 * (b - a)), (b - a) / 9)
    return Hidden((wells, *_catch(die, force, (a, b))), (a, b), force, die.unit())


def _magnet(high: bool) -> Builder:
    def build(die: Die) -> Hidden:
        force, gap = die.force(0.3), die.between(0.03, 0.09)
        # the force has fallen to 5 % there
        end = gap * (0.05**-0.5 - 1)
        interval = (1 - end, 1.0) if high else (0.0, end)
        law = laws.Magnet(force, high, gap)
        return Hidden((law, *_catch(die, force, interval)), interval, force, die.unit())

    return build


def _spring(high: bool) -> Builder:
    def build(die: Die) -> Hidden:
        force, reach = die.force(0.2), 2.0 if die.chance() else die.between(0.3, 0.6)
        preload = force * die.between(0.1, 0.5)
        law = laws.Spring(preload, (force - preload) / min(reach, 1.0), high, reach)
        end = min(reach, 1.0)
        return Hidden((law,), (1 - end, 1.0) if high else (0.0, end), force, die.unit())

    return build


def _snap(high: bool) -> Builder:
    def build(die: Die) -> Hidden:
        force, top = die.force(0.2), die.between(0.06, 0.14)
        width = top / die.between(1.6, 2.2)
        end = top + 2.5 * width
        interval = (1 - end, 1.0) if high else (0.0, end)
        barrier = laws.Wells(-force, (1 - top if high else top,), width)
        return Hidden((barrier, *_catch(die, force, interval)), interval, force, die.unit())

    return build


def _along(die: Die) -> tuple[laws.Along, tuple[float, float]]:
    """A course over position, and where it is."""
    shape = die.rng.choice(["bump", "wave", "ramp"])
    if shape == "bump":
        at, width = die.between(0.2, 0.8), die.between(0.06, 0.15)
        return laws.Along("bump", at, width), _clip(at - 2 * width, at + 2 * width)
    if shape == "wave":
        return laws.Along("wave", die.between(0, 1), die.between(0.4, 1.0)), (0.0, 1.0)
    at, width = die.between(0.0, 0.3), die.between(0.5, 0.7)
    if die.chance():
        return laws.Along("ramp", at, width), (at, 1.0)
    return laws.Along("ramp", 1 - at, -width), (0.0, 1 - at)


def _friction_along(die: Die) -> Hidden:
    (course, interval), force = _along(die), die.force(0.2, 0.7)
    return Hidden((rubbing.FrictionAlong(force, course),), interval, force, die.unit())


def _damping_along(die: Die) -> Hidden:
    (course, interval), size = _along(die), die.damping(0.2, 0.7)
    return Hidden((laws.ViscousAlong(size, course),), interval, size, die.unit("s"))


def _stribeck(die: Die) -> Hidden:
    force, joint = die.force(0.1, 0.35), die.joint
    slow = die.between(0.03, 0.2) * joint.span / joint.time
    return everywhere(rubbing.Stribeck(force, slow), force, die.unit())


def _asymmetric(die: Die) -> Hidden:
    force, way = die.force(0.15, 0.5), die.way()
    return everywhere(rubbing.Rub(force, -1.0, 2.0, 0.0, way), force, die.unit(), way)


def _one_way_damping(die: Die) -> Hidden:
    size, way = die.damping(), die.way()
    return everywhere(laws.Viscous(size, -1.0, 2.0, 0.0, way), size, die.unit("s"), way)


def _quadratic(die: Die) -> Hidden:
    size = die.damping() * die.joint.time / die.joint.span
    return everywhere(laws.Drag(size), size, die.unit("s²"))


def _presliding(die: Die) -> Hidden:
    joint, friction = die.joint, die.bare.friction
    stiffness = friction / (die.size(0.002, 0.015) * joint.span)
    damping = die.between(0.1, 0.6) * np.sqrt(stiffness * joint.inertia) if die.chance() else 0.0
    return everywhere(truth.Bristle(friction, stiffness, float(damping)), stiffness, die.unit("1"))


def _loaded(die: Die) -> Hidden:
    coefficient = die.size(0.12, 0.5)
    return everywhere(rubbing.Loaded(coefficient), coefficient, "1")


def _inertia(die: Die) -> Hidden:
    size = die.size(0.2, 0.8) * die.joint.inertia
    return everywhere(truth.Inertia(size), size, "kg·m²" if die.joint.kind == "hinge" else "kg")


def _gravity(die: Die) -> Hidden:
    force, angle = die.force(0.15, 0.5), die.between(0, 2 * np.pi)
    if die.joint.kind == "slide":
        return everywhere(laws.Tilt(0.0, 0.0, die.way() * force), force, die.unit())
    tilt = laws.Tilt(force * np.sin(angle), force * np.cos(angle), 0.0)
    return everywhere(tilt, force, die.unit())


def _backlash(die: Die) -> Hidden:
    width = die.size(0.01, 0.04) * die.joint.span
    handle = truth.Play(width, die.between(0.05, 0.2) * die.joint.inertia)
    return everywhere(handle, width, "rad" if die.joint.kind == "hinge" else "m")


def _bounce(die: Die) -> Hidden:
    restitution = die.size(0.4, 0.8)
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
