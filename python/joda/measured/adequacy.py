"""Whether a model is within the noise of what was measured: all of it, and without a pattern.

An all-clear is a claim on every run and every segment. It takes three things: each whole run and
each segment is missed by less than a stated multiple of the noise; the residual force of successive
segments has no pattern; and there is enough motion for a fault to show. A run where the scene does
not let the joint be is a fault whatever the replays say.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtr, ndtr

from joda.measured.data_checks.timing import repeats
from joda.measured.errors import MULTIPLE, Errors, Missed
from joda.measured.failing_intervals import FORCE, LENGTHS
from joda.measured.measured_joint import Measured
from joda.measured.runs import Run
from joda.measured.whiteness import drifts, free_parts, strays

Array = NDArray[np.float64]
Adequate = Literal["within_noise", "beyond_noise", "not_enough_data"]

CHANCE = 0.005
"""Probability, for a true model, of a pattern in the residual as clear as one that is told."""
SEGMENT_LENGTH = LENGTHS[0]
"""Length of the segments whose residual force may have a pattern, s."""
SAMPLES = 30
"""Fewest samples that tell anything."""
LOUD = 0.3
"""Share of the noise in a run's motion from which on nothing is cleared."""
MIN_SEGMENTS, MOVES = 4, 8.0
"""Fewest segments in which the joint moves by so many times the noise that tell anything."""


@dataclass(frozen=True)
class Adequacy:
    """Whether the model is within the noise of the runs.

    Attributes:
        verdict: within it; beyond it; or too few data to tell.
        run, segment: the whole run and the segment that are missed by most, those first that the
            measurement's own errors do not explain; None if there is none.
        pattern: probability that a true model leaves as clear a pattern of residual force (Wald and
            Wolfowitz's runs test and a sign test), or as large means of what is missed of a free
            run (`joda.measured.whiteness`), Bonferroni-corrected; None with too few segments.
        whole: whether all that acts on the joint in its scene is replayed, and all of the runs.
        loudness: the largest share of the noise in a run's motion, both RMS: from 0.3 on the noise
            may be motion between two samples.
        adrift: whether more is left of whole forced runs than noise of position and force makes.
        repeats: whether positions of a moving joint repeat, as of a sensor that is slower than its
            logger: what was taken for noise is motion.
        barred: where the scene would not have let the joint, a sentence; empty if nowhere: else the
            model is beyond the noise however well the rest is replayed.
    """

    verdict: Adequate
    run: Missed | None
    segment: Missed | None
    pattern: float | None
    whole: bool
    loudness: float
    adrift: bool
    repeats: bool
    barred: str


def adequacy(measured: Measured, found: Errors, rows: Array) -> Adequacy:
    """The verdict on a model.

    Args:
        measured: the joint and its runs.
        found: errors of their replays.
        rows: of `joda.measured.failing_intervals.window_rows`.
    """
    whole = [one for one in found.missed if one.time is None]
    pieces = [one for one in found.missed if one.time is not None]
    run, segment = (max(some, key=lambda one: one.order, default=None) for some in (whole, pieces))
    pattern = residual_pattern(rows)
    if pattern is not None:
        parts = free_parts(measured)
        left = [measured.replayer.followed(*part)[0] / part[1] for part in parts]
        pattern = min(1.0, 2 * min(pattern, drifts(parts, left)))
    samples = sum(len(run.time) for run in measured.runs)
    pairs = zip(measured.runs, measured.sigma, strict=True)
    loudness = max((_loudness(run, sigma) for run, sigma in pairs), default=0.0)
    repeating = repeats(measured.runs)
    complete = len(whole) == len(measured.runs) and bool(pieces)
    verdict: Adequate = "within_noise"
    if measured.barred:
        verdict = "beyond_noise"
    elif samples < SAMPLES or not found.missed:
        verdict = "not_enough_data"
    elif any(one.fault for one in found.missed) or (pattern is not None and pattern < CHANCE):
        verdict = "beyond_noise"
    elif (
        not (complete and measured.whole)
        or max(one.multiple for one in found.missed) >= MULTIPLE
        or loudness >= LOUD
        or repeating
        or pattern is None
        or _moving(measured) < MIN_SEGMENTS
    ):
        verdict = "not_enough_data"
    adrift = verdict == "within_noise" and strays(measured) < CHANCE
    return Adequacy(
        verdict="not_enough_data" if adrift else verdict,
        run=run,
        segment=segment,
        pattern=pattern,
        whole=measured.whole,
        loudness=loudness,
        adrift=adrift,
        repeats=repeating,
        barred=measured.barred,
    )


def _loudness(run: Run, sigma: float) -> float:
    """Share of a run's noise in how far its positions are spread."""
    return min(sigma / max(float(np.std(run.position)), 1e-300), 1.0)


def _moving(measured: Measured) -> int:
    """In how many segments of the runs the joint moves by clearly more than the noise."""
    count = 0
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        segment = ((run.time - run.time[0]) / SEGMENT_LENGTH).astype(int)
        first = np.flatnonzero(np.diff(segment, prepend=-1))
        travel = np.maximum.reduceat(run.position, first) - np.minimum.reduceat(run.position, first)
        count += int(np.sum(travel > MOVES * sigma))
    return count


def residual_pattern(rows: Array) -> float | None:
    """Probability of signs of the residual force as uneven as these, were the model true.

    Noise makes either sign as often, in each direction of motion, in any order: over time,
    position and velocity.

    Args:
        rows: of `joda.measured.failing_intervals.window_rows`, in the order of time.

    Returns:
        Bonferroni-corrected p-value of the runs tests (Wald and Wolfowitz, Ann. Math. Stat. 11
        (1940) 147) and sign tests; None for fewer than `MIN_SEGMENTS` segments.
    """
    force, force_error = rows[:, FORCE], rows[:, FORCE + 1]
    rows = rows[np.isfinite(force) & np.isfinite(force_error) & (force_error > 0) & (force != 0)]
    if len(rows) < MIN_SEGMENTS:
        return None
    sign = rows[:, FORCE] > 0
    values = [sign_test(sign[way]) for way in (rows[:, 2] > 0, rows[:, 2] < 0)]
    values += [
        runs_test(sign[np.argsort(key, kind="stable")])
        for key in (np.arange(len(rows)), rows[:, 0], rows[:, 1])
    ]
    return float(min(1.0, len(values) * min(values)))


def sign_test(sign: NDArray[np.bool_]) -> float:
    """Two-sided: as uneven a number of either sign by chance."""
    fewer = min(int(sign.sum()), int((~sign).sum()))
    return min(1.0, 2 * float(bdtr(fewer, len(sign), 0.5)))


def runs_test(sign: NDArray[np.bool_]) -> float:
    """One-sided, normal approximation: fewer runs of one sign than by chance."""
    n, a = len(sign), int(sign.sum())
    b = n - a
    if min(a, b) < 2:
        return 1.0
    runs = 1 + int(np.sum(sign[1:] != sign[:-1]))
    mean = 1 + 2 * a * b / n
    variance = (mean - 1) * (mean - 2) / (n - 1)
    return float(ndtr((runs + 0.5 - mean) / np.sqrt(variance))) if variance > 0 else 1.0
