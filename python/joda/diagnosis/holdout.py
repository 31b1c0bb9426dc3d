"""Effects fitted on a part of the runs and judged on the rest."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import RESTITUTION, Baseline
from joda.diagnosis.hypothesis_fits import FittedHypothesis, joined
from joda.diagnosis.impacts import Rebound, ends_of
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.split import held_segments
from joda.estimation.estimator import CAUCHY_SCALE, Fit, Make, SegmentEstimator
from joda.estimation.segments import Segments
from joda.estimation.unknowns import Unknowns
from joda.measured.measured_joint import Measured
from joda.measured.misfit import rms

Array = NDArray[np.float64]


FOLDS = 4
"""In so many parts."""


class Holdout:
    """Fits on a part of the runs, judged on the rest; where that are few segments, or none that the
    model misses, or none that tells of an effect, every segment is held out of one of several fits
    (cross-validation)."""

    def __init__(self, baseline: Baseline, measured: Measured) -> None:
        """Holds segments out as `joda.diagnosis.split` does; of what these do not show, others."""
        self.baseline, self.floor = baseline, measured.floor
        counts = baseline.estimator.counts
        held = held_segments(measured, baseline.estimator.segments)
        self.folds = [counts & held]
        self._own = baseline.base.simulator, baseline.base.unknowns, baseline.fit
        self.before = self._error(*self._own, self.folds) if self.folds[0].any() else 0.0
        count = max(int(baseline.estimator.segments.count[self.folds[0]].sum()), 1)
        noise = self.floor * np.sqrt(1 + SETTINGS.naming.shown_errors * np.sqrt(2 / count))
        few = np.count_nonzero(self.folds[0]) < SETTINGS.naming.held_out_segments
        self.crosses = np.count_nonzero(counts) > 1 and (self.before < noise or few)
        if self.crosses:
            self.folds, self.before = self._crossed

    @cached_property
    def _crossed(self) -> tuple[list[NDArray[np.bool_]], float]:
        """Parts of all segments, and the error without an effect where each is held out once."""
        every = np.flatnonzero(counts := self.baseline.estimator.counts)
        parts = (every[k::FOLDS] for k in range(min(FOLDS, len(every))))
        folds = [np.isin(np.arange(len(counts)), part) for part in parts]
        return folds, self._error(*self._own, folds)

    def errors(self, found: FittedHypothesis) -> tuple[float, float]:
        """RMS misfit of the segments held out, rad or m, without the effect and with it; robust, so
        that no single one decides, in which the joint goes over a barrier or just not.

        Of the restitution of the ends, all impacts there tell, with the stiffness of a stop that
        suits them best; no other number is fitted to them.
        """
        if found.hypothesis.effect == RESTITUTION:
            rebounds, ends = self.baseline.rebounds, ends_of(found.hypothesis)
            impacts = Rebound.together([rebounds[side] for side in ends if side in rebounds])
            losses = np.array([impacts.own, impacts.losses.min()])
            before, with_it = _rms_of(losses / max(impacts.samples, 1.0), self.floor)
            return float(before), float(with_it)
        make, unknowns = joined(self.baseline.base, found.hypothesis)
        after = self._error(make, unknowns, found.fit, self.folds)
        if self.crosses or abs(after - self.before) > SETTINGS.naming.held_out_alike * self.before:
            return self.before, after
        folds, before = self._crossed
        return before, self._error(make, unknowns, found.fit, folds)

    @property
    def as_given(self) -> float:
        """The same of the model with its own numbers as they were given."""
        baseline = self.baseline
        given = replace(baseline.fit, x=baseline.base.unknowns.mean)
        own = baseline.estimator.segments, baseline.base.simulator, given
        return robust_rms(_misfit(*own, np.any(self.folds, axis=0)), self.floor)

    def _error(
        self, make: Make, unknowns: Unknowns, fit: Fit, folds: Sequence[NDArray[np.bool_]]
    ) -> float:
        estimator, missed = self.baseline.estimator, []
        for held in folds:
            train = replace(estimator, counts=estimator.counts & ~held)
            near = train.fit(make, unknowns, fit.x, fit.start, 6, updated=False)
            missed += _misfit(estimator.segments, make, near, held)
        return robust_rms(missed, self.floor)


def robust_rms(missed: Sequence[Array], noise: float) -> float:
    """RMS of the misfits of segments, each counting as in the loss of the fits; rad or m.

    Their mean squares s², in units of the noise, are averaged as log(1 + s²/c), with c from which
    the Cauchy loss bends; it is their RMS where all are alike, and less where few are much larger.

    Args:
        missed: of each segment its samples' misfits, rad or m.
        noise: standard deviation of a position, rad or m.

    Returns:
        rad or m; 0 where there is none.
    """
    if not any(map(len, missed)):  # nothing tells
        return 0.0
    scale = np.sqrt(CAUCHY_SCALE) * noise
    logs = [np.log1p((rms(one) / scale) ** 2) for one in missed]
    mean = np.average(logs, weights=[len(one) for one in missed])
    return float(_rms_of(CAUCHY_SCALE * mean, noise))


def _rms_of(loss: Array, noise: float) -> Array:
    """The same of a Cauchy loss per sample, or several."""
    return np.asarray(noise * np.sqrt(CAUCHY_SCALE * np.expm1(loss / CAUCHY_SCALE)))


def _misfit(segments: Segments, make: Make, fit: Fit, counts: NDArray[np.bool_]) -> list[Array]:
    """Misfits of some segments from their best starts, rad or m, but for what errors of the
    recorded force make of them."""
    simulator = make(fit.x)
    best = SegmentEstimator(segments, counts).started(simulator, near=fit.start)
    left = segments.residuals(segments.misfit(simulator, best.start))
    there = segments.rows >= 0
    return [left[k, there[k]] / segments.sharpness[k, there[k]] for k in np.flatnonzero(counts)]
