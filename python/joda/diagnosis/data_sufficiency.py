"""Whether the measurements cover enough: samples, range, motion, both directions."""

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.settings import SETTINGS
from joda.estimation.problem import segments_for
from joda.estimation.segments import Integers, Segments
from joda.measured.curves import MIN_SAMPLES, TOO_LOUD, too_loud
from joda.measured.data_checks.timing import repeats
from joda.measured.measured_joint import Measured
from joda.measured.quasi_static import QuasiStaticComparison
from joda.measured.slow_runs import one_way, ways


def moved_one_way(measured: Measured) -> bool:
    """Whether the joint was moved in one direction only."""
    if not measured.runs:
        return one_way(np.sum([_samples(curve) for curve in measured.curves], axis=0))
    noise = SETTINGS.naming.reversal_noises * np.asarray(measured.sigma)
    pairs = zip(measured.runs, noise, strict=True)
    return one_way(np.sum([ways(run.position, width) for run, width in pairs], axis=0))


def _samples(curve: QuasiStaticComparison) -> NDArray[np.float64]:
    """How many are in positive and in negative direction."""
    return np.array([np.sum(curve.direction > 0), np.sum(curve.direction < 0)], float)


def hardly_moved(measured: Measured) -> str:
    """That hardly any of the range was visited, a sentence; nothing if that is not so."""
    logs = [*measured.runs] if measured.runs else [one.curve for one in measured.curves]
    visited = float(np.ptp(np.concatenate([log.position for log in logs])))
    if (
        share := visited / float(np.ptp(measured.profile.joint.range))
    ) < SETTINGS.naming.visited_range:
        what = "runs" if measured.runs else "curves"
        return f"The {what} visit only {100 * share:.1g} % of the joint's range."
    return ""


def at_rest(measured: Measured) -> str:
    """That no run moves the joint, as a clause; nothing if one does."""
    if not measured.runs or _moving(measured, segments_for(measured)):
        return ""
    return "the joint does not move in these runs, and at rest nothing tells how it moves"


def _moving(measured: Measured, segments: Segments) -> int:
    """In how many segments the joint moves by more than noise; where a coarse encoder makes that
    large for short segments, of how many such motions its runs consist."""
    far = SETTINGS.naming.motion_noises * max(measured.sigma)

    def motions(rows: Integers) -> int:
        own = rows[rows >= 0]
        return int(np.ptp(segments.position[own]) / far) if len(own) else 0

    usable = segments.usable
    many = sum(motions(row) > 0 for row in segments.rows[usable])
    runs = (usable & (segments.run == number) for number in np.unique(segments.run))
    return max(many, sum(motions(segments.rows[own]) for own in runs))


def too_little(measured: Measured) -> str:
    """Why a model that misses nothing may lack much, as a sentence; nothing if that is not so."""
    if why := hardly_moved(measured):
        return why
    segments = segments_for(measured)
    if not measured.runs:
        told = len(segments.position)
        return f"{told} samples are too few; record {MIN_SAMPLES}." if told < MIN_SAMPLES else ""
    if repeats(measured.runs):
        return "Positions repeat while the joint moves, so that what was taken for noise is motion."
    needed = SETTINGS.naming.motions
    if (moving := _moving(measured, segments)) < needed:
        return (
            f"The joint moves in {moving} segments of {segments.length:.2g} s; {needed} are needed."
        )
    return ""


def too_noisy(measured: Measured) -> str:
    """Why curves that show nothing beyond their noise clear nothing; nothing if they do."""
    loud = not measured.runs and any(map(too_loud, measured.curves))
    return f"{TOO_LOUD[0].upper()}{TOO_LOUD[1:]}" if loud else ""
