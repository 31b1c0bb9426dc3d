"""Finds which numbers of a joint's body and of its measurement are off, if these explain the runs.

All are set free at once, each with a prior whose width is how far off it usually is, or as told;
then one after the other is held again, as long as the runs do not miss it. What an effect explains
as well, with less of a surprise, is left to it.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.applied_corrections import AppliedCorrections, applied_corrections
from joda.diagnosis.baseline import Baseline, fit_baseline
from joda.diagnosis.correction_report import correction_of
from joda.diagnosis.findings import Correction
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.hypothesis_fits import FittedHypothesis, joined
from joda.diagnosis.settings import SETTINGS
from joda.estimation.base_model import BASE_STD, BaseModel
from joda.estimation.estimator import CAUCHY_SCALE, Fit, SegmentEstimator, excess
from joda.estimation.nuisance import (
    NuisanceName,
    Nuisances,
    nuisances_of,
    with_numbers,
    zeros_at_ends,
)
from joda.estimation.problem import posed, segments_for
from joda.measured.instability import longest_followed
from joda.measured.measured_joint import Measured

Array = NDArray[np.float64]

ALSO_AN_EFFECT: NuisanceName = "force_offset"
"""A number in whose place an effect always explains as much: a constant force."""
ONE_RATIO: tuple[NuisanceName, ...] = ("mass", "force_scale")
"""Numbers of which one is told, unless the model's own resistances are said to be right."""
MIN_FACTOR = 1e-3
"""Below which a factor of the model's own strengths counts as that."""
LONGEST = 1.5
"""Length of the segments in which numbers are fitted at last, s."""
BETWEEN = 0.04
"""Error of a delay, in samples: what the force is between two of them is not known."""
ZERO = 0.001
"""Error of a position's zero, in ranges: no better are the ends known, nor where gravity points."""
LEVEL, FIRST = 1e5, 8
"""Mean square residual from which a segment counts as its logarithm in the first iterations of some
fits, which then go where all segments are better, and how many these are."""
DRAWS = 6
"""Numbers that are drawn within their errors, to tell how far these move a run."""
HEAVIER = "added_inertia"
"""An effect that without gravity is a force of another scale but for what else resists: it is named
where it is any likelier."""


