"""What moves the joint in a run: hands that push and let go, slow ramps, small reversals, flicks.

Plans are in natural units: positions normalised, times in the joint's natural time, forces in its
natural force.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from joda.hidden.laws import Array
from joda.hidden.truth import Joint

BOUND = 4.0
"""Largest force of a hand."""
MARGIN = 0.08
"""Part of the range, at each end, in which a hand brakes."""
GUARD = 120.0
"""Stiffness of its braking."""


@dataclass(frozen=True)
class Plan:
    """One motion; arrays have shape (steps + 1,).

    Attributes:
        start: normalised position, and speed in ranges per natural time.
        target: that the hand goes to, normalised.
        grip: of the hand, 0 (let go) to 1.
        push: force without a hand's yielding.
        stiffness: of the hand, natural forces per range.
        guards: stiffness of its braking near the low and the high end.
    """

    start: tuple[float, float]
    target: Array
    grip: Array
    push: Array
    stiffness: float
    guards: tuple[float, float]


@dataclass(frozen=True)
class Ground:
    """Where to move, and how.

    Attributes:
        reach: lowest and highest normalised position to go to.
        guards: as in Plan.
        softness: factor of the hand's stiffness.
    """

    reach: tuple[float, float] = (0.1, 0.9)
    guards: tuple[float, float] = (GUARD, GUARD)
    softness: float = 1.0


Draw = Callable[[np.random.Generator, Ground, Array], Plan]


def hand(pace: float, stiffness: tuple[float, float] = (10.0, 20.0)) -> Draw:
    """Goes to and fro between random places; pace in natural times per range."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        places = visits(rng, ground, 40)
        lasts = pace * rng.uniform(0.7, 1.4, 39) * np.sqrt(np.abs(np.diff(places)))
        target = glide(t, places, lasts, rng.uniform(0, 0.3, 39))
        return held(ground, places[0], target, np.zeros_like(t), rng.uniform(*stiffness))

    return plan


