"""A hypothesis fitted together with the model's own strengths, from where it promises most."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh

from joda._core import JointSimulator
from joda.diagnosis.force_balance import balanced
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.settings import SETTINGS
from joda.estimation import simplex
from joda.estimation.base_model import BaseModel
from joda.estimation.estimator import (
    CAUCHY_SCALE,
    Fit,
    Linearization,
    Make,
    SegmentEstimator,
    excess,
)
from joda.estimation.unknowns import Unknowns
from joda.profile import Profile

Array = NDArray[np.float64]

MOVES = (0.1, 0.04, 0.015)
"""How far ends of intervals are moved on trial, in normalised position."""
TRIAL_STEPS = 10.0
"""How far other numbers are moved, in their steps."""
WIDE = 2.0
"""How far a search begins to look, in those."""
SEARCHED, SETTLING = 15, 4
"""Models that it tries for each number, and iterations that fit the starts of one."""
ITERATIONS = 4
"""Iterations after that."""
ROUGH = 3
"""Iterations in which segments that are far off count in full; as many again of the best trials."""
BEST = 3
"""How many trials of a hypothesis with many are fitted."""
MIN_DIFFERENCE = 0.06
"""How much these must differ in one of their numbers."""
STANDS_IN, SAME, PROBED = 5.0, 0.7, 0.05
"""Prior standard deviations by which a strength of the model is off that may stand in for a
hypothesis; the correlation of what both move from which it does; and the part of a trial's strength
by which that is told."""
FINEST = 3
"""How many times the places at which a size differs along the way become more."""
MAX_RESIDUAL = 10.0
"""Mean square residual of segments, in the median, from which a model's fit leads nowhere."""
MANY_SAMPLES = 4000
"""Samples that count as many: from there on, what was fitted first is hardly in the way."""


def joined(base: BaseModel, hypothesis: Hypothesis) -> tuple[Make, Unknowns]:
    """The model's factors and the hypothesis' numbers as one vector."""
    n = base.count
    written = lru_cache(maxsize=1)(lambda own: base.written(np.array(own)))

    def make(x: Array) -> JointSimulator:
        return base.with_profile(hypothesis.write(written(tuple(x[:n])), x[n:]), x)

    return make, base.unknowns.and_(hypothesis.unknowns)


@dataclass(frozen=True)
class FittedHypothesis:
    """A hypothesis, fitted.

    Attributes:
        hypothesis: what is missing.
        fit: of the model's factors and the hypothesis' numbers.
        score: its loss, and what its numbers cost.
        cost: of its numbers.
    """

    hypothesis: Hypothesis
    fit: Fit
    score: float
    cost: float

    @property
    def x(self) -> Array:
        """The hypothesis' numbers."""
        return self.fit.x[-len(self.hypothesis.unknowns.low) :]

    @property
    def vanished(self) -> bool:
        """Whether it is hardly there, no more than a simpler effect, or beyond the widest of its
        bounds: something else fits."""
        unknowns = self.hypothesis.unknowns
        least = 1.01 * unknowns.low[0] or SETTINGS.search.no_strength * unknowns.step[0]
        hardly = (
            self.hypothesis.misfit_tolerance != SETTINGS.tolerances.free_curve
            and least > 0
            and self.x[0] < least
        )
        return bool(hardly or unknowns.pressed(self.x) or not self.hypothesis.itself(self.x))

    def written(self, base: BaseModel) -> Profile:
        """The model's profile with the effect."""
        return self.hypothesis.write(base.written(self.fit.x), self.x)


@dataclass(frozen=True)
class InitialPoint:
    """The model without a hypothesis, from where that is fitted.

    Attributes:
        fit: of the model's factors.
        cauchy_scale: mean square residual from which a segment counts as its logarithm at first.
        about: the model there, linear.
    """

    fit: Fit
    cauchy_scale: float
    about: Linearization


def initial_points(
    estimator: SegmentEstimator, base: BaseModel, given: Fit, fit: Fit
) -> tuple[InitialPoint, ...]:
    """From the model as it was fitted, and of few samples as it was given, where that is far off.

    A factor that is far off may stand in for what is missing; many samples lead back from there.
    """
    far = estimator.samples < MANY_SAMPLES and np.any(
        np.abs(fit.x - given.x) > SETTINGS.search.stand_in
    )
    fits = [fit, given] if far else [fit]
    wide = [CAUCHY_SCALE * usual(estimator, one) for one in fits]
    return tuple(
        InitialPoint(
            one,
            cauchy_scale,
            estimator.linear(base.simulator, base.unknowns, one.x, one.start, cauchy_scale),
        )
        for one, cauchy_scale in zip(fits, wide, strict=True)
    )