@dataclass(frozen=True)
class Calibration:
    """Numbers that explain runs better than a model as it is.

    Attributes:
        numbers: those that are off.
        fit: of the model with them.
        covariance: of their errors, as they are fitted, shape (k, k).
        loss: with the price of the numbers.
        alone: whether they leave nothing that an effect would explain better.
        others: of each number, those that the data cannot tell from it, with their values.
    """

    numbers: Nuisances
    fit: Fit
    covariance: Array
    loss: float
    alone: bool
    others: tuple[tuple[tuple[NuisanceName, float], ...], ...]

    @property
    def names(self) -> tuple[NuisanceName, ...]:
        """Of the numbers."""
        return self.numbers.names

    @property
    def errors(self) -> Array:
        """Their standard errors, shape (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def sure(self) -> tuple[NuisanceName, ...]:
        """Those that are off by several of their errors."""
        return _surely_off(self.names, self._own, self.errors)

    @property
    def unusual(self) -> bool:
        """Whether one of them is further off than usually."""
        return bool((np.abs(self._widths) > SETTINGS.corrections.unusual).any())

    @property
    def cost(self) -> float:
        """What they cost, in loss: their price, and how unusual they are."""
        return self.loss - self.fit.loss + float(self._widths @ self._widths)

    @property
    def _widths(self) -> Array:
        """How far off they are, of how far off they usually are; shape (k,)."""
        return np.asarray(self._own / self.numbers.prior_stds)

    @property
    def _own(self) -> Array:
        """They, as they are fitted; shape (k,)."""
        return self.fit.x[len(self.fit.x) - len(self.names) :]

    @property
    def alternatives(self) -> list[list[NuisanceName]]:
        """Of each number, the names of those that the data cannot tell from it."""
        return [[name for name, _ in alike] for alike in self.others]

    def only(self, names: Sequence[NuisanceName]) -> "Calibration":
        """Some of the numbers, not fitted anew."""
        kept = [k for k, name in enumerate(self.names) if name in names]
        return replace(
            self,
            numbers=self.numbers.only(names),
            fit=replace(self.fit, x=self.numbers.taken(self.fit.x, names)),
            covariance=self.covariance[np.ix_(kept, kept)],
            others=tuple(self.others[k] for k in kept),
        )

    @property
    def applied(self) -> AppliedCorrections:
        """What is to be set right."""
        return self._applied(self.fit.x)

    def of(self, measured: Measured) -> Measured:
        """A joint and its runs with the numbers set right, which are known as well as that."""
        left = {
            str(name): float(error) for name, error in zip(self.names, self.errors, strict=True)
        }
        return replace(self.applied.of(measured), loose=left)

    def drawn(self) -> list[AppliedCorrections]:
        """The same with numbers that are as likely, within the errors of these."""
        rng, count = np.random.default_rng(0), len(self.names)
        off = rng.multivariate_normal(np.zeros(count), self.covariance, DRAWS, method="svd")
        strengths, own = np.split(self.fit.x, [len(self.fit.x) - count])
        return [self._applied(np.append(strengths, own + one)) for one in off]

    def _applied(self, x: Array) -> AppliedCorrections:
        return applied_corrections(
            {str(name): value for name, value in self.numbers.values(x).items()}
        )

    def beats(
        self, baseline: Baseline, candidates: Sequence[FittedHypothesis], clearly: bool
    ) -> bool:
        """Whether no effect explains as much, or each clearly less."""

        def least(of: FittedHypothesis) -> float:
            alike = SETTINGS.corrections.equal_numbers * (of.hypothesis.effect != HEAVIER)
            return (
                of.fit.loss + of.cost + (-SETTINGS.corrections.equal_numbers if clearly else alike)
            )

        return self.loss < min(map(least, candidates), default=baseline.fit.loss)

    def corrections(self, measured: Measured) -> tuple[Correction, ...]:
        """What is off, for the user.

        Args:
            measured: the joint as it was given.
        """
        values = self.numbers.values(self.fit.x).items()
        little = self.numbers.little(self.fit.x)
        rows = zip(values, self.errors, self.others, little, strict=True)
        return tuple(
            correction_of(measured, name, value, float(error), others)
            for (name, value), error, others, hardly in rows
            if not hardly or all(little)
        )


class Calibrator:
    """Finds numbers that are off; asked again of the same segments, it keeps its first fits."""

    def __init__(self, measured: Measured) -> None:
        """Of a joint and its runs."""
        self.measured = measured
        self._segments: SegmentEstimator | None = None
        self._fits: dict[tuple[NuisanceName, ...], Fit] = {}

    def numbers(self, baseline: Baseline, beside: bool = False) -> Calibration | None:
        """The numbers that are off; None where none is, or where they explain little.

        Args:
            baseline: the model fitted to the runs.
            beside: whether effects were looked for too, so that these can be compared; then the
                model as it is does not suffice, and numbers that are off by little count too.
        """
        search = self._search(baseline)
        if not self.measured.runs or not search.every.names:
            return None
        found = _calibrated(search, beside)
        if found and not beside and all(found.numbers.little(found.fit.x)):
            return None
        return _longer(self.measured, found) if found and found.alone else found

    def fitted(self, baseline: Baseline, names: Sequence[NuisanceName]) -> Array:
        """The model's strengths and the numbers of these names, fitted; shape (k,)."""
        return self._search(baseline).fitted(tuple(names)).x

    def _search(self, baseline: Baseline) -> "_Search":
        if self._segments is not baseline.estimator:
            self._segments, self._fits = baseline.estimator, {}
        every = nuisances_of(self.measured, baseline.base)
        return _Search(self.measured, baseline, every, self._fits)


def known_as_ratio(names: Collection[NuisanceName], base: BaseModel) -> tuple[NuisanceName, ...]:
    """Mass and force, if both may be off and only their ratio is known: both by one factor are the
    same motion, but for the model's own resistances, of which little is known."""
    known = np.any(base.unknowns.prior_std < BASE_STD)
    return ONE_RATIO if set(ONE_RATIO) <= set(names) and not known else ()


def _longer(measured: Measured, found: Calibration) -> Calibration:
    """The same fitted on in long segments, in which a small error shows; as it was where its
    numbers are others there."""
    longest = longest_followed(found.applied.of(measured), LONGEST)
    estimator, own = as_recorded(measured, found, longest)
    start = estimator.started(own.make(found.fit.x)).start
    fit = estimator.fit(own.make, own.unknowns, found.fit.x, start)
    moved = np.abs(fit.x - found.fit.x)[own.base.count :]
    if np.any(moved > SETTINGS.corrections.body_errors * found.errors):
        return found
    return replace(found, numbers=own, fit=fit)


def as_recorded(
    measured: Measured, found: Calibration, length: float
) -> tuple[SegmentEstimator, Nuisances]:
    """Runs as they were recorded in segments of a length (s), and a calibration's numbers there."""
    fitted = found.numbers.base
    segments = segments_for(measured, length, fine=fitted.accurate)
    estimator, base = posed(measured, segments, fitted.accurate, fitted.joint_model.friction_row)
    return estimator, replace(found.numbers, base=base)


