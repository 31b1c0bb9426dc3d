"""A model fitted to measured runs, and what it may lack, fitted together with it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.hypotheses import Hypothesis, hypotheses
from joda.diagnosis.hypothesis_fits import (
    FittedHypothesis,
    InitialPoint,
    coarse,
    found_before,
    initial_points,
    joined,
    perturbed,
    refined,
    scored,
    simplex_searched,
    uneven,
)
from joda.diagnosis.impacts import Impacts, Rebound, best_ratio, ends_of, impacts_at
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.units import units_of
from joda.estimation.base_model import BaseModel
from joda.estimation.estimator import Fit, SegmentEstimator, excess
from joda.estimation.nuisance import corrected_base
from joda.estimation.problem import posed, segments_for
from joda.estimation.segments import Segments
from joda.joints.joint_model import JointModel
from joda.measured.measured_joint import Measured
from joda.profile import Profile
from joda.scenes.native import Row

Array = NDArray[np.float64]


class Cut(Protocol):
    """Cuts runs into segments."""

    def __call__(self, *, fine: bool) -> Segments:
        """The segments; `fine`: as of `segments_of`."""


FINER = 4.0
"""Steps for one of the scene's, from which runs cannot tell that they were made in these."""
RESTITUTION = "end_stop_restitution"
"""Effect that only impacts tell of."""


@dataclass(frozen=True)
class Baseline:
    """A model fitted to measured runs, and what it may lack.

    Attributes:
        estimator: of the segments.
        base: the model as it is.
        given: the joint with its own ends of the range.
        fit: of its factors alone.
        initial_points: from where hypotheses are fitted.
        hypotheses: all of the catalogue.
        found: where effects were found before; these hypotheses are begun there too.
    """

    estimator: SegmentEstimator
    base: BaseModel
    given: JointModel
    fit: Fit
    initial_points: tuple[InitialPoint, ...]
    hypotheses: tuple[Hypothesis, ...]
    found: tuple[FittedHypothesis, ...] = ()

    @cached_property
    def covariance(self) -> Array:
        """Of the fitted factors, with what is left over as noise; shape (k, k)."""
        unknowns = self.base.unknowns
        return self.estimator.covariance(
            self.base.simulator, unknowns, self.fit, unknowns.prior_std
        )

    @property
    def excess(self) -> float:
        """Of the model as it is, per sample, beyond what noise makes."""
        return excess(self.fit.loss, max(self.estimator.samples, 1.0))

    @property
    def only_noise(self) -> bool:
        """Whether the model leaves no more of segments than noise makes."""
        return self.excess <= 0

    @cached_property
    def coarse_loss(self) -> float:
        """What the model leaves, fitted as roughly as hypotheses are at first."""
        estimator, base = self.estimator.coarser, self.base.coarser()
        return estimator.fit(base.simulator, base.unknowns, self.fit.x, self.fit.start).loss

    @cached_property
    def impacts(self) -> dict[int, Impacts]:
        """At each end that has some, -1 low and 1 high."""
        return impacts_at(self.estimator.segments, self.base, self.given)

    @cached_property
    def rebounds(self) -> dict[int, Rebound]:
        """What the impacts at each end tell of it, where the model is as it was fitted."""
        profile = self.base.written(self.fit.x)
        return {side: impacts.rebound(profile) for side, impacts in self.impacts.items()}

    def fit_hypothesis(self, hypothesis: Hypothesis) -> FittedHypothesis | None:
        """The hypothesis fitted; None if the data cannot tell of it."""
        if hypothesis.effect == RESTITUTION:
            return self._thrown_back(hypothesis)
        return self.refined(self.coarse(hypothesis))

    def restitution(
        self, ends: Sequence[Hypothesis], others: Sequence[Profile] = ()
    ) -> list[FittedHypothesis]:
        """The restitution of the ends that throw the joint back clearly faster than the model's do.

        Args:
            ends: an end that is bouncy, or both.
            others: what else the joint's profile may be: with all of them that must be so too.
        """
        sure = {
            side
            for side, own in self.rebounds.items()
            if own.clearly_larger
            and all(self.impacts[side].rebound(o).clearly_larger for o in others)
        }
        there = [self._thrown_back(end) for end in ends if sure.issuperset(ends_of(end))]
        return [candidate for candidate in there if candidate]

    def _thrown_back(self, hypothesis: Hypothesis) -> FittedHypothesis | None:
        """The restitution of an end, or both, by the impacts there; None if there are none."""
        ends = ends_of(hypothesis)
        if not (there := [self.rebounds[side] for side in ends if side in self.rebounds]):
            return None
        whole, unknowns = Rebound.together(there), hypothesis.unknowns
        ratio = best_ratio(whole, self.estimator.segments, self.base, ends)[0]
        x = np.append(self.fit.x, np.clip(ratio, unknowns.low, unknowns.high))
        return scored(
            self.estimator, hypothesis, replace(self.fit, x=x, loss=self.fit.loss - whole.gain)
        )

    def coarse(self, hypothesis: Hypothesis) -> "CoarseFit":
        """The hypothesis fitted roughly, in longer steps, to segments without impacts."""
        estimator, base = self.estimator.coarser, self.base.coarser()
        fits = coarse(estimator, base, self.initial_points, hypothesis)
        return CoarseFit(
            hypothesis, (*fits, *found_before(estimator, base, self.found, hypothesis))
        )

    def refined(self, found: "CoarseFit", worth: float = np.inf) -> FittedHypothesis:
        """The same fitted to the end, if that promises less loss than is worth it."""
        return refined(self.estimator, self.base, found.hypothesis, found.fits, worth)

    def coarse_scored(self, found: "CoarseFit") -> FittedHypothesis:
        """The same as it is, in usual steps."""
        make, unknowns = joined(self.base, found.hypothesis)
        x, start = found.best.x, found.best.start
        fit = self.estimator.fit(make, unknowns, x, start, iterations=0)
        return scored(self.estimator, found.hypothesis, fit)

    def uneven(self, found: FittedHypothesis) -> FittedHypothesis:
        """The candidate with a size that differs along the way, where that leaves much less."""
        return uneven(self.estimator, self.base, found)

    def perturbed(self, found: FittedHypothesis) -> FittedHypothesis:
        """The candidate with its numbers tried elsewhere."""
        return perturbed(self.estimator, self.base, found)

    def simplex_searched(self, found: FittedHypothesis) -> FittedHypothesis:
        """The candidate after a search without derivatives."""
        return simplex_searched(self.estimator, self.base, found)


