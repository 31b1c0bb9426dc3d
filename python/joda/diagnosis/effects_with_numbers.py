"""Effects with all numbers of the body and of the measurement free beside them.

A number that is off and an effect that is missing can hide one another: alone neither explains the
runs, or another effect does that has more numbers of its own. Every effect is asked with all
numbers free; of the best, only those numbers are kept that are needed.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from joda.diagnosis.baseline import Baseline, fit_baseline
from joda.diagnosis.calibration import ALSO_AN_EFFECT, Calibration, Calibrator, covariance
from joda.diagnosis.hypothesis_fits import FittedHypothesis, joined, scored
from joda.diagnosis.plausible import Needs
from joda.diagnosis.ranking import Ranking, hopeful, select
from joda.diagnosis.search import Progress, rank
from joda.diagnosis.settings import SETTINGS
from joda.estimation.base_model import BaseModel
from joda.estimation.estimator import Fit, SegmentEstimator
from joda.estimation.nuisance import (
    CorrectedBase,
    NuisanceName,
    Nuisances,
    nuisances_of,
    with_numbers,
)
from joda.measured.measured_joint import Measured

NEAR = 3
"""Of how many effects, the likeliest, the numbers that are needed are sought."""

PARTS: tuple[NuisanceName, ...] = ("force_scale", "inertia", "gravity")
"""Numbers that are not asked beside a mass: `added_inertia` and `gravity_offset` are the effects of
the same."""
CONSTANT = "constant_positive_conservative_hinge", "constant_negative_conservative_hinge"
"""Constant forces in either direction."""
AT_END, WIDEST_EDGE = 0.05, 0.45
"""How far from an end of the range an interval may end that reaches it; the most of an interval
that an edge of it may be."""
Names = tuple[NuisanceName, ...]


class WithNumbers:
    """Effects with the numbers that may be off beside them free, of one joint and its runs."""

    def __init__(
        self,
        calibrator: Calibrator,
        without: Baseline,
        exclude: Collection[str],
        progress: Progress,
    ) -> None:
        """Of a joint as it was given, and its model.

        Args:
            calibrator: of the joint.
            without: its model, fitted without numbers.
            exclude: effects that are not considered.
            progress: how much is done, of how much, and what.
        """
        self.calibrator, self.without, self.measured = calibrator, without, calibrator.measured
        self.every = _numbers(self.measured, without.base)
        self.exclude, self.progress = exclude, progress

    @cached_property
    def baseline(self) -> Baseline:
        """The model fitted with all of the numbers."""
        return self._freed(self.every)

    @property
    def _offset_unusual(self) -> bool:
        """Whether with all numbers free the force's offset is further off than usually."""
        x = self.baseline.fit.x[self.without.base.count :]
        own = dict(zip(self.every.names, x / self.every.prior_stds, strict=True))
        return bool(abs(own.get(ALSO_AN_EFFECT, 0.0)) > SETTINGS.corrections.unusual)

    def _freed(self, numbers: Nuisances) -> Baseline:
        own = zip(numbers.names, numbers.prior_stds, strict=True)
        free = replace(self.measured, loose={str(name): std for name, std in own})
        return fit_baseline(free, near=self.calibrator.fitted(self.without, numbers.names))

    @property
    def explain_most(self) -> bool:
        """Whether they explain most of what the model leaves without."""
        if not self.every.names or self.without.only_noise:
            return False
        return self.baseline.excess < SETTINGS.corrections.max_loss_share * self.without.excess

    def help(self, ranking: Ranking) -> bool:
        """Whether beside a ranking's best effect clearly less is left with them."""
        if not ranking.candidates or not self.every.names:
            return False
        best = ranking.candidates[0]
        without = _Beside(ranking, self.every, best, (), best.fit)
        free = without.freed(self.every.names)
        return bool(free.fit.loss < best.fit.loss - SETTINGS.corrections.number_loss)

    def likeliest(self) -> tuple[Calibration | None, Baseline] | None:
        """The numbers that are off beside the likeliest effect, None where none is, and the model
        with these set right, whose hypotheses begin where effects were found; None if no effect is
        likelier than not.

        Where the force has an offset that is unusual, or beside a force over position, such forces
        are asked once more without: one over a part of the range is an offset and its opposite over
        the rest, and over all of it an offset.
        """
        if not self.every.names:
            return None
        best = self._asked(self.baseline, self.exclude)
        if self._offset_unusual or (
            best and ALSO_AN_EFFECT in best.names and best.effect.hypothesis.like_a_number
        ):
            opposite = _opposites(best) if best and ALSO_AN_EFFECT in best.names else []
            there = [one for one in (best, self._without_offset, *opposite) if one]
            best = min(there, key=lambda one: one.loss, default=None)
        if best is None:
            return None
        found = best.calibration(self.measured)
        right = found.of(self.measured) if found else self.measured
        return found, replace(fit_baseline(right), found=best.ranking.candidates)

    @property
    def _without_offset(self) -> "_Beside | None":
        """The likeliest force over position where the force has no offset."""
        usual = self.every.only([name for name in self.every.names if name != ALSO_AN_EFFECT])
        if not usual.names:
            return None
        free = self._freed(usual)
        others = {one.effect for one in free.hypotheses if not one.like_a_number}
        return self._asked(free, {*self.exclude, *others})

    def _asked(self, free: Baseline, exclude: Collection[str]) -> "_Beside | None":
        """The effect with which the numbers that it needs leave least, by their price."""
        possible = Needs(self.measured).allow
        ranking = rank(free, exclude, self.progress, hopeful, possible)
        if not select(ranking).likely:
            return None
        most = ranking.candidates[0].score + SETTINGS.corrections.number_loss
        near = [one for one in ranking.candidates[:NEAR] if one.score < most]
        return min((_needed(ranking, one) for one in near), key=lambda one: one.loss)