def _calibrated(found: "_Search", beside: bool) -> Calibration | None:
    baseline, every = found.baseline, found.every
    whole, count = found.fitted(every.names), max(baseline.estimator.samples, 1.0)

    def little(first: float) -> bool:
        """Whether the numbers explain little of the loss without any."""
        all_of_it, left = (excess(x, count) * count if beside else x for x in (first, whole.loss))
        return (
            first - whole.loss < SETTINGS.corrections.body_gain
            or left > SETTINGS.corrections.max_loss_share * max(all_of_it, 0.0)
        )

    if little(found.at_most(()).loss) or little(first := found.fitted(()).loss):
        return None
    names, best = every.names, whole
    while names:
        fit, fewer = found.without_one(names, best, _spared(names, best))
        if fit.loss - best.loss > SETTINGS.corrections.number_loss:
            ratio = known_as_ratio(names, baseline.base)
            if not ratio or not found.calm(best.loss):
                break
            fit, fewer = found.without_one(names, best, ratio)
        best, names = fit, fewer
    best, names = found.exchanged(names, best, whole)
    if first - best.loss < SETTINGS.corrections.body_gain + found.price * len(names):
        return None
    own = every.only(names)
    widths = np.abs(best.x[baseline.base.count :]) / own.prior_stds
    off = dict(zip(names, widths, strict=True))
    unusual = {name for name in names if off[name] > SETTINGS.corrections.unusual}
    far = unusual & {ALSO_AN_EFFECT}
    if excess(best.loss, count) > SETTINGS.corrections.calm_excess:
        far |= {name for name in names if off[name] > SETTINGS.corrections.surprising}
    if unusual - far and _effect_instead(found, best, own, unusual):
        far |= unusual
    if far:  # they stand in for what is missing
        rest = tuple(name for name in every.names if name not in far)
        return _calibrated(replace(found, every=every.only(rest)), beside) if rest else None
    return _concluded(found, names, best, whole)


def _spared(names: tuple[NuisanceName, ...], fit: Fit) -> list[NuisanceName]:
    """Of a fit's numbers, those without which it is worse by least, as far as it is linear."""
    if fit.information is None:
        return list(names)
    k = len(names)
    needed = fit.x[-k:] ** 2 / np.diag(np.linalg.pinv(fit.information, hermitian=True))[-k:]
    most = SETTINGS.corrections.tried_loss * (needed.min() + SETTINGS.corrections.number_loss)
    return [name for name, loss in zip(names, needed, strict=True) if loss <= most]


