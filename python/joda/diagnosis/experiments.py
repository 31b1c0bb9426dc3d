"""Which motion would tell two models apart: both are simulated over a menu of them.

A motion is prescribed to the first model, which says the force that it takes; the second one gets
the same force, begins each segment at the same state and may refit its own numbers. What it misses
then, in units of the measurement's noise, is what the motion would tell.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda.estimation.estimator import Make, SegmentEstimator
from joda.estimation.segments import Segments, evenly
from joda.estimation.unknowns import Unknowns
from joda.measured.measured_joint import Measured
from joda.profile import Joint

Array = NDArray[np.float64]

PER_WINDOW = 0.4
"""Length of a segment, s."""
LONGEST = 20.0
"""Of a motion, s."""
SLOWEST = 0.02
"""Part of the range per second that a motion is proposed at, at the least."""


@dataclass(frozen=True)
class Motion:
    """Something to do with the joint.

    Attributes:
        sentence: what to do, for a person.
        position: at each step, normalised; NaN where the joint is let go, shape (n,).
    """

    sentence: str
    position: Array


@dataclass(frozen=True)
class Model:
    """A fitted model: its joint by its numbers, the numbers, and their bounds."""

    make: Make
    unknowns: Unknowns
    x: Array


@dataclass(frozen=True)
class ExperimentalLimits:
    """What experiments are made with.

    Attributes:
        joint: that is moved.
        inertia: kg·m² or kg.
        speed: usual speed, rad/s or m/s.
        h: step, s.
        sigma: noise of the position, rad or m.
        forced: whether forces are measured.
    """

    joint: Joint
    inertia: float
    speed: float
    h: float
    sigma: float
    forced: bool


def means_of(measured: Measured, segments: Segments, h: float) -> ExperimentalLimits:
    """What experiments on a joint would be made with: as these runs were.

    Args:
        measured: the joint and its runs.
        segments: of these.
        h: step, s.
    """
    least = SLOWEST * float(np.ptp(measured.profile.joint.range))
    return ExperimentalLimits(
        joint=measured.profile.joint,
        inertia=measured.joint_model.inertia,
        speed=max(float(np.sqrt(np.mean(segments.start[:, 1] ** 2))), least),
        h=h,
        sigma=measured.floor,
        forced=any(run.pushed for run in measured.runs),
    )


def next_experiment(first: Model, second: Model, means: ExperimentalLimits) -> str | None:
    """The motion of the menu that tells the models apart best; None if none does."""
    best, told = None, 3.0
    for motion in menu(means):
        if (difference := _difference(motion, first, second, means)) > told:
            best, told = motion, difference
    return None if best is None else best.sentence


def _stroke(s0: float, s1: float, speed: float, h: float) -> Array:
    """From one normalised position to another at a speed (1/s), in steps of h."""
    n = max(round(abs(s1 - s0) / (speed * h)), 2)
    return np.linspace(s0, s1, min(n, round(LONGEST / 2 / h)))


def there_and_back(means: ExperimentalLimits) -> Motion:
    """Slowly through the range and back: tells a resistance from a force over position."""
    lo, hi = means.joint.range
    slow = 0.1 * means.speed / (hi - lo)
    rest = np.full(round(0.5 / means.h), 0.9)
    return Motion(
        f"Push slowly (about {slow * (hi - lo):.2g} {means.joint.unit}/s) from one end of the "
        "range to the other, wait half a second there, and push slowly back; record the force all "
        "the way.",
        np.concatenate([_stroke(0.1, 0.9, slow, means.h), rest, _stroke(0.9, 0.1, slow, means.h)]),
    )


def menu(means: ExperimentalLimits) -> Iterator[Motion]:
    """Motions that people can make, slow and fast ones, long enough to be told apart."""
    lo, hi = means.joint.range
    span, h = hi - lo, means.h
    unit = means.joint.unit
    pace = means.speed / span

    if means.forced:
        yield there_and_back(means)
        speeds = (0.3 * pace, pace, 2 * pace)
        named = ", ".join(f"{v * span:.2g}" for v in speeds)
        yield Motion(
            f"Push through the range in both directions at constant speeds of {named} {unit}/s, "
            "once each, and record the force.",
            np.concatenate(
                [_stroke(*ends, v, h) for v in speeds for ends in ((0.1, 0.9), (0.9, 0.1))]
            ),
        )
        t = np.arange(0, 6.0, h)
        for middle in (0.25, 0.5, 0.75):
            swing = 0.01 * (1 + t) * np.sin(2 * np.pi * t / 1.5)
            yield Motion(
                f"Push in both directions around q = {lo + middle * span:.3g} {unit}, at first by "
                f"{0.01 * span:.2g} {unit}, then more and more up to {0.07 * span:.2g} {unit}, a "
                "turn every 0.75 s, for 6 s, and record the force.",
                middle + swing,
            )
    for s in (0.2, 0.5, 0.8):
        n = round(2.0 / h)
        yield Motion(
            f"Hold the joint at q = {lo + s * span:.3g} {unit}, let it go, and record 2 s of its "
            "motion.",
            np.concatenate([[s, s], np.full(n, np.nan)]),
        )
    for s0, v in ((0.1, 1.5 * pace), (0.9, -1.5 * pace)):
        n = round(1.5 / h)
        yield Motion(
            f"Give the joint a shove from q = {lo + s0 * span:.3g} {unit} towards "
            f"{'+q' if v > 0 else chr(0x2212) + 'q'} (about {abs(v) * span:.2g} {unit}/s) and "
            "record how it runs out.",
            np.concatenate([[s0, s0 + v * h], np.full(n, np.nan)]),
        )


def _difference(motion: Motion, first: Model, second: Model, means: ExperimentalLimits) -> float:
    """How far off the second model is where the first is true: RMS residual, in noises."""
    segments = recorded(motion, first, means)
    estimator = SegmentEstimator(segments, segments.count > 0)
    fit = estimator.fit(second.make, second.unknowns, second.x, segments.start, 3)
    samples = max(int(segments.count.sum()), 1)
    return float(np.sqrt(fit.squares.sum() / samples))


def recorded(motion: Motion, model: Model, means: ExperimentalLimits) -> Segments:
    """What the first model does, in segments, without noise."""
    h, simulator = means.h, model.make(model.x)
    lo, hi = means.joint.range
    position = lo + (hi - lo) * motion.position
    n = len(position)
    free = np.isnan(position)
    force = np.zeros(n)
    velocity = np.gradient(np.where(free, 0.0, position), h) * ~free
    if free.any():
        velocity[0] = velocity[1] = (position[1] - position[0]) / h
    else:
        # one step from each state without a force tells what force keeps to the path
        start = np.stack([position, velocity], axis=1)
        fresh = np.arange(n) == 0
        before, after = simulator.replay(force, np.arange(n), start, fresh, h)
        alone = ((after - before) / h - velocity) / h
        wanted = np.gradient(velocity, h)
        force = means.inertia * (wanted - alone)
    return evenly(simulator, force, position, velocity, free, h, PER_WINDOW, means.sigma)