@dataclass(frozen=True)
class CoarseFit:
    """A hypothesis fitted roughly, from one or more beginnings."""

    hypothesis: Hypothesis
    fits: tuple[Fit, ...]

    @property
    def best(self) -> Fit:
        """The best one."""
        return min(self.fits, key=lambda fit: fit.loss)


@dataclass(frozen=True)
class _Fitted:
    """A model's strengths fitted, and as they are given."""

    estimator: SegmentEstimator
    base: BaseModel
    fit: Fit
    given: Fit

    @property
    def loss(self) -> float:
        """Per sample: steps of another length cut segments a little differently."""
        return self.fit.loss / max(self.estimator.samples, 1.0)

    @property
    def left(self) -> float:
        """What is left beyond noise, per sample, be the model's own strengths as far off as they
        may."""
        loss = self.estimator.loss(self.fit.squares)
        return excess(loss, max(self.estimator.samples, 1.0))

    @property
    def calm(self) -> bool:
        """Whether hardly more than noise is left, so that nothing else is missing."""
        return self.left < SETTINGS.search.stepping_excess


def _fitted(
    measured: Measured,
    segments: Segments,
    near: Array | None,
    accurate: bool = True,
    row: Row | None = None,
) -> _Fitted:
    """The model in steps that stand for none or in MuJoCo's, with a row of friction that yields."""
    estimator, base = _posed(measured, segments, accurate, row)
    as_it_is = base.unknowns.mean
    given = estimator.begun(base.simulator, as_it_is)
    tried = [(as_it_is, segments.start), (as_it_is, given.start)]
    if near is not None:
        tried.append((near, estimator.started(base.simulator(near)).start))
    away = [estimator.begun(base.simulator, x) for x in base.beginnings()]
    tried += [(one.x, one.start) for one in away if one.loss < given.loss]
    fits = [estimator.fit(base.simulator, base.unknowns, x, start) for x, start in tried]
    fit = estimator.refit(base.simulator, base.unknowns, min(fits, key=lambda f: f.loss))
    return _Fitted(estimator, base, fit, given)