def _numbers(measured: Measured, base: BaseModel) -> Nuisances:
    """The numbers that may be off beside an effect; none where there are no runs. With a mass all
    is told in units of the force as it was recorded, and of its parts an effect tells."""
    every = nuisances_of(measured, base)
    apart = PARTS if "mass" in every.names else ()
    return every.only([name for name in every.names if measured.runs and name not in apart])


@dataclass(frozen=True)
class _Beside:
    """An effect fitted with some of the numbers that may be off.

    Attributes:
        ranking: in which it was fitted.
        every: the numbers that may be off.
        effect: that is missing.
        names: of the numbers that are free.
        fit: of the model's strengths, these numbers and those of the effect.
    """

    ranking: Ranking
    every: Nuisances
    effect: FittedHypothesis
    names: Names
    fit: Fit

    @property
    def estimator(self) -> SegmentEstimator:
        """Of the segments."""
        return self.ranking.baseline.estimator

    @property
    def price(self) -> float:
        """Of a number, in loss."""
        return float(np.log(max(self.estimator.samples, 2.0)))

    @property
    def loss(self) -> float:
        """With the price of the numbers and of the effect."""
        return self.fit.loss + self.price * len(self.names) + self.effect.cost

    def freed(self, names: Names) -> "_Beside":
        """With these numbers free: what is the same of others goes over to them, or to the
        effect."""
        make, unknowns = joined(with_numbers(self.every.only(names)), self.effect.hypothesis)
        own, effect = np.split(self.fit.x, [len(self.fit.x) - len(self.effect.x)])
        strengths, numbers = np.split(own, [self.every.base.count])
        there = dict(zip(self.names, numbers, strict=True))
        begins = [
            self.every.only(self.names).taken(own, names),
            np.append(strengths, [there.get(name, 0.0) for name in names]),
        ]
        fits = []
        for x in (np.append(begin, effect) for begin in begins):
            start = self.estimator.started(make(x)).start
            fits.append(self.estimator.fit(make, unknowns, x, start))
        best = min(fits, key=lambda fit: fit.loss)
        return replace(self, names=names, fit=self.estimator.refit(make, unknowns, best))

    def with_and_without(self, other: NuisanceName, name: NuisanceName) -> "_Beside":
        """With another number in the place of one."""
        kept = {*self.names, other} - {name}
        return self.freed(tuple(one for one in self.every.names if one in kept))

    def calibration(self, measured: Measured) -> Calibration | None:
        """The numbers of a joint as it was given, with their errors and what the data cannot tell
        from them; None where there are none."""
        if not self.names:
            return None
        own, base = self.every.only(self.names), self.every.base
        others = []
        for name in self.names:
            alike = []
            for other in (one for one in self.every.names if one not in self.names):
                tried = self.with_and_without(other, name)
                if tried.fit.loss < self.fit.loss + SETTINGS.corrections.equal_numbers:
                    value = self.every.only(tried.names).values(tried.fit.x)[other]
                    alike.append((other, value))
            others.append(tuple(alike))
        alternatives = [[name for name, _ in alike] for alike in others]
        errors = covariance(
            self.estimator,
            own,
            nuisances_of(measured, base),
            self.fit,
            alternatives,
            self.effect.hypothesis,
        )
        numbers = replace(self.fit, x=self.fit.x[: base.count + len(self.names)])
        loss = self.loss - self.effect.cost
        return Calibration(own, numbers, errors, loss, False, tuple(others))


def _needed(ranking: Ranking, effect: FittedHypothesis) -> _Beside:
    """An effect of a ranking with the numbers that it needs."""
    base = ranking.baseline.base
    assert isinstance(base, CorrectedBase)
    best = _Beside(ranking, base.nuisances, effect, base.nuisances.names, effect.fit)
    while best.names:
        fewer = (best.freed(tuple(one for one in best.names if one != name)) for name in best.names)
        least = min(fewer, key=lambda one: one.fit.loss)
        if least.fit.loss > best.fit.loss + SETTINGS.corrections.number_loss:
            break
        best = least
    return best


def _opposites(best: _Beside) -> list[_Beside]:
    """Constant forces over the rest of the range in place of one over a part and an offset."""
    effect = best.effect
    if effect.hypothesis.effect not in CONSTANT or not effect.hypothesis.ends:
        return []
    strength, edge, a, b = effect.x
    slope = edge * (b - a)  # one rises where the other falls
    rest = (b - slope, 1.0) if a < AT_END else (0.0, a + slope) if b > 1 - AT_END else None
    if rest is None:
        return []
    edge = min(slope / (rest[1] - rest[0]), WIDEST_EDGE)
    fit = replace(best.fit, x=np.append(best.fit.x[:-4], [strength, edge, *rest]))
    names = tuple(name for name in best.names if name != ALSO_AN_EFFECT)
    out = []
    for hypothesis in best.ranking.baseline.hypotheses:
        others = hypothesis.effect in CONSTANT and hypothesis.effect != effect.hypothesis.effect
        if others and len(hypothesis.unknowns.low) == len(effect.x):
            other = replace(best, effect=replace(effect, hypothesis=hypothesis), fit=fit)
            other = other.freed(names)
            out.append(replace(other, effect=scored(best.estimator, hypothesis, other.fit)))
    return out
