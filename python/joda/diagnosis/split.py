"""What of the measurements is fitted, and what is held out of every fit.

Of four or more runs in which the joint moves, one of every three, in the order of how far the model
as it is misses them: what is missing shows in some runs only, and both what is fitted and what
judges must know of it (a stratified split). Of fewer, each is cut into blocks, and of those in
which the joint moves every fourth is held out: blocked cross-validation (Roberts et al., Ecography
40 (2017) 913), with blocks all over the motion, as one that rests says little of a law. Each block
is replayed from a start of its own, estimated from its own samples, so that nothing that was fitted
is in it. Of curves, where there are no runs, every fourth, or of few curves every fourth
stretch of each.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shape_refinement import LONGEST
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.problem import joint_model_for, segments_for
from joda.estimation.segments import Segments
from joda.measured import smoothing
from joda.measured.measured_joint import Measured
from joda.measured.quasi_static import QuasiStaticComparison
from joda.measured.runs import Run

Flags = NDArray[np.bool_]

LENGTHS = (2.0, 1.0, 0.5, 0.25)
"""Of blocks, in segments of the diagnosis: the longest of which there are enough are taken."""
SAMPLES = 12
"""Of a block at the least, where the run has as many."""
NOISES, TRAVEL = 10.0, 0.01
"""How far a joint that moves goes in a block: in units of the noise, and of its range."""
STRETCHES, STRETCH = 40, 4
"""In how many stretches a curve is cut at most, of how many samples at the least."""


@dataclass(frozen=True)
class Block:
    """A part of a run.

    Attributes:
        run: its number.
        samples: of the run.
    """

    run: int
    samples: slice


def parted(measured: Measured) -> tuple[Measured, Measured]:
    """What to fit, and what is held out; a run of which blocks are held out falls into pieces."""
    if not measured.runs:
        return _parted_curves(measured)
    held = held_blocks(measured)
    return _of(measured, _between(measured, held)), _of(measured, held)


def held_blocks(measured: Measured, judges: Segments | None = None) -> list[Block]:
    """What is held out of timed runs; whole runs are blocks too.

    Args:
        measured: the joint and its runs.
        judges: segments to be judged; None: long ones, as of profiles with an effect more.
    """
    runs = [Block(k, slice(0, len(run.time))) for k, run in enumerate(measured.runs)]
    moving = [block for block in runs if _moves(measured, block)]
    if len(moving) >= SETTINGS.adding.whole_runs:
        missed = _missed(measured, judges or segments_for(measured, LONGEST, fine=False))
        ranked = sorted(moving, key=lambda block: -missed[block.run])
        third = 2 if missed[ranked[2].run] > SETTINGS.adding.shown * missed.max() else 1
        return sorted(ranked[third::3], key=moving.index)
    length = (judges or segments_for(measured)).length
    for factor in LENGTHS:
        blocks = [
            block for k, run in enumerate(measured.runs) for block in _cut(k, run, factor * length)
        ]
        moving = [block for block in blocks if _moves(measured, block)]
        if len(moving) >= SETTINGS.adding.blocks:
            break
    return (moving if len(moving) > 1 else blocks)[1::4]


def held_segments(measured: Measured, segments: Segments) -> Flags:
    """Which of the segments of these measurements are held out, by their middles; shape (m,)."""
    if not measured.runs:
        few = len(measured.curves) < SETTINGS.adding.whole_runs
        return np.asarray(np.arange(len(segments.at)) % 4 == 2 if few else segments.run % 4 == 3)
    held = np.zeros(len(segments.at), bool)
    middle = segments.time[segments.rows[np.arange(len(held)), segments.count // 2]]
    for block in held_blocks(measured, segments):
        first, last = measured.runs[block.run].time[block.samples][[0, -1]]
        held |= (segments.run == block.run) & (first <= middle) & (middle <= last)
    return held


def in_blocks(measured: Measured, held: Measured) -> bool:
    """Whether blocks of the runs are held out, not whole runs."""
    return not {run.name for run in held.runs} <= {run.name for run in measured.runs}


def held_out(measured: Measured, held: Measured) -> str:
    """What was held out, in words."""
    if not measured.runs and len(held.curves) < len(measured.curves):
        return ", ".join(one.curve.name for one in held.curves)
    if not measured.runs:
        return f"every fourth stretch of {'each' if len(held.curves) > 1 else 'the'} curve"
    if not in_blocks(measured, held):
        return ", ".join(run.name for run in held.runs)
    length = float(np.median([np.ptp(run.time) for run in held.runs]))
    moving = all(_moves(held, Block(k, slice(None))) for k in range(len(held.runs)))
    return (
        f"{'every fourth' if len(held.runs) > 1 else 'one'} block of {length:.2g} s"
        f"{' in which the joint moves' if moving else ''}"
    )


def _cut(number: int, run: Run, length: float) -> list[Block]:
    """A run in blocks of about some length (s), of as many samples each."""
    n = len(run.time)
    most = max(n // SAMPLES, min(SETTINGS.adding.whole_runs, n // smoothing.MIN_SAMPLES), 1)
    count = int(np.clip(round(float(np.ptp(run.time)) / length), 1, most))
    edges = np.arange(count + 1) * n // count
    return [Block(number, slice(int(a), int(b))) for a, b in pairwise(edges)]


def _missed(measured: Measured, segments: Segments) -> NDArray[np.float64]:
    """By how much more than noise the model as it is misses the segments of each run: twice a
    negative log-likelihood, robustly; shape (runs,)."""
    estimator = SegmentEstimator(segments, segments.usable)
    simulator = joint_model_for(measured, segments.h).simulator(measured.profile, segments.h)
    of_noise = estimator.losses(segments.count.astype(float))
    more = estimator.losses(estimator.started(simulator).squares) - of_noise
    counted = np.where(estimator.counts, more, 0.0)
    return np.asarray(np.bincount(segments.run, counted, len(measured.runs)), float)


def _moves(measured: Measured, block: Block) -> bool:
    """Whether the joint moves in a block, where the force is known."""
    run = measured.runs[block.run].part(block.samples)
    known = run.position[~np.isnan(run.force)]
    least = TRAVEL * np.ptp(measured.profile.joint.range)
    enough = max(least, NOISES * measured.sigma[block.run])
    return len(known) >= smoothing.MIN_SAMPLES and bool(np.ptp(known) > enough)


def _between(measured: Measured, held: list[Block]) -> list[Block]:
    """What is left of the runs; pieces too short to be smoothed are not."""
    out = []
    for number, run in enumerate(measured.runs):
        own = [block.samples for block in held if block.run == number]
        edges = [0, *(edge for part in own for edge in (part.start, part.stop)), len(run.time)]
        pieces = (slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True))
        out += [Block(number, p) for p in pieces if p.stop - p.start >= smoothing.MIN_SAMPLES]
    return out


def _of(measured: Measured, blocks: list[Block]) -> Measured:
    """The joint with these blocks as its runs."""
    runs = []
    for block in blocks:
        run = measured.runs[block.run]
        part = run.part(block.samples)
        whole = len(part.time) == len(run.time)
        name = run.name if whole else f"{run.name} from {part.time[0]:.4g} s"
        runs.append(replace(part, name=name))
    return measured.with_runs(tuple(runs), [block.run for block in blocks])


def _parted_curves(measured: Measured) -> tuple[Measured, Measured]:
    curves, ways = measured.curves, (False, True)
    if len(curves) >= SETTINGS.adding.whole_runs:
        parts = [[one for k, one in enumerate(curves) if (k % 4 == 3) == way] for way in ways]
    else:
        parts = [[one.part(_held(one) == way) for one in curves] for way in ways]
    return measured.with_curves(parts[0]), measured.with_curves(parts[1])


def _held(curve: QuasiStaticComparison) -> Flags:
    """Which samples of a curve are held out, shape (n,)."""
    n = len(curve.direction)
    stretch = np.arange(n) * min(STRETCHES, max(n // STRETCH, SETTINGS.adding.whole_runs)) // n
    return np.asarray(stretch % 4 == 2)