def screened(
    estimator: SegmentEstimator, base: BaseModel, point: InitialPoint, hypothesis: Hypothesis
) -> list[Array]:
    """The most promising trials, by the gain that a small strength promises."""
    if len(hypothesis.trials) == 1:
        return list(hypothesis.trials)
    segments, fit, about = estimator.segments, point.fit, point.about
    profile = base.written(fit.x)
    H, gradient = about.normal()
    H = H + base.unknowns.known
    gains, out = [], []
    for trial in hypothesis.trials:
        simulator = base.with_profile(hypothesis.write(profile, trial), fit.x)
        d = (segments.residuals(segments.misfit(simulator, fit.start)) - about.r)[:, :, None]
        across = about.products(d, about.J)[0]
        taken = (
            np.linalg.solve(H, np.stack([gradient, across], axis=1)) if len(H) else np.zeros((0, 2))
        )
        slope = (
            about.products(about.r[:, :, None], d, about.z[:, :, None])[0, 0] - across @ taken[:, 0]
        )
        curvature = about.products(d, d)[0, 0] - across @ taken[:, 1]
        amount = -slope / max(curvature, 1e-12)
        gains.append(slope**2 / max(curvature, 1e-12) if amount > 0 else 0.0)
        first = trial.copy()
        first[0] = np.clip(
            trial[0] * np.clip(amount, 0.3, 300.0),
            hypothesis.unknowns.low[0],
            hypothesis.unknowns.high[0],
        )
        out.append(first)
    if len(out) <= BEST + 1:
        return out
    order = np.argsort(gains)[::-1]
    chosen: list[int] = []
    for k in order:
        if len(chosen) == BEST:
            break
        apart = [
            np.abs(hypothesis.trials[k] - hypothesis.trials[c])[1:].max(initial=0.0) for c in chosen
        ]
        if min(apart, default=1.0) > MIN_DIFFERENCE:
            chosen.append(int(k))
    return [out[k] for k in chosen]


def in_place_of_a_factor(
    estimator: SegmentEstimator, base: BaseModel, point: InitialPoint, hypothesis: Hypothesis
) -> list[Array]:
    """Where a strength of the model that is far off stands in for the hypothesis, as more friction
    does for another friction: numbers with that strength as it is given, and as much of the
    hypothesis in its place."""
    own, x, about = base.unknowns, point.fit.x, point.about
    if not (far := np.abs(x - own.mean) / own.prior_std).any() or far.max() < STANDS_IN:
        return []
    k, trial = int(np.argmax(far)), hypothesis.trials[0].copy()
    trial[0] *= PROBED
    simulator = base.with_profile(hypothesis.write(base.written(x), trial), x)
    segments = estimator.segments
    d = (segments.residuals(segments.misfit(simulator, point.fit.start)) - about.r)[:, :, None]
    J = about.J[:, :, k : k + 1]
    square, across, other = (float(about.products(*p)[0, 0]) for p in ((d, d), (d, J), (J, J)))
    if not across**2 > SAME**2 * square * other or not (amount := (x - own.mean)[k] * across) > 0:
        return []
    trial[0] = np.clip(
        trial[0] * amount / square, hypothesis.unknowns.low[0], hypothesis.unknowns.high[0]
    )
    given = np.where(np.arange(len(x)) == k, own.mean, x)
    return [np.concatenate([given, trial])]


def coarse(
    estimator: SegmentEstimator,
    base: BaseModel,
    points: Sequence[InitialPoint],
    hypothesis: Hypothesis,
) -> tuple[Fit, ...]:
    """The hypothesis fitted roughly: from each begin, its most promising trials."""
    make, unknowns = joined(base, hypothesis)

    def best(point: InitialPoint, trials: Sequence[Array], kept: int) -> list[Fit]:
        starts = [np.concatenate([point.fit.x, x]) for x in trials]
        starts += in_place_of_a_factor(estimator, base, point, hypothesis)
        wide = point.cauchy_scale
        fits = [estimator.fit(make, unknowns, x, point.fit.start, ROUGH, wide) for x in starts]
        ahead = sorted(fits, key=lambda fit: fit.loss)[:kept]
        fits = [estimator.fit(make, unknowns, fit.x, fit.start, ROUGH, wide) for fit in ahead]
        return [
            replace(fit, loss=estimator.loss(fit.squares) + unknowns.penalty(fit.x)) for fit in fits
        ]

    found = [
        fit
        for point in points
        for fit in best(point, screened(estimator, base, point, hypothesis), hypothesis.kept)
    ]
    segments, first = estimator.segments, points[0]
    if usual(estimator, first.fit) >= MAX_RESIDUAL and segments.pushed:
        given = replace(first.fit, x=base.unknowns.mean, start=segments.start)
        near = balanced(segments, base.profile, base.joint_model, hypothesis)
        found += best(replace(first, fit=given), near, 1)
    return tuple(found)