@dataclass(frozen=True)
class _Search:
    """Fits of numbers to segments, in long steps.

    Attributes:
        measured: the joint and its runs.
        baseline: the model as it is, fitted.
        every: the numbers that may be off.
        fits, near_fits: that were made of some of them, by name; see `at_most`.
    """

    measured: Measured
    baseline: Baseline
    every: Nuisances
    fits: dict[tuple[NuisanceName, ...], Fit]
    near_fits: dict[tuple[NuisanceName, ...], Fit] = field(default_factory=dict)

    @property
    def price(self) -> float:
        """Of a number, in loss."""
        return float(np.log(max(self.baseline.estimator.samples, 2.0)))

    def exchanged(
        self, names: tuple[NuisanceName, ...], fit: Fit, whole: Fit
    ) -> tuple[Fit, tuple[NuisanceName, ...]]:
        """A fit and its numbers, or the likeliest with another number in the place of one: that was
        held while others could still stand in for it. `whole` is the fit of all numbers."""
        rest = [name for name in self.every.names if name not in names]
        if fit.loss - whole.loss < SETTINGS.corrections.tried_loss or not rest:
            return fit, names
        others = [
            tuple(one for one in self.every.names if one == other or (one in names and one != name))
            for name in names
            for other in rest
        ]
        fits = [self.near(instead, (self.every.names, whole)) for instead in others]
        pairs = [(fit, names), *zip(fits, others, strict=True)]
        return min(pairs, key=lambda pair: pair[0].loss)

    def calm(self, loss: float) -> bool:
        """Whether what a fit leaves is noise, or hardly anything of what the model leaves."""
        samples = max(self.baseline.estimator.samples, 1.0)
        left, before = excess(loss, samples), excess(self.baseline.fit.loss, samples)
        corrections = SETTINGS.corrections
        return left < max(corrections.calm_excess, corrections.calm_share * before)

    def without_one(
        self, names: tuple[NuisanceName, ...], fit: Fit, any_of: Sequence[NuisanceName]
    ) -> tuple[Fit, tuple[NuisanceName, ...]]:
        """The likeliest fit from another with one of its numbers less, and which are left."""
        fewer = [tuple(one for one in names if one != name) for name in any_of]
        fits = [self.near(left, (names, fit)) for left in fewer]
        return min(zip(fits, fewer, strict=True), key=lambda pair: pair[0].loss)

    def at_most(self, names: tuple[NuisanceName, ...]) -> Fit:
        """Some of the numbers, from the model as it was fitted, at once: no better than `fitted`,
        in half the time."""
        if names not in self.near_fits:
            self.near_fits[names] = self.near(names)
        return self.near_fits[names]

    def fitted(self, names: tuple[NuisanceName, ...]) -> Fit:
        """Some of the numbers, from the model as it was fitted and as it is."""
        if names not in self.fits:
            own, estimator = self.every.coarser().only(names), self._estimator
            none = np.append(self.baseline.base.unknowns.mean, np.zeros(len(names)))
            fits = [self.at_most(names), self._from(own, none, estimator.segments.start)]
            fits += self._with_zeros(own)
            refits = (estimator.refit(own.make, own.unknowns, one) for one in fits)
            self.fits[names] = min(refits, key=_loss)
        return self.fits[names]

    def _with_zeros(self, own: Nuisances) -> list[Fit]:
        """The same from where an end of the range is where the joint was stopped: until the
        position's zero is right, no small step of it changes where that happens."""
        if "position_offset" not in own.names:
            return []
        place = self.baseline.base.count + own.names.index("position_offset")
        estimator = self._estimator
        as_it_is = np.append(self.baseline.fit.x, np.zeros(len(own.names)))
        least = estimator.started(own.make(as_it_is)).loss - SETTINGS.corrections.number_loss
        fits = []
        for zero in zeros_at_ends(self.measured):
            x = as_it_is.copy()
            x[place] = np.clip(zero, own.unknowns.low[place], own.unknowns.high[place])
            begun = estimator.started(own.make(x))
            if begun.loss < least:
                fits.append(self._from(own, x, begun.start))
        return fits

    def near(
        self, names: Sequence[NuisanceName], near: tuple[Sequence[NuisanceName], Fit] | None = None
    ) -> Fit:
        """Some of the numbers, from those of another fit."""
        own = self.every.coarser().only(names)
        x, start = self.baseline.fit.x, self.baseline.fit.start
        if near is None:
            return self._from(own, np.append(x, np.zeros(len(names))), start)
        return self._from(own, self.every.only(near[0]).taken(near[1].x, names), near[1].start)

    @property
    def _estimator(self) -> SegmentEstimator:
        return self.baseline.estimator.coarser

    def _from(self, own: Nuisances, x: Array, start: Array) -> Fit:
        """From numbers and starts: at once, and such that segments that are far off count first."""
        estimator, fits = self._estimator, []
        for cauchy_scale in (LEVEL, CAUCHY_SCALE):
            first = estimator.fit(own.make, own.unknowns, x, start, FIRST, cauchy_scale)
            fits.append(estimator.fit(own.make, own.unknowns, first.x, first.start))
        return min(fits, key=_loss)


def _loss(fit: Fit) -> float:
    return fit.loss


def _effect_instead(
    found: _Search, fit: Fit, own: Nuisances, unusual: Collection[NuisanceName]
) -> bool:
    """Whether an effect that may be the same as one of the numbers is clearly likelier than those
    that are unusually far off, the others being free beside it."""
    widths = zip(own.names, own.prior_stds, strict=True)
    usual = {str(name): width for name, width in widths if name not in unusual}
    estimator = found.baseline.estimator
    model = fit_baseline(replace(found.measured, loose=usual), estimator.segments.length)
    least = min((one.fit.loss + one.cost for one in _equivalent(model)), default=np.inf)
    told = estimator.fit(own.make, own.unknowns, fit.x, fit.start).loss
    return bool(least < told + found.price * len(unusual) - SETTINGS.corrections.equal_numbers)


