"""A ranking of what may be missing: scores, and what they say as evidence."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from joda.diagnosis.baseline import Baseline
from joda.diagnosis.hypothesis_fits import FittedHypothesis, price
from joda.diagnosis.selection import Evidence, Selection, decide
from joda.diagnosis.settings import SETTINGS, SelectionSettings
from joda.estimation.estimator import Fit, SegmentEstimator, excess


@dataclass(frozen=True)
class Ranking:
    """What may be missing from a model.

    Attributes:
        baseline: the model and its runs.
        candidates: the best one of each effect, the most likely first.
        level: mean square residual that counts as noise, 1 at least.
        n_effective: how many samples count.
        restitution: whether impacts tell of bouncier ends than the model's, and that is not tried.
    """

    baseline: Baseline
    candidates: tuple[FittedHypothesis, ...]
    level: float
    n_effective: float
    restitution: bool


def best_of_each(candidates: Iterable[FittedHypothesis]) -> list[FittedHypothesis]:
    """The best candidate of each effect, the lowest score first."""
    best: dict[str, FittedHypothesis] = {}
    for one in sorted(candidates, key=lambda g: g.score):
        best.setdefault(one.hypothesis.effect, one)
    return list(best.values())


def rescaled(estimator: SegmentEstimator, fit: Fit, level: float) -> float:
    """A fit's loss, with what its numbers lose by being off (and impacts), where noise is more."""
    beside = fit.loss - estimator.loss(fit.squares)
    return estimator.loss(fit.squares, level=level) + beside / level


def scored(
    estimator: SegmentEstimator, candidates: Sequence[FittedHypothesis]
) -> tuple[tuple[FittedHypothesis, ...], float, float]:
    """The best candidates, scored by what the best of them leaves in its better segments.

    Recorded noise is often less than all that a simulation cannot follow: clocks, forces, whatever
    else is a little wrong. Such a misfit is all of one piece within a segment, which then counts as
    one sample.

    Returns:
        the best one of each effect, the most likely first; the mean square residual that is
        noise; how many samples count.
    """
    samples = estimator.samples
    if not candidates or not samples:
        return (), 1.0, samples
    best = min(candidates, key=lambda g: g.fit.loss + g.cost).fit.squares
    each = (best / np.maximum(estimator.segments.count, 1))[estimator.counts]
    level = max(float(np.quantile(each, SETTINGS.selection.quiet_share)), 1.0)
    n_effective = (
        float(estimator.counts.sum()) if level > SETTINGS.selection.noise_square else samples
    )

    def each_scored(one: FittedHypothesis) -> FittedHypothesis:
        count = n_effective / samples
        cost = price(one.hypothesis, one.fit, n_effective, count / level)
        return replace(one, score=rescaled(estimator, one.fit, level) * count + cost)

    return tuple(best_of_each(map(each_scored, candidates))), level, n_effective


def evidence(ranking: Ranking) -> Evidence:
    """What the fits of a ranking leave."""
    estimator, fit, candidates = (
        ranking.baseline.estimator,
        ranking.baseline.fit,
        ranking.candidates,
    )
    samples = max(estimator.samples, 1.0)
    first = candidates[0] if candidates else None
    tolerant = estimator.loss(
        fit.squares, level=min(ranking.level, SETTINGS.selection.noise_square)
    )
    return Evidence(
        samples=estimator.samples,
        n_effective=ranking.n_effective,
        noisy=ranking.level > SETTINGS.selection.noise_square,
        restitution=ranking.restitution,
        model=ranking.baseline.excess,
        tolerant=excess(tolerant, samples),
        own=excess(rescaled(estimator, fit, ranking.level), samples),
        gain=_gain(ranking),
        misfit_tolerance=first.hypothesis.misfit_tolerance
        if first
        else SETTINGS.tolerances.known_law,
        effects=tuple(candidate.hypothesis.effect for candidate in candidates),
        left=tuple(
            excess(candidate.score, max(ranking.n_effective, 1.0)) for candidate in candidates
        ),
    )


def _gain(ranking: Ranking) -> float:
    """See `Evidence`: one segment may have been disturbed, by a hand that comes or goes."""
    estimator, fit = ranking.baseline.estimator, ranking.baseline.fit
    if not ranking.candidates:
        return 0.0
    first = ranking.candidates[0]
    gain = fit.loss - first.fit.loss - first.cost
    if (
        ranking.baseline.excess > 0
        or np.count_nonzero(estimator.counts) < SETTINGS.selection.few_segments
    ):
        return gain
    each = estimator.losses(fit.squares) - estimator.losses(first.fit.squares)
    return gain - max(float(each[estimator.counts].max()), 0.0)


def select(ranking: Ranking, strictness: float = 1.0, wholly: bool = False) -> Selection:
    """`decide` on a ranking's evidence."""
    return decide(evidence(ranking), strictness, wholly)


def hopeful(few: Ranking) -> bool:
    """Whether, by the best effects that are fitted, some might explain the runs."""
    return sum(select(few).probabilities) > SETTINGS.selection.promising


def shows(
    first: Ranking, longer: Baseline, settings: SelectionSettings = SETTINGS.selection
) -> bool:
    """Whether more than noise is left of longer segments, be noise what was taken for it or what
    the best candidate left of a first ranking's segments, for each degree of freedom."""
    if longer.excess > settings.longer_excess:
        return True
    best = min(
        (candidate.fit.loss for candidate in first.candidates), default=first.baseline.fit.loss
    )
    own, its = _freedom(longer.estimator), _freedom(first.baseline.estimator)
    return longer.fit.loss - best * own / its > settings.min_gain


def _freedom(estimator: SegmentEstimator) -> float:
    """Samples that count, less the two numbers of each segment's start."""
    return max(estimator.samples - 2 * float(estimator.counts.sum()), 1.0)