def found_before(
    estimator: SegmentEstimator,
    base: BaseModel,
    found: Sequence[FittedHypothesis],
    hypothesis: Hypothesis,
) -> list[Fit]:
    """The hypothesis fitted roughly from where it was found before: beside other numbers of the
    body and of the measurement, or in other segments."""
    make, unknowns = joined(base, hypothesis)
    own = len(base.places)
    fits = []
    for one in found:
        same = one.hypothesis.effect, one.hypothesis.direction, len(one.x)
        if same == (hypothesis.effect, hypothesis.direction, len(hypothesis.unknowns.low)):
            strengths = np.append(one.fit.x[:own], base.unknowns.mean[own:])
            x = np.append(strengths, one.x)
            fits.append(estimator.fit(make, unknowns, x, estimator.started(make(x)).start, ROUGH))
    return fits


def refined(
    estimator: SegmentEstimator,
    base: BaseModel,
    hypothesis: Hypothesis,
    near: Sequence[Fit],
    worth: float = np.inf,
) -> FittedHypothesis:
    """The hypothesis fitted to the end, from rough fits; where it is pressed against a bound that
    is only usual, within wider ones again. One that promises no less loss than is worth it is left
    as it is."""
    make, unknowns = joined(base, hypothesis)
    fits = [estimator.fit(make, unknowns, fit.x, fit.start, worth=worth) for fit in near]
    if (least := min(fits, key=lambda fit: fit.loss)).loss > worth:
        return scored(estimator, hypothesis, least)
    fits = [estimator.refit(make, unknowns, fit) for fit in fits]
    found = scored(estimator, hypothesis, min(fits, key=lambda f: f.loss))
    wider = hypothesis.unknowns.widened()
    if not hypothesis.unknowns.pressed(found.x) or wider is hypothesis.unknowns:
        found = _free(estimator, base, found)
        return found if hypothesis.factors else uneven(estimator, base, found, steps=1)
    return refined(estimator, base, replace(hypothesis, unknowns=wider), [found.fit])


def uneven(
    estimator: SegmentEstimator, base: BaseModel, found: FittedHypothesis, steps: int = FINEST
) -> FittedHypothesis:
    """The candidate with a size that differs along the way, where it leaves more than noise as it
    is and much less so, and that is worth its numbers: else factors would only be bent to whatever
    else is missing.

    Args:
        estimator, base: what is fitted to.
        found: the candidate.
        steps: how many times the places at which the size differs may become more.
    """
    samples, tried = estimator.samples, [found]
    more = max(
        SETTINGS.selection.uneven_loss, SETTINGS.selection.noise_stds * float(np.sqrt(2 * samples))
    )  # noise is not known better
    for _ in range(steps):
        last = tried[-1]
        finer = last.hypothesis.uneven
        if finer is None or samples * excess(last.fit.loss, samples) < more:
            break
        own, factors = np.split(last.fit.x, [len(last.fit.x) - last.hypothesis.factors])
        x = np.append(own, np.zeros(finer.factors))
        if len(factors):
            there, here = (np.linspace(0, 1, one.factors) for one in (last.hypothesis, finer))
            x[len(own) :] = np.interp(here, there, factors)
        tried.append(refined(estimator, base, finer, [replace(last.fit, x=x)]))
    least = min(tried, key=lambda one: one.score)
    much = SETTINGS.search.uneven_share * excess(found.fit.loss, samples)
    return least if excess(least.fit.loss, samples) < much else found


def beside(hypothesis: Hypothesis, found: FittedHypothesis) -> Hypothesis:
    """One with a place, to be tried where another was found, and twice as far to either side."""
    low, high = found.x[-2:]
    wide = high - low
    longer = (low, min(high + wide, 1.0)), (max(low - wide, 0.0), high)
    return hypothesis.placed([(low, high), *longer])


