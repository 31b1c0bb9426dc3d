"""Motions of a joint in a case, and what an encoder and a force sensor make of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from joda.hidden.instrument import TRUE, Instrument
from joda.hidden.laws import Array
from joda.hidden.motions import FLICKS, FORCED, FREE, GUARD, IMPACTS, Draw, Ground, Hands, release
from joda.hidden.simulator import Tape, Trace, simulate
from joda.hidden.truth import RESTITUTION_EFFECT, Joint, Truth
from joda.measured.runs import Run

TO_LOW = ("magnetic_return_to_low_end", "spring_loaded_snap_detent_to_low_end")
TO_HIGH = ("magnetic_return_to_high_end", "spring_loaded_snap_detent_to_high_end")
LATE = "actuation_delay"
TIMED = "periodic_disturbance"

WINDOW = 0.4
"""Length (s) over which a motion with and without an effect are compared."""
AFTER = 0.2
"""How long a joint that is left alone is still recorded at rest, natural times."""
SHORTEST = 50
"""Fewest samples of a run."""


@dataclass(frozen=True)
class Motions:
    """Simulated motions of a case.

    Attributes:
        trace: of all runs, side by side.
        h: length of a step, s.
        ends: first step of each run that is not recorded any more, shape (runs,).
        clock: time at the beginning of each, s.
        train: how many of them are to learn from; the others are held out.
        forced: whether the force is recorded.
        window: length over which a motion with and without an effect are compared, s.
        still: velocity up to which it counts as at rest, rad/s or m/s.
    """

    trace: Trace
    h: float
    ends: list[int]
    clock: Array
    train: int
    forced: bool
    window: float = WINDOW
    still: float = 0.0


@dataclass(frozen=True)
class Encoder:
    """How a joint is measured.

    Attributes:
        sigma: standard deviation of the position, rad or m.
        quantised: whether the error is that of steps of sqrt(12) sigma.
        uneven: whether time stamps are.
        force: noise of the force, of its root mean square.
        step: of a position that has Gaussian noise before it is rounded, rad or m.
        rate: samples per second; None for as many as suit the runs' length.
        instrument: what of it is wrong.
    """

    sigma: float
    quantised: bool
    uneven: bool
    force: float
    step: float = 0.0
    rate: float | None = None
    instrument: Instrument = TRUE


def draw_encoder(rng: np.random.Generator, joint: Joint) -> Encoder:
    """Draws how a joint is measured."""
    return Encoder(
        float(joint.span * np.exp(rng.uniform(np.log(2e-4), np.log(1e-3)))),
        bool(rng.random() < 0.2),
        bool(rng.random() < 0.25),
        float(rng.uniform(0.003, 0.01)),
    )


def move(rng: np.random.Generator, truth: Truth, names: Sequence[str], forced: bool) -> Motions:
    """Moves the joint as suits the effects of these names."""
    joint = truth.joint
    h = 1e-4 if joint.time < 0.6 else 2e-4
    length = float(np.clip(4.5 * joint.time, 1.5, 5.0))
    steps = round(length / h)
    t = np.arange(steps + 1, dtype=np.float64) * (h / joint.time)
    train, held_out = _draws(names, forced)
    plans = [one(rng, _ground(names, one), t) for one in (*train, *held_out)]
    start = np.array([plan.start for plan in plans])
    clock = np.asarray(rng.uniform(0, 5, len(plans)) * (TIMED in names), dtype=np.float64)
    trace = simulate(
        truth,
        Hands(joint, plans, h) if forced else Tape(np.zeros((steps + 1, len(plans)))),
        joint.lo + joint.span * start[:, 0],
        joint.span / joint.time * start[:, 1],
        steps,
        h,
        clock,
    )
    ends = [_end(joint, lane, h, names, forced) for lane in _lanes(trace)]
    return Motions(trace, h, ends, clock, len(train), forced)


def _draws(names: Sequence[str], forced: bool) -> tuple[tuple[Draw, ...], tuple[Draw, ...]]:
    if forced:
        return IMPACTS if RESTITUTION_EFFECT in names else FORCED
    return FLICKS if RESTITUTION_EFFECT in names else FREE


def _ground(names: Sequence[str], one: Draw) -> Ground:
    if RESTITUTION_EFFECT in names:
        return Ground((0.03, 0.97), (0.0, 0.0))
    if LATE in names:
        return Ground((0.2, 0.8), (0.1 * GUARD, 0.1 * GUARD), 0.15)
    low = any(name in TO_LOW for name in names)
    high = any(name in TO_HIGH for name in names)
    reach = 0.01 if low else 0.1, 0.99 if high else 0.9
    open_low, open_high = low and one is not release, high and one is not release
    return Ground(reach, (GUARD * (not open_low), GUARD * (not open_high)))


def _lanes(trace: Trace) -> list[tuple[Array, Array]]:
    """Position and velocity of each motion."""
    return list(zip(trace.position.T, trace.velocity.T, strict=True))


def _end(
    joint: Joint, lane: tuple[Array, Array], h: float, names: Sequence[str], forced: bool
) -> int:
    """Step at which recording ends.

    That is where the joint meets an end, unless that is what the effect is about; and, if it is
    left alone, a while after it has come to rest.
    """
    q, v = lane
    end, after = len(q), round(AFTER * joint.time / h)
    if not forced:
        end = min(end, int(np.max(np.flatnonzero(v), initial=0)) + after)
    near = np.minimum(q - joint.lo, joint.hi - q) <= 1.01 * h * np.abs(v)
    drawn = any(name in TO_LOW + TO_HIGH for name in names)
    if RESTITUTION_EFFECT in names or (drawn and forced) or not near.any():
        return end
    return min(end, int(np.argmax(near)) + after * drawn)


def shows(other: Truth, motions: Motions) -> float:
    """How far another joint would move otherwise, under the same force, in windows.

    Returns:
        upper quartile of the root mean square differences over windows in which it moves, rad
        or m.
    """
    trace, h = motions.trace, motions.h
    width = min(round(motions.window / h), round(float(np.median(motions.ends))) - 1)
    starts = [
        (lane, k)
        for lane, end in enumerate(motions.ends)
        for k in range(0, end - width, max(width, 1))
    ]
    if not starts:
        return 0.0
    lanes, begins = np.array(starts).T
    steps = begins[None, :] + np.arange(width + 1)[:, None]
    replayed = simulate(
        other,
        Tape(trace.force[steps, lanes]),
        trace.position[begins, lanes],
        trace.velocity[begins, lanes],
        width,
        h,
        motions.clock[lanes] + begins * h,
    )
    difference = replayed.position - trace.position[steps, lanes]
    rms = np.sqrt(np.mean(difference**2, axis=0))
    moves = (np.abs(trace.velocity[steps, lanes]) > motions.still).any(axis=0)
    moves |= rms > motions.still * motions.window
    return float(np.quantile(rms[moves], 0.75)) if moves.any() else 0.0


def measure(
    rng: np.random.Generator, motions: Motions, encoder: Encoder
) -> tuple[list[Run], list[Run], list[Run]]:
    """Runs to learn from, those held out, and these without noise."""
    trace, h = motions.trace, motions.h
    steps = len(trace.position)
    period = 1 / encoder.rate if encoder.rate else float(np.clip(steps * h / 1000, 0.001, 0.005))
    stride = round(period / h)
    clean: list[Run] = []
    logged: list[Run] = []
    ahead = round(encoder.instrument.delay / h)
    for lane, end in enumerate(motions.ends):
        name = f"run{lane + 1}" if lane < motions.train else f"held_out{lane - motions.train + 1}"
        step = max(min(stride, end // SHORTEST), 1)
        at = np.arange(0, end, step)
        if encoder.uneven and step > 4:
            at = at + rng.integers(0, step // 3 + 1, len(at))
            at = at[at < end]
        clean.append(
            Run(
                f"{name}.csv",
                np.asarray(at * h, dtype=np.float64),
                trace.position[at, lane],
                None,
                trace.force[at, lane],
                motions.forced,
            )
        )
        later = trace.force[np.minimum(at + ahead, steps - 1), lane]
        logged.append(replace(clean[-1], force=later))
    noisy = [encoder.instrument.logged(spoil(rng, run, encoder)) for run in logged]
    return noisy[: motions.train], noisy[motions.train :], clean[motions.train :]


def spoil(rng: np.random.Generator, run: Run, encoder: Encoder) -> Run:
    """The run as the encoder and a force sensor see it."""
    if encoder.quantised:
        quantum = encoder.sigma * np.sqrt(12)
        position = np.round(run.position / quantum) * quantum
    else:
        noise = np.sqrt(encoder.sigma**2 - encoder.step**2 / 12)
        position = run.position + noise * rng.standard_normal(len(run.time))
        if encoder.step:
            position = np.round(position / encoder.step) * encoder.step
    rms = float(np.sqrt(np.mean(run.force**2)))
    force = run.force + encoder.force * rms * rng.standard_normal(len(run.time))
    return replace(run, position=np.asarray(position), force=force)
