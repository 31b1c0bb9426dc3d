"""Stages, arms and turntables that a motor moves, from 0.3 to 30 kg.

Sweeps, steps and slow ramps, into the stops too; with the motor off they coast. Encoders of 1000 to
10,000 steps, or a few Hall sensors, at 100 to 1000 Hz. Dipoles, struts, quartics, narrow zones; a
shaft with a gap behind the motor.
"""

from collections.abc import Sequence

import numpy as np

from joda.hidden import forms, friction_laws, memory, shapes, uncatalogued_forms
from joda.hidden.drag import DragAlong
from joda.hidden.family import Family
from joda.hidden.gestures import Session, perform, press, shove, some, steps, sweep, toss, track
from joda.hidden.laws import Shape
from joda.hidden.measuring import Encoder, Motions
from joda.hidden.motions import Draw, drop, flick, hand, ramp, reversals
from joda.hidden.plants import GRAVITY, furnish, pick
from joda.hidden.sampler import Builder, Sampler
from joda.hidden.truth import RESTITUTION_EFFECT, Joint, Truth
from joda.hidden.uncatalogued import UNCATALOGUED as SHARED

WEIGHTY = ("load_dependent_friction",)
TIMED = "periodic_disturbance"


# --- joints
def _truth(rng: np.random.Generator, names: Sequence[str], forced: bool) -> Truth:
    weighty = not forced and any(name in WEIGHTY for name in names)
    kind = rng.choice(["arm"] if weighty else ["stage", "arm", "table"])
    joint = _stage(rng) if kind == "stage" else _turning(rng, kind == "arm")
    return furnish(rng, joint, names, (60.0, 200.0))


def _stage(rng: np.random.Generator) -> Joint:
    mass, span, time = pick(rng, 0.3, 30.0), pick(rng, 0.1, 1.0), pick(rng, 0.25, 1.2)
    force = mass * span / time**2 * rng.uniform(6, 20)
    tilt = 0.0
    if rng.random() < 0.3:
        tilt = rng.choice([-1.0, 1.0]) * min(0.9 * mass * GRAVITY, 0.5 * force)
    return Joint("slide", -0.5 * span, 0.5 * span, mass, float(tilt), 0.0, time, force)


def _turning(rng: np.random.Generator, arm: bool) -> Joint:
    inertia, span, time = pick(rng, 1e-3, 1.0), rng.uniform(1.0, 6.0), pick(rng, 0.3, 1.5)
    force = inertia * span / time**2 * rng.uniform(6, 20)
    weight, angle = (rng.uniform(0.2, 0.8) * force if arm else 0.0), rng.uniform(0, 2 * np.pi)
    cos, sin = float(weight * np.cos(angle)), float(weight * np.sin(angle))
    return Joint("hinge", -0.5 * span, 0.5 * span, inertia, cos, sin, time, force)


def _encoder(rng: np.random.Generator, joint: Joint) -> Encoder:
    rate, force = max(pick(rng, 100, 1000), 60 / joint.time), pick(rng, 5e-4, 5e-3)
    coarse = rng.random() < 0.15
    step = joint.span / (pick(rng, 10, 100) if coarse else pick(rng, 1000, 10_000))
    noise = joint.span * pick(rng, 3e-5, 5e-4)
    sigma = float(np.hypot(noise, step / np.sqrt(12)))
    return Encoder(sigma, False, bool(rng.random() < 0.1), force, step, rate)


# --- motions
def _move(rng: np.random.Generator, truth: Truth, names: Sequence[str], forced: bool) -> Motions:
    pushed: tuple[Draw, ...] = (
        track((0.15, 0.4), 1.0),
        sweep((0.5, 1.5), (3.0, 10.0)),
        hand(0.9, (30.0, 60.0)),
        ramp,
        steps(1.5, (3.0, 8.0)),
        reversals,
        press((0.2, 1.0), 1.5),
    )
    left: tuple[Draw, ...] = (flick(0.8), toss(0.5), drop, flick(0.4))
    if RESTITUTION_EFFECT in names:
        pushed, left = (shove((0.3, 0.8)), steps(3.0, (0.5, 2.0)), shove((0.5, 1.0))), (toss(1.5),)
    draws = pushed if forced else left
    session = Session(
        some(rng, draws, 3, 7) if forced else some(rng, draws, 4, 10),
        some(rng, draws, 2, 4),
        (4.0, 14.0) if forced else (2.0, 8.0),
        timed=TIMED in names,
    )
    return perform(rng, truth, session, forced)


# --- laws
def _whole(sampler: Sampler) -> Shape:
    return shapes.Slope()


def _pull(sampler: Sampler) -> Shape:
    return shapes.Trapezoid(*sampler.stretch(0.3, 0.9), sampler.between(0.02, 0.1))