def perturbed(
    estimator: SegmentEstimator, base: BaseModel, found: FittedHypothesis
) -> FittedHypothesis:
    """The candidate after its numbers were tried elsewhere: a fit does not see across an edge that
    few segments cross, nor past a speed at which the joint begins to stick. What is uneven is so as
    finely as is worth it."""
    if found.hypothesis.factors:
        found = uneven(estimator, base, found)
    make, unknowns = joined(base, found.hypothesis)
    best = found.fit
    n = len(best.x)
    first = base.count
    places = [(k, by) for by in MOVES for k in range(n - found.hypothesis.ends, n)]
    own = n - found.hypothesis.ends - found.hypothesis.factors
    shapes = [(k, TRIAL_STEPS * unknowns.step[k]) for k in range(first, own)]
    for k, by in places + shapes:
        for way in (-by, by):
            x = best.x.copy()
            x[k] += way
            trial = estimator.fit(make, unknowns, x, best.start, ITERATIONS, worth=best.loss)
            if trial.loss < best.loss - SETTINGS.search.equal_loss:
                best = estimator.fit(make, unknowns, trial.x, trial.start)
    return _free(
        estimator, base, scored(estimator, found.hypothesis, estimator.refit(make, unknowns, best))
    )


def _free(
    estimator: SegmentEstimator, base: BaseModel, found: FittedHypothesis
) -> FittedHypothesis:
    """The candidate off the bounds that its numbers are pressed against, if it is as good there."""
    hypothesis = found.hypothesis
    if not hypothesis.unknowns.pressed(found.x):
        return found
    make, unknowns = joined(base, replace(hypothesis, unknowns=hypothesis.unknowns.inside()))
    fit = estimator.fit(make, unknowns, found.fit.x, found.fit.start)
    return (
        scored(estimator, hypothesis, fit)
        if fit.loss < found.fit.loss + SETTINGS.search.equal_loss
        else found
    )


def simplex_searched(
    estimator: SegmentEstimator, base: BaseModel, found: FittedHypothesis
) -> FittedHypothesis:
    """The candidate after a search without derivatives, in which every segment's start is fitted
    anew: where a joint sticks and slips, the loss is jagged."""
    make, unknowns = joined(base, found.hypothesis)
    scale, k = TRIAL_STEPS * unknowns.step, len(unknowns.step)

    def at(z: Array) -> Array:
        return np.clip(found.fit.x + scale * z, unknowns.low, unknowns.high)

    def loss(z: Array) -> float:
        return estimator.started(make(at(z)), SETTLING).loss + unknowns.penalty(at(z))

    x = at(simplex.least(loss, np.zeros(k), WIDE, SEARCHED))
    fit = estimator.refit(
        make, unknowns, estimator.fit(make, unknowns, x, estimator.started(make(x)).start)
    )
    return scored(estimator, found.hypothesis, min(found.fit, fit, key=lambda one: one.loss))


def scored(estimator: SegmentEstimator, hypothesis: Hypothesis, fit: Fit) -> FittedHypothesis:
    """A fit of a hypothesis, with what its numbers cost."""
    cost = price(hypothesis, fit, estimator.samples)
    return FittedHypothesis(hypothesis, fit, fit.loss + cost, cost)


def price(hypothesis: Hypothesis, fit: Fit, samples: float, share: float = 1.0) -> float:
    """What a hypothesis and its numbers cost, in loss.

    Twice the logarithm of how much the data narrow the numbers, from their bounds and what is known
    of them (Laplace's method: Kass and Raftery 1995, eq. 5), along each principal axis at most
    that of BIC, ln(samples): what the data do not tell of costs nothing.

    Args:
        hypothesis: of how rare an effect, and what numbers.
        fit: of them, the last ones; as for BIC where it made no step.
        samples: how many count.
        share: of what the fit's samples tell, what counts.
    """
    own, k = hypothesis.unknowns, len(hypothesis.unknowns.low)
    most = float(np.log(max(samples, 2.0)))
    if fit.information is None:
        return hypothesis.neg_log_prior + k * most
    base, across = fit.information[:-k, :-k], fit.information[:-k, -k:]
    told = fit.information[-k:, -k:] - own.known
    told -= across.T @ np.linalg.pinv(base, hermitian=True) @ across
    before = own.known + np.diag(12 / (own.high - own.low) ** 2)  # of a uniform distribution
    narrowed = eigvalsh(before + share * told, before)
    return hypothesis.neg_log_prior + float(np.log(np.maximum(narrowed, 1.0)).clip(max=most).sum())


def usual(estimator: SegmentEstimator, fit: Fit) -> float:
    """Mean square residual of the segments, in the median; at least 1."""
    each = (fit.squares / np.maximum(estimator.segments.count, 1))[estimator.counts]
    return max(float(np.median(each)), 1.0) if len(each) else 1.0
