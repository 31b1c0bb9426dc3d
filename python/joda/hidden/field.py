"""Joints as people record them: arms, lids and sliders of which numbers are wrong.

The model's mass is up to 60 % off, or the force is logged at half to 1.6 times of what it is; its
offset, its clock (up to 40 ms) and the encoder's zero are wrong now and then. 30 to 200 Hz, uneven,
in coarse steps; hands and motors whose force such a rate can follow. Laws are those of the other
families, drawn from all of them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from joda.hidden import household, machinery, switches
from joda.hidden.family import Family
from joda.hidden.gestures import Session, perform, shove, some, sweep, toss, track
from joda.hidden.instrument import drawn
from joda.hidden.measuring import Encoder, Motions
from joda.hidden.motions import Draw, drop, flick, hand, ramp, reversals
from joda.hidden.plants import GRAVITY, furnish, pick
from joda.hidden.sampler import Builder, Hidden, Sampler
from joda.hidden.truth import RESTITUTION_EFFECT, Joint, Truth
from joda.hidden.uncatalogued import UNCATALOGUED as SHARED

TIMED = "periodic_disturbance"
SLOW = 0.7, 2.0
"""Least and greatest natural time, s: 30 Hz see no faster joint."""
HEAVY = 0.4
"""How often the model's mass is wrong."""
OTHERS = (household.HOUSEHOLD, machinery.MACHINERY, switches.SWITCHES)


# --- joints
def _truth(rng: np.random.Generator, names: Sequence[str], forced: bool) -> Truth:
    joint = _slider(rng) if rng.random() < 0.2 else _arm(rng)
    truth = furnish(rng, joint, names, (50.0, 120.0))
    if rng.random() >= HEAVY:
        return truth
    mass = float(np.exp(rng.uniform(*np.log([0.4, 1.6]))))  # true over the model's
    believed = replace(
        joint,
        inertia=joint.inertia / mass,
        gravity_cos=joint.gravity_cos / mass,
        gravity_sin=joint.gravity_sin / mass,
    )
    return replace(truth, believed=believed)


def _arm(rng: np.random.Generator) -> Joint:
    mass, length = pick(rng, 0.1, 5.0), rng.uniform(0.1, 0.5)
    inertia, torque = mass * length**2 / 3, 0.5 * mass * GRAVITY * length
    span, angle = rng.uniform(1.0, 3.0), rng.uniform(0, 2 * np.pi)
    weight = torque * rng.uniform(0.2, 1.0) * (rng.random() < 0.85)
    fall = np.sqrt(2 * span * inertia / max(weight, 0.2 * torque))
    time = float(np.clip(fall * rng.uniform(1.0, 2.0), *SLOW))
    force = float(0.5 * weight + inertia * span / time**2 * rng.uniform(5, 12))
    lo = -rng.uniform(0.2, 0.8) * span
    cos, sin = float(weight * np.cos(angle)), float(weight * np.sin(angle))
    return Joint("hinge", lo, lo + span, inertia, cos, sin, time, force)


def _slider(rng: np.random.Generator) -> Joint:
    mass, span, time = pick(rng, 0.3, 10.0), rng.uniform(0.2, 0.8), rng.uniform(*SLOW)
    force = float(mass * span / time**2 * rng.uniform(6, 15))
    tilt = rng.choice([-1.0, 1.0]) * min(0.8 * mass * GRAVITY, force * rng.uniform(0.2, 0.5))
    tilt *= rng.random() < 0.7
    return Joint("slide", 0.0, span, mass, float(tilt), 0.0, time, force)


def _encoder(rng: np.random.Generator, joint: Joint) -> Encoder:
    rate, force = max(pick(rng, 30, 200), 25 / joint.time), pick(rng, 1e-3, 1e-2)
    step = joint.span / pick(rng, 400, 8000)
    noise = joint.span * pick(rng, 1e-4, 1e-3)
    sigma = float(np.hypot(noise, step / np.sqrt(12)))
    own = drawn(rng, joint.force, joint.span, 0.35)
    return Encoder(sigma, False, bool(rng.random() < 0.4), force, step, rate, own)


# --- motions
def _move(rng: np.random.Generator, truth: Truth, names: Sequence[str], forced: bool) -> Motions:
    pushed: tuple[Draw, ...] = (
        track((0.15, 0.35), 0.8),
        hand(1.2, (6.0, 15.0)),
        sweep((0.5, 1.5), (4.0, 10.0)),
        ramp,
        reversals,
    )
    left: tuple[Draw, ...] = (flick(0.5), toss(0.6), drop, flick(0.9))
    if RESTITUTION_EFFECT in names:
        pushed, left = (shove((0.3, 0.8)), shove((0.5, 1.0), 4.0)), (toss(1.5),)
    draws = pushed if forced else left
    session = Session(
        some(rng, draws, 4, 6), some(rng, draws, 2, 3), (3.0, 6.0), timed=TIMED in names
    )
    return perform(rng, truth, session, forced)


# --- laws
def _any_of(name: str) -> Builder:
    """A law of this name as one of the other families has it."""

    def build(sampler: Sampler) -> Hidden:
        family = OTHERS[int(sampler.rng.integers(len(OTHERS)))]
        return family.known[name](sampler)

    return build


KNOWN: dict[str, Builder] = {name: _any_of(name) for name in household.KNOWN}
UNCATALOGUED: dict[str, Builder] = {
    name: law
    for name, law in (SHARED | household.UNCATALOGUED).items()
    if name != "actuation_delay"  # a wrong clock is one of the numbers here
}

FIELD = Family("field", "joint", KNOWN, UNCATALOGUED, (), _truth, _encoder, _move)