def _rippled(sampler: Sampler) -> Shape:
    ripple = shapes.Sine(sampler.between(0, 1), sampler.between(0.08, 0.3))
    return shapes.Sum((shapes.Slope(), ripple), (1.0, sampler.between(0.05, 0.3)))


def _zone(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.06, 0.15) if sampler.chance() else sampler.stretch(0.2, 0.6)
    return shapes.Trapezoid(a, b, sampler.between(0.005, 0.05))


def _detent(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.1, 0.35)
    ratio = sampler.size(0.5, 1.0) ** sampler.way()
    return shapes.Well(shapes.gaussian, 0.5 * (a + b), 0.5 * (b - a), ratio)


def _two_wells(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.3, 0.6)
    half = 0.25 * (b - a)
    wells = tuple(shapes.Well(shapes.quartic, at, half) for at in (a + half, b - half))
    return shapes.Sum(wells, (1.0, sampler.between(0.7, 1.3)))


def _strut(sampler: Sampler) -> Shape:
    arm = sampler.between(0.2, 0.6)
    slack = 0.0 if sampler.chance() else 1 + arm + sampler.between(0.0, 0.5)
    return shapes.Strut(sampler.between(0.4, 0.6), arm, sampler.between(1.5, 3.0), slack)


def _to_end(pull: forms.ShapeOf, high: bool) -> forms.ShapeOf:
    return lambda sampler: shapes.ToEnd(pull(sampler), high)


def _dipole(sampler: Sampler) -> Shape:
    return shapes.Gap(sampler.between(0.08, 0.3), 4.0)


def _spring(sampler: Sampler) -> Shape:
    return shapes.Progressive(sampler.between(0.05, 0.6), sampler.between(0.6, 2.2))


_snap = forms.barrier(shapes.quartic, (0.6, 1.4))
KNOWN: dict[str, Builder] = {
    "constant_friction_hinge": forms.friction(_whole, 0.12, 0.6),
    "constant_damping_hinge": forms.damping(_whole),
    "constant_positive_conservative_hinge": forms.force(_pull),
    "constant_negative_conservative_hinge": forms.force(_pull, way=-1),
    "detent_internal": forms.force(_detent),
    "bistable_mechanism": forms.force(_strut),
    "bistable_mechanism_internal": forms.force(_two_wells),
    "magnetic_return_to_low_end": forms.force(_to_end(_dipole, False), 0.4, 1.2),
    "magnetic_return_to_high_end": forms.force(_to_end(_dipole, True), 0.4, 1.2),
    "spring_return_to_low_end": forms.force(_to_end(_spring, False)),
    "spring_return_to_high_end": forms.force(_to_end(_spring, True)),
    "spring_loaded_snap_detent_to_low_end": forms.force(_to_end(_snap, False), 0.3, 1.0),
    "spring_loaded_snap_detent_to_high_end": forms.force(_to_end(_snap, True), 0.3, 1.0),
    "position_dependent_friction": forms.friction(_zone, 0.2, 0.8),
    "position_dependent_damping": forms.damping(_zone),
    "stribeck_friction": forms.stribeck(
        lambda sampler, size, slow: friction_laws.PowerStribeck(
            size, slow, sampler.between(0.5, 2.0)
        )
    ),
    "asymmetric_friction": forms.friction(_rippled, 0.12, 0.5, one_way=True),
    "direction_dependent_damping": forms.damping(_rippled, one_way=True),
    "quadratic_damping": forms.quadratic(lambda sampler, size: DragAlong(size, _rippled(sampler))),
    "presliding_friction": forms.presliding(
        lambda sampler, size, stiffness: memory.BrittleBristle(
            size, stiffness, sampler.between(0.2, 0.8)
        ),
        (0.002, 0.05),
    ),
    "load_dependent_friction": forms.loaded(
        lambda sampler, size: friction_laws.LoadedContact(size, sampler.joint.force)
    ),
    "added_inertia": forms.inertia(forms.attached),
    "gravity_offset": forms.weight(lambda sampler: sampler.between(0, 2 * np.pi)),
    "backlash": forms.behind((0.005, 0.03), (0.3, 0.7), (50.0, 100.0)),
    "end_stop_restitution": forms.rebound(soft=True, both=0.7),
}
UNCATALOGUED: dict[str, Builder] = {
    "maxwell_relaxation": uncatalogued_forms.two_relaxations,
    "warming_up": SHARED["warming_up"],
    "running_in": uncatalogued_forms.running_in,
    "periodic_disturbance": uncatalogued_forms.switching,
    "sloshing_load": uncatalogued_forms.sloshing,
    "speed_governor": uncatalogued_forms.governor,
    "air_cushion": uncatalogued_forms.cushion,
}

MACHINERY = Family("machinery", "axis", KNOWN, UNCATALOGUED, (), _truth, _encoder, _move)