def _posed(
    measured: Measured, segments: Segments, accurate: bool, row: Row | None
) -> tuple[SegmentEstimator, BaseModel]:
    estimator, plain = posed(measured, segments, accurate, row)
    return estimator, corrected_base(plain, measured.loose)


def _may_be_so(
    measured: Measured, segments: Segments, accurate: bool, row: Row | None, usual: _Fitted
) -> bool:
    """Whether a first fit in such steps, with such a friction, from the strengths as they were
    fitted, leaves so little that more fits might leave hardly more than noise."""
    estimator, base = _posed(measured, segments, accurate, row)
    start = estimator.started(base.simulator(usual.fit.x)).start
    fit = estimator.fit(base.simulator, base.unknowns, usual.fit.x, start)
    return _Fitted(estimator, base, fit, fit).left < SETTINGS.search.stepping_tried


def _as_made(measured: Measured, cut: Cut, near: Array | None, usual: _Fitted) -> _Fitted:
    """The model as MuJoCo moves it, in the scene's steps, or with a friction that yields as its own
    does, where hardly more than noise is left then, and clearly less than of accurate steps that
    are as short; else as it was fitted."""
    segments = usual.estimator.segments
    if stepped := FINER * measured.timestep >= segments.h:
        segments = cut(fine=False)
    own = measured.own_row if measured.profile.channels.friction.components else None
    rows = (*((None,) if stepped else ()), *((own,) if own else ()))
    made = [
        _fitted(measured, segments, near, not stepped, row)
        for row in rows
        if _may_be_so(measured, segments, not stepped, row, usual)
    ]
    if not (calm := [one for one in made if one.calm]):
        return usual
    best = min(calm, key=lambda one: one.loss)
    alike = _fitted(measured, segments, near) if stepped else usual
    clearly = SETTINGS.search.stepping_gain / max(usual.estimator.samples, 1.0)
    return best if best.loss < min(usual.loss, alike.loss) - clearly else usual


def fit_baseline(
    measured: Measured, length: float | None = None, near: Array | None = None
) -> Baseline:
    """Fits the model's own strengths to all runs, or curves.

    Args:
        measured: the joint and its runs.
        length: of the segments, s; None: by the joint's pace.
        near: see `fit_segments`.
    """
    return fit_segments(measured, partial(segments_for, measured, length), near)


def fit_segments(measured: Measured, cut: Cut, near: Array | None = None) -> Baseline:
    """Fits the model's own strengths.

    Where the runs are clearly such as MuJoCo makes them, it is simulated in the scene's own steps,
    or its native friction yields as MuJoCo's own row does; else steps are accurate and friction
    holds, as the plugin's and as that of real joints.

    Args:
        measured: the joint and its runs.
        cut: the segments.
        near: factors of the strengths with which a fit begins besides, as other segments told
            them: in longer ones a model that is far off is fitted less easily.
    """
    found = _fitted(measured, cut(fine=True), near)
    if measured.runs:
        found = _as_made(measured, cut, near, found)
    estimator, base = found.estimator, found.base
    every = hypotheses(units_of(estimator.segments, measured), measured.templates, measured.profile)
    points = initial_points(estimator.coarser, base.coarser(), found.given, found.fit)
    return Baseline(estimator, base, measured.joint_model, found.fit, points, tuple(every))