def ramp(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
    """A stiff hand goes slowly back and forth, at constant speeds, and dwells."""
    places = visits(rng, ground, 20)
    lasts = np.abs(np.diff(places)) / rng.uniform(0.2, 0.5, 19)
    target = straight(t, places, lasts, rng.uniform(0.1, 0.4, 19))
    return held(ground, places[0], target, np.zeros_like(t), rng.uniform(30, 50))


def reversals(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
    """A soft hold, and a force to and fro that grows from below breakaway to beyond it."""
    start = float(rng.uniform(*ground.reach))
    most = np.exp(rng.uniform(np.log(0.25), np.log(0.9)))
    push = most * (t / t[-1]) * np.sin(2 * np.pi * rng.uniform(0.8, 2.0) * t)
    return held(ground, start, np.full_like(t, start), push, rng.uniform(4, 8))


def release(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
    """Pushes off, lets go on the way, coasts, takes hold again."""
    places = visits(rng, ground, 40)
    lasts = rng.uniform(0.4, 0.8, 39)
    rests = rng.uniform(0.4, 1.0, 39)
    target = glide(t, places, lasts, rests)
    grip = np.ones_like(t)
    moment = 0.0
    for move, rest in zip(lasts, rests, strict=True):
        off, on = moment + 0.5 * move, moment + move + 0.6 * rest
        gap = np.minimum((t - off) / 0.05, (on - t) / 0.2)
        grip -= np.clip(gap, 0, 1)
        moment += move + rest
    plan = held(ground, places[0], target, np.zeros_like(t), rng.uniform(10, 20))
    return replace(plan, grip=grip)


def flick(least: float) -> Draw:
    """Starts with at least this speed, mostly towards the farther end, and is left alone."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        start = float(rng.uniform(0.1, 0.9))
        speed = float(np.exp(rng.uniform(np.log(least), np.log(4.0))))
        towards = np.sign(0.5 - start) if rng.random() < 0.7 else rng.choice([-1.0, 1.0])
        none = np.zeros_like(t)
        return Plan((start, speed * float(towards)), none, none, none, 0.0, (0.0, 0.0))

    return plan


def drop(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
    """Starts at rest, and is left alone."""
    none = np.zeros_like(t)
    return Plan((float(rng.uniform(0.08, 0.92)), 0.0), none, none, none, 0.0, (0.0, 0.0))


FORCED: tuple[tuple[Draw, ...], tuple[Draw, ...]] = (
    (hand(2.5), hand(1.2), hand(0.6), ramp, ramp, reversals, release, release),
    (hand(1.2), hand(0.6), ramp, release),
)
"""Of the runs to learn from, and of those held out."""
IMPACTS: tuple[tuple[Draw, ...], tuple[Draw, ...]] = (
    (hand(2.5), hand(1.2), ramp, release, release, release, release, release),
    (hand(1.2), release, release, release),
)
FREE: tuple[tuple[Draw, ...], tuple[Draw, ...]] = (
    (flick(0.5),) * 7 + (drop,),
    (flick(0.5),) * 4,
)
FLICKS: tuple[tuple[Draw, ...], tuple[Draw, ...]] = ((flick(2.0),) * 8, (flick(2.0),) * 4)


class Hands:
    """The hands of some plans, side by side, as a Push of the simulator.

    Each pulls with a spring and a damper at its target, up to a bound, and brakes near the ends.
    """

    def __init__(self, joint: Joint, plans: list[Plan], h: float) -> None:
        """Takes plans for steps of length h."""
        force, span = joint.force, joint.span
        self.lo, self.hi = joint.lo, joint.hi
        self.target = joint.lo + span * np.stack([plan.target for plan in plans], axis=1)
        self.speed = np.gradient(self.target, h, axis=0)
        self.grip = np.stack([plan.grip for plan in plans], axis=1)
        self.push = force * np.stack([plan.push for plan in plans], axis=1)
        self.stiffness = np.array([plan.stiffness for plan in plans]) * force / span
        self.damping = 1.4 * np.sqrt(self.stiffness * joint.inertia)
        self.low, self.high = np.array([plan.guards for plan in plans]).T * force / span
        self.guarded = bool(self.low.any() or self.high.any())
        self.near, self.far = joint.lo + MARGIN * span, joint.hi - MARGIN * span
        self.brake = 1.4 * np.sqrt(joint.inertia * span / (GUARD * force)) / (0.5 * MARGIN * span)
        self.bound = BOUND * force

    def at(self, k: int, q: Array, v: Array) -> Array:
        """See Push."""
        pull = self.stiffness * (self.target[k] - q) + self.damping * (self.speed[k] - v)
        pull = self.grip[k] * np.minimum(np.maximum(pull, -self.bound), self.bound) + self.push[k]
        if not self.guarded:
            return np.asarray(pull)
        low, high = np.maximum(self.near - q, 0.0), np.maximum(q - self.far, 0.0)
        yielding = 1 + self.brake * np.maximum(np.where(low > 0, -v, v), -1 / self.brake)
        return np.asarray(pull + (self.low * low - self.high * high) * yielding)


def held(ground: Ground, start: float, target: Array, push: Array, stiffness: float) -> Plan:
    """A plan with a hand that never lets go."""
    return Plan(
        (float(start), 0.0),
        target,
        np.ones_like(target),
        push,
        stiffness * ground.softness,
        ground.guards,
    )


def visits(rng: np.random.Generator, ground: Ground, n: int) -> Array:
    """Random targets, each at least a third of the reach from the one before."""
    low, high = ground.reach
    places = [rng.uniform(low, high)]
    while len(places) < n:
        place = rng.uniform(low, high)
        if abs(place - places[-1]) > (high - low) / 3:
            places.append(place)
    return np.array(places)


def _knots(places: Array, lasts: Array, dwells: Array) -> tuple[Array, Array]:
    """Times and places between which the course moves and dwells in turn."""
    times = np.cumsum(np.column_stack([lasts, dwells]).ravel())
    return np.concatenate([[0.0], times]), np.repeat(places, 2)[1:]


def straight(t: Array, places: Array, lasts: Array, dwells: Array) -> Array:
    """Goes from place to place at constant speeds, in given times, and dwells at each."""
    times, knots = _knots(places, lasts, dwells)
    return np.interp(t, times, knots)


def glide(t: Array, places: Array, lasts: Array, dwells: Array) -> Array:
    """As straight, with the least jerk (Flash and Hogan, J. Neurosci. 5 (1985) 1688)."""
    times, knots = _knots(places, lasts, dwells)
    i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    u = np.clip((t - times[i]) / (times[i + 1] - times[i]), 0, 1)
    return np.asarray(knots[i] + (knots[i + 1] - knots[i]) * u**3 * (10 - 15 * u + 6 * u * u))
