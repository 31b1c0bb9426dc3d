"""Effects asked by whole runs, where segments show nothing beyond the noise and whole runs do.

Segments begin afresh from what was measured, and leave out where the joint rests at an end of its
range: of what is weak, or only acts there, as a latch, they tell little. A whole run is one segment
here, and goes on through the ends, which are those that suit the runs best.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import Baseline, fit_segments
from joda.diagnosis.free_runs import drawn_strengths, searched
from joda.diagnosis.ranking import Ranking
from joda.diagnosis.search import narrowed, searched_on
from joda.diagnosis.settings import SETTINGS
from joda.estimation.estimator import Fit
from joda.estimation.problem import segments_for
from joda.estimation.segments import Segments
from joda.measured.measured_joint import Measured
from joda.scenes.limits import Stops

Array = NDArray[np.float64]

NEARER = 1.0, 0.25, 0.06
"""Errors of what segments tell, in which whole runs are fitted from elsewhere, one after another.
"""


@dataclass(frozen=True)
class WholeRuns:
    """What whole runs say.

    Attributes:
        ranking: of the effects that were likeliest in segments.
        errors: standard errors of the model's own numbers, fitted without an effect, shape (k,): by
            the curvature of the loss, and by how far apart fits are that are as good but for what
            is left beyond noise. Of runs in which the joint sticks the loss is jagged, and tells
            less than its curvature says.
    """

    ranking: Ranking
    errors: Array


def in_whole_runs(measured: Measured, ranking: Ranking, stops: Stops | None) -> WholeRuns:
    """The best effects of a ranking, by whole runs.

    Args:
        measured: the joint and its runs.
        ranking: by segments of these.
        stops: ends of the range that suit the runs best; None: the model's.
    """
    there = measured.stopped(stops) if stops else measured
    whole = fit_segments(there, partial(_whole, there), ranking.baseline.fit.x)
    fits = _fits(whole, ranking.baseline)
    best = searched(whole.estimator, whole.base, min(fits, key=_loss))
    narrow = searched_on(narrowed(replace(whole, fit=best), ranking))
    found = narrow.baseline
    most = (
        found.fit.loss
        + SETTINGS.whole_runs.equal_loss
        + max(found.excess, 0.0) * found.estimator.samples
    )
    alike = np.array([one.x for one in fits if one.loss < most] + [found.fit.x])
    apart = np.abs(alike - found.fit.x).max(axis=0, initial=0.0)
    return WholeRuns(narrow, np.hypot(np.sqrt(np.diag(found.covariance)), apart))


def _fits(whole: Baseline, segments: Baseline) -> list[Fit]:
    """The model fitted to whole runs from strengths within the errors that segments leave, and
    nearer and nearer to the best of these."""
    estimator, base = whole.estimator, whole.base
    make, unknowns = base.simulator, base.unknowns
    off, best, fits = drawn_strengths(segments) - segments.fit.x, segments.fit.x, [whole.fit]
    for nearer in NEARER:
        tried = np.clip(best + nearer * off, unknowns.low, unknowns.high)
        fits += [estimator.fit(make, unknowns, x, estimator.started(make(x)).start) for x in tried]
        best = min(fits, key=_loss).x
    return fits


def _loss(fit: Fit) -> float:
    return fit.loss


def _whole(measured: Measured, *, fine: bool) -> Segments:
    """Each run as one segment, of which all counts; more where the model cannot follow one."""
    longest = max(float(np.ptp(run.time)) for run in measured.runs)
    return segments_for(measured, longest, fine, cut_at_ends=False)
