"""Doors, lids and drawers in people's hands, from 0.2 to 40 kg.

Hands are soft or tremble, shove and let go; stops are soft, hard or bouncing, and recording goes on
while the joint rests there. Measured by cameras and potentiometers, at 50 to 200 Hz. Windowed
sines, powers of a gap, levers; backlash lies behind what is held.
"""

from collections.abc import Sequence

import numpy as np

from joda.hidden import forms, friction_laws, memory, shapes, uncatalogued_forms
from joda.hidden.drag import DragAlong
from joda.hidden.family import Family
from joda.hidden.gestures import Session, perform, press, shove, some, toss, trembling
from joda.hidden.laws import Shape
from joda.hidden.measuring import Encoder, Motions
from joda.hidden.motions import Draw, drop, flick, hand, ramp, release
from joda.hidden.plants import GRAVITY, furnish, pick
from joda.hidden.sampler import Builder, Sampler
from joda.hidden.truth import RESTITUTION_EFFECT, Joint, Truth
from joda.hidden.uncatalogued import UNCATALOGUED as SHARED

WEIGHTY = ("load_dependent_friction",)
TIMED = "periodic_disturbance"


# --- joints
def _truth(rng: np.random.Generator, names: Sequence[str], forced: bool) -> Truth:
    weighty = any(name in WEIGHTY for name in names)
    kind = rng.choice(["lid"] if weighty else ["door", "lid", "drawer"])
    joint = {"door": _door, "lid": _lid, "drawer": _drawer}[kind](rng)
    return furnish(rng, joint, names, (50.0, 150.0))


def _door(rng: np.random.Generator) -> Joint:
    inertia = pick(rng, 2.0, 40.0) * rng.uniform(0.3, 0.9) ** 2 / 3
    span, time = rng.uniform(1.2, 2.6), pick(rng, 0.8, 3.0)
    lo = -span if rng.random() < 0.3 else 0.0
    force = inertia * span / time**2 * rng.uniform(6, 15)
    return Joint("hinge", lo, lo + span, inertia, 0.0, 0.0, time, force)


def _lid(rng: np.random.Generator) -> Joint:
    mass, width = pick(rng, 0.2, 6.0), rng.uniform(0.15, 0.6)
    inertia, torque = mass * width**2 / 3, 0.5 * mass * GRAVITY * width
    span, balanced = rng.uniform(1.0, 2.0), rng.uniform(0.2, 1.0)
    time = float(np.sqrt(2 * span * inertia / torque) * rng.uniform(1.0, 2.0))
    lo = rng.uniform(-0.3, 0.2)
    angle = rng.uniform(-0.3, 0.3)
    cos, sin = -balanced * torque * np.cos(angle), balanced * torque * np.sin(angle)
    force = 0.5 * balanced * torque + inertia * span / time**2 * rng.uniform(4, 10)
    return Joint("hinge", lo, lo + span, inertia, float(cos), float(sin), time, force)


def _drawer(rng: np.random.Generator) -> Joint:
    mass, span, time = pick(rng, 0.5, 20.0), rng.uniform(0.15, 0.6), rng.uniform(0.6, 1.6)
    force = mass * span / time**2 * rng.uniform(6, 15)
    tilt = rng.uniform(-0.3, 0.3) * force if rng.random() < 0.4 else 0.0
    tilt = float(np.clip(tilt, -0.5 * mass * GRAVITY, 0.5 * mass * GRAVITY))
    return Joint("slide", 0.0, span, mass, tilt, 0.0, time, force)


def _encoder(rng: np.random.Generator, joint: Joint) -> Encoder:
    rate, force = max(pick(rng, 50, 200), 40 / joint.time), pick(rng, 5e-4, 5e-3)
    uneven = bool(rng.random() < 0.4)
    if rng.random() < 0.5:
        sigma = joint.span * pick(rng, 5e-4, 1e-2)
        return Encoder(sigma, False, uneven, force, rate=rate)
    step = joint.span / pick(rng, 100, 4000)
    noise = joint.span * pick(rng, 1e-4, 1e-3)
    sigma = float(np.hypot(noise, step / np.sqrt(12)))
    return Encoder(sigma, False, uneven, force, step, rate)


# --- motions
def _move(rng: np.random.Generator, truth: Truth, names: Sequence[str], forced: bool) -> Motions:
    pushed: tuple[Draw, ...] = (
        trembling(hand(1.2, (3.0, 8.0)), 0.3),
        shove((0.4, 1.2)),
        hand(0.7, (15.0, 40.0)),
        trembling(hand(2.5, (8.0, 20.0)), 0.2),
        release,
        ramp,
        press((0.3, 1.0), 2.0),
    )
    left: tuple[Draw, ...] = (flick(0.4), toss(0.8), flick(0.8), drop)
    if RESTITUTION_EFFECT in names:
        pushed, left = (shove((0.3, 0.8)), shove((0.5, 1.0), 4.0), release), (toss(1.5),)
    draws = pushed if forced else left
    session = Session(
        some(rng, draws, 4, 8),
        some(rng, draws, 3, 4),
        (3.0, 20.0) if forced else (2.0, 6.0),
        timed=TIMED in names,
    )
    return perform(rng, truth, session, forced)


