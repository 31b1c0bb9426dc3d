"""Buttons from 5 g, keys and knobs, which go through their stroke in 15 to 400 ms.

Fingers press and let go, testers creep and pluck; many have a return spring, and all strike their
stops and rest there. Encoders are coarse or fine, at 500 and 1000 Hz. Triangles with unequal lobes,
exponentials, springs of two rates.
"""

from collections.abc import Sequence

import numpy as np

from joda.hidden import forms, friction_laws, shapes, truth, uncatalogued_forms
from joda.hidden.drag import Orifice
from joda.hidden.family import Family
from joda.hidden.gestures import Session, perform, press, shove, some, toss, trembling
from joda.hidden.laws import Shape
from joda.hidden.measuring import Encoder, Motions
from joda.hidden.motions import Draw, drop, flick, hand, ramp
from joda.hidden.plants import GRAVITY, furnish, pick
from joda.hidden.sampler import Builder, Sampler
from joda.hidden.truth import RESTITUTION_EFFECT, Joint, Truth
from joda.hidden.uncatalogued import UNCATALOGUED as SHARED

WEIGHTY = ("load_dependent_friction",)
TIMED = "periodic_disturbance"


# --- joints
def _truth(rng: np.random.Generator, names: Sequence[str], forced: bool) -> Truth:
    weighty = not forced and any(name in WEIGHTY for name in names)
    kind = rng.choice(["button"] if weighty else ["button", "key", "knob"])
    joint = _button(rng, weighty) if kind == "button" else _turning(rng, kind == "knob")
    return furnish(rng, joint, names, (90.0, 160.0), sprung=0.5)


def _button(rng: np.random.Generator, weighty: bool) -> Joint:
    mass, span, time = pick(rng, 0.005, 0.05), pick(rng, 0.0015, 0.008), pick(rng, 0.015, 0.06)
    force = mass * span / time**2 * rng.uniform(4, 12)
    upright = weighty or rng.random() < 0.5
    weight = rng.choice([-1.0, 1.0]) * min(0.9 * mass * GRAVITY, force) if upright else 0.0
    return Joint("slide", 0.0, span, mass, float(weight), 0.0, time, force)


def _turning(rng: np.random.Generator, knob: bool) -> Joint:
    if knob:
        inertia, span, time = pick(rng, 1e-6, 1e-4), rng.uniform(1.0, 5.0), pick(rng, 0.1, 0.4)
    else:
        inertia, span, time = pick(rng, 1e-7, 1e-5), rng.uniform(0.15, 0.8), pick(rng, 0.02, 0.1)
    lo = -0.5 * span if rng.random() < 0.5 else 0.0
    force = inertia * span / time**2 * rng.uniform(4, 12)
    return Joint("hinge", lo, lo + span, inertia, 0.0, 0.0, time, force)


def _encoder(rng: np.random.Generator, joint: Joint) -> Encoder:
    rate = 1000.0 if joint.time < 0.05 else float(rng.choice([500.0, 1000.0]))
    step = joint.span / pick(rng, 30, 3000)
    noise = joint.span * pick(rng, 2e-4, 4e-3)
    sigma = float(np.hypot(noise, step / np.sqrt(12)))
    return Encoder(sigma, False, bool(rng.random() < 0.2), pick(rng, 5e-4, 5e-3), step, rate)


# --- motions
def _move(rng: np.random.Generator, truth: Truth, names: Sequence[str], forced: bool) -> Motions:
    pushed: tuple[Draw, ...] = (
        press((0.5, 3.0), 2.5),
        hand(0.8, (30.0, 60.0)),
        ramp,
        shove((0.3, 1.0)),
        press((0.0, 0.5), 4.0),
        trembling(hand(1.5, (5.0, 15.0)), 0.2, (1.0, 3.0)),  # which no sampling shows if quicker
    )
    left: tuple[Draw, ...] = (toss(0.8), flick(0.5), drop, flick(1.0))
    if RESTITUTION_EFFECT in names:
        pushed, left = (shove((0.3, 0.8), 4.0), press((0.0, 0.5), 4.0)), (toss(1.5),)
    draws = pushed if forced else left
    session = Session(
        some(rng, draws, 3, 12),
        some(rng, draws, 2, 4),
        (8.0, 20.0) if forced else (3.0, 8.0),
        timed=TIMED in names,
    )
    return perform(rng, truth, session, forced)


# --- laws
def _whole(sampler: Sampler) -> Shape:
    return shapes.Trapezoid(sampler.between(0.0, 0.08), sampler.between(0.92, 1.0), 0.02)


def _zone(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.12, 0.7)
    return shapes.Logistic(a, b, sampler.between(0.005, 0.03))