def _concluded(
    found: _Search, names: tuple[NuisanceName, ...], coarse: Fit, whole: Fit
) -> Calibration | None:
    """The numbers in usual steps, with their errors and what the data cannot tell from them."""
    baseline, estimator, every = found.baseline, found.baseline.estimator, found.every
    own = every.only(names)
    starts = (coarse.start, estimator.segments.start)
    fits = (estimator.fit(own.make, own.unknowns, coarse.x, start) for start in starts)
    fit = estimator.refit(own.make, own.unknowns, min(fits, key=_loss))
    errors = np.sqrt(np.diag(covariance(estimator, own, own, fit, [()] * len(names))))
    kept = _surely_off(names, fit.x[baseline.base.count :], errors)
    if kept != names:  # long steps asked for more
        fewer = replace(fit, x=own.taken(fit.x, kept))
        return _concluded(found, kept, fewer, whole) if kept else None
    loss = fit.loss + found.price * len(names)
    base = own.base
    off = np.log(np.maximum(fit.x[: base.count], MIN_FACTOR)) / base.unknowns.prior_std
    if "force_scale" in names and len(off):  # masses and strengths may all be off by one factor
        off = off - off.mean()
    usual = float(off @ off) < SETTINGS.corrections.surprising**2  # else something resists
    alone = (
        usual
        and found.calm(fit.loss)
        and not any(
            one.fit.loss + one.cost
            < loss - SETTINGS.corrections.equal_numbers * (one.hypothesis.effect != HEAVIER)
            for one in _equivalent(baseline)
        )
    )
    others = []
    for name in names:
        rest = tuple(one for one in names if one != name)
        swapped: list[tuple[NuisanceName, float]] = []
        for other in every.names:
            if other in names:
                continue
            instead = (*rest, other)
            tried = found.near(instead, (every.names, whole))
            if tried.loss < coarse.loss + SETTINGS.corrections.equal_numbers:
                swapped.append((other, every.only(instead).values(tried.x)[other]))
        if name == "force_scale" and "mass" not in every.names:  # then all but friction is as well
            swapped.append(("mass", 1 / own.values(fit.x)["force_scale"]))
        others.append(tuple(swapped))
    errors = covariance(estimator, own, every, fit, [[name for name, _ in one] for one in others])
    return Calibration(own, fit, errors, loss, alone, tuple(others))


def _surely_off(names: Sequence[NuisanceName], x: Array, errors: Array) -> tuple[NuisanceName, ...]:
    """Which of the numbers are off by several of their errors."""
    off = np.abs(x) > SETTINGS.corrections.body_errors * errors
    return tuple(name for name, one in zip(names, off, strict=True) if one)


def covariance(
    estimator: SegmentEstimator,
    own: Nuisances,
    every: Nuisances,
    fit: Fit,
    others: Sequence[Collection[str]],
    hypothesis: Hypothesis | None = None,
) -> Array:
    """Covariance of numbers, by the data and by how far off the others may be that are not free.

    Args:
        estimator: of the segments.
        own: the numbers.
        every: these and others that may be off.
        fit: of the model's strengths, these numbers, and those of an effect.
        others: of each number, its alternatives, that are not off as well.
        hypothesis: the effect; None without.

    Returns:
        shape (k, k).
    """
    rest = [name for name in every.names if name not in own.names]
    wider = replace(every.only((*own.names, *rest)), base=own.base)
    first, last = own.base.count, own.base.count + len(own.names)
    there = replace(fit, x=np.insert(fit.x, [last] * len(rest), 0.0))
    make, unknowns = wider.make, wider.unknowns
    if hypothesis:
        make, unknowns = joined(with_numbers(wider), hypothesis)
    # an end of an interval that no run came to is within its bounds, and no more is known of it
    prior_std = np.minimum(unknowns.prior_std, unknowns.high - unknowns.low)
    prior_std[first:last] = SETTINGS.corrections.untold_width
    precision = np.linalg.inv(estimator.covariance(make, unknowns, there, prior_std))

    def without(names: Collection[str]) -> Array:
        """Where these are not off."""
        left = [last + k for k, name in enumerate(rest) if name in names]
        kept = np.setdiff1d(np.arange(len(precision)), left)
        whole = np.linalg.inv(precision[np.ix_(kept, kept)])
        return np.asarray(whole[first:last, first:last])

    alone = without({name for names in others for name in names})
    variances = np.array([without(names)[k, k] for k, names in enumerate(others)])
    wider_by = np.sqrt(variances / np.diag(alone))
    floors = {
        "time_delay": BETWEEN * float(np.median(np.diff(estimator.segments.time))),
        "position_offset": ZERO * float(np.ptp(own.base.profile.joint.range)),
    }
    least = [floors.get(one, 0.0) ** 2 for one in own.names]
    return np.outer(wider_by, wider_by) * alone + np.diag(least)


def _equivalent(baseline: Baseline) -> list[FittedHypothesis]:
    """The effects that may be the same as a number, fitted."""
    there = [one for one in baseline.hypotheses if one.like_a_number]
    return [baseline.refined(baseline.coarse(one)) for one in there]