# --- laws
def _whole(sampler: Sampler) -> Shape:
    return shapes.Logistic(sampler.between(-0.4, 0.05), sampler.between(0.95, 1.4), 0.01)


def _constant(sampler: Sampler) -> Shape:
    return shapes.Slope()


def _sloping(sampler: Sampler) -> Shape:
    return shapes.Slope(sampler.way() * sampler.between(0.1, 0.5))


def _detent(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.08, 0.35)
    return shapes.Well(shapes.windowed_sine, 0.5 * (a + b), 0.5 * (b - a))


def _two_wells(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.3, 0.6)
    half = 0.25 * (b - a)
    wells = tuple(shapes.Well(shapes.windowed_sine, at, half) for at in (a + half, b - half))
    return shapes.Sum(wells, (1.0, 1.0))


def _dead_centre(sampler: Sampler) -> Shape:
    middle = sampler.between(0.4, 0.6)
    longer = max(middle, 1 - middle)  # it rests at the ends or, at most a little, short of them
    return shapes.Cubic(middle, sampler.between(0.9 * longer, 0.8))


def _to_end(pull: forms.ShapeOf, high: bool) -> forms.ShapeOf:
    return lambda sampler: shapes.ToEnd(pull(sampler), high)


def _magnet(sampler: Sampler) -> Shape:
    power = sampler.between(1.3, 3.5)
    return shapes.Gap(sampler.between(0.02, 0.06) * power, power)


def _lever(sampler: Sampler) -> Shape:
    return shapes.Lever(sampler.between(0.1, 0.6), sampler.between(0.8, 1.6))


def _zone(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.1, 0.2) if sampler.chance() else sampler.stretch(0.3, 0.75)
    return shapes.RaisedCosine(a, b)


_snap = forms.barrier(shapes.windowed_sine, (0.8, 1.2))
KNOWN: dict[str, Builder] = {
    "constant_friction_hinge": forms.friction(_whole, 0.15, 0.6),
    "constant_damping_hinge": forms.damping(_whole),
    "constant_positive_conservative_hinge": forms.force(_constant),
    "constant_negative_conservative_hinge": forms.force(_constant, way=-1),
    "detent_internal": forms.force(_detent),
    "bistable_mechanism": forms.force(_dead_centre),
    "bistable_mechanism_internal": forms.force(_two_wells),
    "magnetic_return_to_low_end": forms.force(_to_end(_magnet, False), 0.4, 1.2),
    "magnetic_return_to_high_end": forms.force(_to_end(_magnet, True), 0.4, 1.2),
    "spring_return_to_low_end": forms.force(_to_end(_lever, False)),
    "spring_return_to_high_end": forms.force(_to_end(_lever, True)),
    "spring_loaded_snap_detent_to_low_end": forms.force(_to_end(_snap, False), 0.3, 1.0),
    "spring_loaded_snap_detent_to_high_end": forms.force(_to_end(_snap, True), 0.3, 1.0),
    "position_dependent_friction": forms.friction(_zone, 0.25, 0.8),
    "position_dependent_damping": forms.damping(_zone),
    "stribeck_friction": forms.stribeck(
        lambda sampler, size, slow: friction_laws.PowerStribeck(size, slow, 1.0)
    ),
    "asymmetric_friction": forms.friction(_sloping, 0.15, 0.5, one_way=True),
    "direction_dependent_damping": forms.damping(_sloping, one_way=True),
    "quadratic_damping": forms.quadratic(lambda sampler, size: DragAlong(size, _sloping(sampler))),
    "presliding_friction": forms.presliding(
        lambda sampler, size, stiffness: memory.slips(size, stiffness, 4), (0.004, 0.06)
    ),
    "load_dependent_friction": forms.loaded(lambda sampler, size: friction_laws.LoadFriction(size)),
    "added_inertia": forms.inertia(forms.rigid),
    "gravity_offset": forms.weight(lambda sampler: sampler.between(0, 2 * np.pi)),
    "backlash": forms.behind((0.01, 0.05), (0.5, 0.85), (100.0, 160.0)),
    "end_stop_restitution": forms.rebound(soft=True, both=0.3),
}
UNCATALOGUED: dict[str, Builder] = {
    "maxwell_relaxation": uncatalogued_forms.two_relaxations,
    "friction_ageing": uncatalogued_forms.ageing,
    "warming_up": SHARED["warming_up"],
    "pulling_cable": SHARED["pulling_cable"],
    "air_cushion": uncatalogued_forms.cushion,
    "lost_motion_damper": uncatalogued_forms.lost_motion,
    "periodic_disturbance": SHARED["periodic_disturbance"],
}

HOUSEHOLD = Family("household", "door", KNOWN, UNCATALOGUED, (), _truth, _encoder, _move)