def _growing(sampler: Sampler) -> Shape:
    return shapes.Progressive(sampler.between(1.0, 2.0), 2.0)


def _detent(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.1, 0.35)
    return shapes.Well(shapes.triangle, 0.5 * (a + b), 0.5 * (b - a), sampler.between(0.5, 1.0))


def _two_wells(sampler: Sampler) -> Shape:
    a, b = sampler.stretch(0.3, 0.6)
    half = 0.25 * (b - a)
    wells = tuple(shapes.Well(shapes.triangle, at, half) for at in (a + half, b - half))
    return shapes.Sum(wells, (1.0, sampler.between(0.6, 1.0)))


def _dead_centre(sampler: Sampler) -> Shape:
    return shapes.Sine(sampler.between(0.4, 0.6), sampler.between(1.1, 2.4))


def _to_end(pull: forms.ShapeOf, high: bool) -> forms.ShapeOf:
    return lambda sampler: shapes.ToEnd(pull(sampler), high)


def _magnet(sampler: Sampler) -> Shape:
    return shapes.Decay(sampler.between(0.04, 0.12))


def _spring(sampler: Sampler) -> Shape:
    return shapes.TwoRate(
        sampler.between(0.1, 0.8), sampler.between(0.3, 0.6), sampler.between(0.5, 2.0)
    )


_snap = forms.barrier(shapes.triangle, (0.6, 1.0))
KNOWN: dict[str, Builder] = {
    "constant_friction_hinge": forms.friction(_whole, 0.15, 0.6),
    "constant_damping_hinge": forms.damping(_whole),
    "constant_positive_conservative_hinge": forms.force(_zone),
    "constant_negative_conservative_hinge": forms.force(_zone, way=-1),
    "detent_internal": forms.force(_detent, 0.3, 1.0),
    "bistable_mechanism": forms.force(_dead_centre),
    "bistable_mechanism_internal": forms.force(_two_wells, 0.3, 1.0),
    "magnetic_return_to_low_end": forms.force(_to_end(_magnet, False), 0.4, 1.2),
    "magnetic_return_to_high_end": forms.force(_to_end(_magnet, True), 0.4, 1.2),
    "spring_return_to_low_end": forms.force(_to_end(_spring, False)),
    "spring_return_to_high_end": forms.force(_to_end(_spring, True)),
    "spring_loaded_snap_detent_to_low_end": forms.force(_to_end(_snap, False), 0.3, 1.0),
    "spring_loaded_snap_detent_to_high_end": forms.force(_to_end(_snap, True), 0.3, 1.0),
    "position_dependent_friction": forms.friction(_zone, 0.25, 0.8),
    "position_dependent_damping": forms.damping(_zone),
    "stribeck_friction": forms.stribeck(
        lambda sampler, size, slow: friction_laws.RationalStribeck(size, slow)
    ),
    "asymmetric_friction": forms.friction(_growing, 0.15, 0.5, one_way=True),
    "direction_dependent_damping": forms.damping(_growing, one_way=True),
    "quadratic_damping": forms.quadratic(
        lambda sampler, size: Orifice(
            size, sampler.between(0.05, 0.2) * sampler.joint.span / sampler.joint.time
        )
    ),
    "presliding_friction": forms.presliding(
        lambda sampler, size, stiffness: truth.Bristle(
            size,
            stiffness,
            sampler.between(0.1, 0.6) * float(np.sqrt(stiffness * sampler.joint.inertia)),
        ),
        (0.01, 0.1),
    ),
    "load_dependent_friction": forms.loaded(
        lambda sampler, size: friction_laws.LoadedBearing(
            size, sampler.between(0.05, 0.3) * sampler.joint.force
        )
    ),
    "added_inertia": forms.inertia(forms.linked),
    "gravity_offset": forms.weight(lambda sampler: sampler.rng.choice([0.0, np.pi])),
    "backlash": forms.handle((0.02, 0.06), (0.2, 0.6)),
    "end_stop_restitution": forms.rebound(soft=False, both=0.6),
}
UNCATALOGUED: dict[str, Builder] = {
    "maxwell_relaxation": SHARED["maxwell_relaxation"],
    "friction_ageing": uncatalogued_forms.ageing,
    "running_in": uncatalogued_forms.running_in,
    "lost_motion_damper": uncatalogued_forms.lost_motion,
    "sloshing_load": uncatalogued_forms.sloshing,
    "square_root_damping": SHARED["square_root_damping"],
    "speed_governor": uncatalogued_forms.governor,
}

SWITCHES = Family("switches", "button", KNOWN, UNCATALOGUED, ("backlash",), _truth, _encoder, _move)
