"""More ways to move a joint: trembling hands, shoves, presses, a motor's sweeps and steps.

In natural units, as in `motions`. Nothing brakes at the ends: the joint goes into its stops and may
rest there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from joda.hidden.laws import Array
from joda.hidden.measuring import Motions
from joda.hidden.motions import Draw, Ground, Hands, Plan, held, straight
from joda.hidden.simulator import Tape, simulate
from joda.hidden.truth import Truth

BEYOND = Ground((-0.04, 1.04), (0.0, 0.0))
"""A reach into the stops."""
STEPS = 400
"""Steps of a simulation in a natural time, at least."""
TURN = 0.2
"""Largest angle by which the stiffest spring swings in a step, rad."""
STILL = 1e-3
"""Velocity up to which a joint counts as at rest, ranges per natural time."""


def trembling(draw: Draw, size: float, pace: tuple[float, float] = (8.0, 20.0)) -> Draw:
    """The same with a hand that trembles, by up to this force, so often in a natural time."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        one = draw(rng, ground, t)
        tremor = np.zeros_like(t)
        for frequency in rng.uniform(*pace, 3):
            tremor += np.sin(2 * np.pi * (frequency * t + rng.random()))
        return replace(one, push=one.push + size * rng.uniform(0.3, 1.0) / 3 * tremor * one.grip)

    return plan


def shove(lasts: tuple[float, float], most: float = 3.0) -> Draw:
    """Short pushes in turn up and down, between which the joint coasts, strikes and rests."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        push, way, moment = np.zeros_like(t), rng.choice([-1.0, 1.0]), 0.0
        start = 0.5 - 0.4 * way + rng.uniform(-0.08, 0.08)
        while moment < t[-1]:
            last, pause = rng.uniform(*lasts), rng.uniform(0.8, 2.5)
            u = (t - moment) / last
            push += way * rng.uniform(0.3, 1.0) * most * np.sin(np.pi * np.clip(u, 0, 1))
            moment, way = moment + last + pause, -way
        return _left(start, push)

    return plan


def press(hold: tuple[float, float], most: float) -> Draw:
    """Pushes that rise, hold the joint against a stop, and go; up and down in turn."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        push, way, moment = np.zeros_like(t), rng.choice([-1.0, 1.0]), 0.0
        start = 0.5 - 0.4 * way + rng.uniform(-0.08, 0.08)
        while moment < t[-1]:
            rise, stay, pause = rng.uniform(0.3, 2.0), rng.uniform(*hold), rng.uniform(0.2, 1.5)
            end = moment + rise + stay
            edges = np.minimum((t - moment) / rise, (end + 0.3 * rise - t) / (0.3 * rise))
            push += way * rng.uniform(0.3, 1.0) * most * np.clip(edges, 0, 1)
            moment, way = end + 0.3 * rise + pause, -way
        return _left(start, push)

    return plan


def sweep(size: tuple[float, float], stiffness: tuple[float, float]) -> Draw:
    """A motor's force that swings ever faster, on a joint that is held softly at a place."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        start = float(rng.uniform(0.3, 0.7))
        push = rng.uniform(*size) * np.sin(_chirp(rng, t, 0.15, 2.0))
        return held(ground, start, np.full_like(t, start), push, rng.uniform(*stiffness))

    return plan


def track(swing: tuple[float, float], most: float) -> Draw:
    """A motor follows a swing that becomes faster, up to a frequency (per natural time)."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        middle, size = rng.uniform(0.4, 0.6), rng.uniform(*swing)
        phase = _chirp(rng, t, 0.08, most)
        target = middle + size * np.sin(phase)
        return held(ground, middle, target, np.zeros_like(t), rng.uniform(40, 90))

    return plan


def steps(size: float, stiffness: tuple[float, float]) -> Draw:
    """A motor's force that steps at random, on a joint that is held softly."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        start = float(rng.uniform(0.3, 0.7))
        moments = np.cumsum(rng.uniform(0.2, 1.2, int(5 * t[-1]) + 2))
        levels = size * rng.uniform(-1, 1, len(moments))
        levels[0] = 0.0
        push = straight(t, levels, np.full(len(levels) - 1, 0.1), np.diff(moments) - 0.1)
        return held(ground, start, np.full_like(t, start), push, rng.uniform(*stiffness))

    return plan


def toss(least: float) -> Draw:
    """Begins near an end, at least this fast towards the other, and is left alone."""

    def plan(rng: np.random.Generator, ground: Ground, t: Array) -> Plan:
        way = rng.choice([-1.0, 1.0])
        speed = np.exp(rng.uniform(np.log(least), np.log(5.0)))
        one = _left(0.5 - way * rng.uniform(0.2, 0.45), np.zeros_like(t))
        return replace(one, start=(one.start[0], float(way * speed)))

    return plan


def _left(start: float, push: Array) -> Plan:
    """A plan without a grip."""
    none = np.zeros_like(push)
    return Plan((float(start), 0.0), none, none, push, 0.0, (0.0, 0.0))


def _chirp(rng: np.random.Generator, t: Array, least: float, most: float) -> Array:
    """Phase of a swing, from 0 on, whose frequency grows evenly over its logarithm, rad."""
    low = least * rng.uniform(0.7, 1.4)
    rate = np.log(most * rng.uniform(0.7, 1.4) / low) / t[-1]
    return np.asarray(2 * np.pi * low * np.expm1(rate * t) / rate)


@dataclass(frozen=True)
class Session:
    """What is done with a joint while it is measured.

    Attributes:
        train, held_out: gestures of the runs.
        lasts: shortest and longest run, natural times.
        least: shortest run, s.
        timed: whether the clock runs on between runs.
    """

    train: Sequence[Draw]
    held_out: Sequence[Draw]
    lasts: tuple[float, float]
    least: float = 0.2
    timed: bool = False


def perform(rng: np.random.Generator, truth: Truth, session: Session, forced: bool) -> Motions:
    """Moves the joint as planned; every run is recorded until its end, wherever the joint is."""
    joint, draws = truth.joint, (*session.train, *session.held_out)
    h = min(joint.time / STEPS, TURN / max(truth.fastest, 1e-9))
    low, high = np.log(session.lasts)
    lasts = np.maximum(joint.time * np.exp(rng.uniform(low, high, len(draws))), session.least)
    ends = [round(last / h) for last in lasts]
    t = np.arange(max(ends) + 1, dtype=np.float64) * (h / joint.time)
    plans = [_whole(rng, draw, t, end) for draw, end in zip(draws, ends, strict=True)]
    start = np.array([plan.start for plan in plans])
    clock = rng.uniform(0, 5, len(plans)) * session.timed
    trace = simulate(
        truth,
        Hands(joint, plans, h) if forced else Tape(np.zeros((len(t), len(plans)))),
        joint.lo + joint.span * start[:, 0],
        joint.span / joint.time * start[:, 1],
        len(t) - 1,
        h,
        clock,
    )
    still = STILL * joint.span / joint.time
    return Motions(trace, h, ends, clock, len(session.train), forced, joint.time, still)


def _whole(rng: np.random.Generator, draw: Draw, t: Array, end: int) -> Plan:
    """A plan that is over at a step; from then on nothing is recorded, and nothing is done."""
    one = draw(rng, BEYOND, t[: end + 1])
    rest = len(t) - 1 - end

    def lengthened(course: Array) -> Array:
        return np.concatenate([course, np.full(rest, course[-1])])

    return replace(
        one,
        target=lengthened(one.target),
        grip=lengthened(one.grip),
        push=lengthened(one.push),
    )


def some(rng: np.random.Generator, draws: Sequence[Draw], least: int, most: int) -> list[Draw]:
    """So many of these in turn, beginning anywhere."""
    first, count = int(rng.integers(len(draws))), int(rng.integers(least, most + 1))
    return [draws[(first + k) % len(draws)] for k in range(count)]
