"""What may be missing, ranked: from a fit of every hypothesis to the best ones of each effect."""

from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from os import cpu_count
from typing import TypeVar

import numpy as np

from joda.diagnosis.baseline import RESTITUTION, Baseline, CoarseFit
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.hypothesis_fits import FittedHypothesis, beside, joined
from joda.diagnosis.ranking import Ranking, best_of_each, scored
from joda.diagnosis.settings import SETTINGS
from joda.estimation.estimator import SegmentEstimator
from joda.profile import Profile

SEARCH = SETTINGS.search

PERTURBED = 4
"""Of how many effects the numbers are tried elsewhere."""
QUICK = 1200
"""Samples up to which they are tried whatever their loss; of more, up to that part of the own."""
SEARCHED, FEW = 2, 8
"""Of how many effects they are searched without derivatives, and of how many numbers at most."""
NARROWED = 6
"""How many effects are looked at again in longer segments, where the first is not sure."""


Progress = Callable[[int, int, str], None]
A = TypeVar("A")
T = TypeVar("T", CoarseFit, FittedHypothesis)


def always(few: Ranking) -> bool:
    """Every ranking is promising."""
    return True


def rank(
    baseline: Baseline,
    exclude: Collection[str] = (),
    progress: Progress = lambda done, total, what: None,
    promising: Callable[[Ranking], bool] = always,
    possible: Callable[[Profile, str], bool] = lambda profile, effect: True,
) -> Ranking:
    """Fits every hypothesis to measured runs: all roughly, and the best effects to the end; the
    others too where these are promising.

    Args:
        baseline: the model and its runs.
        exclude: effects that are not tried.
        progress: told how many hypotheses are done, of how many, and the last one's name.
        promising: whether by the best few effects it is worth it to go on.
        possible: whether a profile with an effect can be meant.
    """
    tried = [h for h in baseline.hypotheses if h.effect not in {*exclude, RESTITUTION}]
    restitution = [h for h in baseline.hypotheses if h.effect == RESTITUTION]
    silent = RESTITUTION in exclude
    with ThreadPoolExecutor(cpu_count()) as pool:
        work = _Work(pool, progress, 2 * len(tried) + PERTURBED)
        candidates, rest = _roughly_fitted(baseline, tried, work)
        few = Ranking(baseline, *scored(baseline.estimator, candidates), restitution=False)
        if not promising(few):
            candidates += work.all(baseline.coarse_scored, rest)
        else:
            candidates += _fitted(baseline, candidates, rest, work)
            candidates += _beside(baseline, tried, candidates, work)
            candidates += _perturbed(baseline, candidates, work)
            candidates += _simplex_searched(baseline, candidates, work)
        baseline = _restarted(baseline, candidates)
        others = [one.written(baseline.base) for one in best_of_each(candidates)[:1]]
        ends = baseline.restitution(restitution, others)
        if not silent and not _shown_without_impacts(baseline, candidates):
            candidates += ends
    there = [
        one
        for one in candidates
        if not one.vanished and possible(one.written(baseline.base), one.hypothesis.effect)
    ]
    return Ranking(baseline, *scored(baseline.estimator, there), restitution=silent and bool(ends))


def narrowed(
    baseline: Baseline,
    before: Ranking,
    progress: Progress = lambda done, total, what: None,
) -> Ranking:
    """The best effects of a ranking again, fitted to longer segments from where they were found.

    Where one that left only noise of shorter segments leaves more of these, or falls behind one
    that was no better there, its numbers are tried elsewhere too: what goes over a barrier in one
    segment and not in another is no way for a fit.

    Args:
        baseline: the model and its runs in longer segments.
        before: the ranking.
        progress: told how many hypotheses are done, of how many, and the last one's name.
    """
    estimator = baseline.estimator
    tried = [g for g in before.candidates if g.hypothesis.effect != RESTITUTION][:NARROWED]

    def again(found: FittedHypothesis) -> FittedHypothesis:
        make, _ = joined(baseline.base, found.hypothesis)
        start = estimator.started(make(found.fit.x)).start
        return baseline.refined(CoarseFit(found.hypothesis, (replace(found.fit, start=start),)))

    def perturbed_if_stuck(pair: tuple[FittedHypothesis, FittedHypothesis]) -> FittedHypothesis:
        found, now = pair
        calm = _only_noise(found, before.baseline.estimator)
        fell = now.fit.loss > least.fit.loss + SEARCH.rough_gain and found.fit.loss < was.fit.loss
        stuck = fell or (calm and not _only_noise(now, estimator))
        return baseline.perturbed(now) if stuck else now

    with ThreadPoolExecutor(cpu_count()) as pool:
        work = _Work(pool, progress, 2 * len(tried))
        pairs = list(zip(tried, work.all(again, tried), strict=True))
        was, least = min(pairs, key=lambda pair: pair[1].fit.loss)
        candidates = work.all(perturbed_if_stuck, pairs)
        baseline = _restarted(baseline, candidates)
    there = [one for one in candidates if not one.vanished]
    return Ranking(baseline, *scored(estimator, there), restitution=before.restitution)


def searched_on(ranking: Ranking, progress: Progress = lambda done, total, what: None) -> Ranking:
    """A ranking whose best effects were searched without derivatives besides, for whole runs, of
    which the loss is jagged wherever a joint sticks."""
    baseline = ranking.baseline
    least = min((one.fit.loss for one in ranking.candidates), default=0.0)
    near = [
        one
        for one in ranking.candidates
        if one.fit.loss < SEARCH.near_loss * least + SEARCH.rough_gain
    ]
    far = [one for one in ranking.candidates if one not in near]
    with ThreadPoolExecutor(cpu_count()) as pool:
        work = _Work(pool, progress, len(near))
        there = work.all(baseline.simplex_searched, near) + far
    return Ranking(baseline, *scored(baseline.estimator, there), restitution=ranking.restitution)


@dataclass
class _Work:
    """Threads, and how much they have done."""

    pool: ThreadPoolExecutor
    progress: Progress
    total: int
    done: int = 0

    def all(self, make: Callable[[A], T], each: Iterable[A]) -> list[T]:
        """What is made of each."""
        out = []
        for one in self.pool.map(make, each):
            self.done += 1
            self.progress(self.done, max(self.total, self.done), one.hypothesis.effect)
            out.append(one)
        return out


def _roughly_fitted(
    baseline: Baseline, tried: Sequence[Hypothesis], work: _Work
) -> tuple[list[FittedHypothesis], list[CoarseFit]]:
    """All hypotheses fitted roughly, the best one of each of the best effects to the end."""
    coarse_fits = sorted(work.all(baseline.coarse, tried), key=lambda one: one.best.loss)
    effects = [one.hypothesis.effect for one in coarse_fits]
    best = sorted(map(effects.index, set(effects)))[:PERTURBED]
    others = [one for k, one in enumerate(coarse_fits) if k not in best]
    return work.all(baseline.refined, [coarse_fits[k] for k in best]), others


def _fitted(
    baseline: Baseline,
    best: Sequence[FittedHypothesis],
    others: Sequence[CoarseFit],
    work: _Work,
) -> list[FittedHypothesis]:
    """The others fitted to the end; not those that are far off, where one leaves only noise, nor
    those that gain hardly anything, where the model itself does."""
    least = min((one.fit.loss for one in best), default=0.0)
    most = (
        SEARCH.far_loss * least
        if least < SEARCH.noise_loss * baseline.estimator.samples
        else np.inf
    )
    if baseline.only_noise:
        most = min(most, baseline.coarse_loss - SEARCH.rough_gain)
    near = [one for one in others if one.best.loss < most]
    far = [one for one in others if one.best.loss >= most]
    refined = partial(baseline.refined, worth=SEARCH.far_loss * least)
    return work.all(refined, near) + work.all(baseline.coarse_scored, far)


def _beside(
    baseline: Baseline,
    tried: Sequence[Hypothesis],
    candidates: Sequence[FittedHypothesis],
    work: _Work,
) -> list[FittedHypothesis]:
    """Wells that may be where the best one was found, which has more or fewer: no run may have gone
    all the way."""
    alike = [
        beside(h, best)
        for best in best_of_each(candidates)[:1]
        for h in tried
        if h.wells and best.hypothesis.wells and h.wells != best.hypothesis.wells
    ]
    return work.all(baseline.refined, work.all(baseline.coarse, alike))


def _perturbed(
    baseline: Baseline, candidates: Sequence[FittedHypothesis], work: _Work
) -> list[FittedHypothesis]:
    """The best effects, in every variant that is near, with their numbers tried elsewhere."""
    best = best_of_each(candidates)[:PERTURBED]
    if baseline.only_noise and all(
        baseline.fit.loss - one.fit.loss < SEARCH.rough_gain for one in best
    ):
        return []
    names = {one.hypothesis.effect for one in best}
    others = [one for one in candidates if one.hypothesis.effect in names and one is not best[0]]
    perturbed = work.all(baseline.perturbed, work.all(baseline.uneven, best[:1]))
    least = min((one.fit.loss for one in (*candidates, *perturbed)), default=0.0)
    part = min(QUICK / max(baseline.estimator.samples, 1.0), 1.0)
    most = max(SEARCH.near_loss * least, part * baseline.fit.loss)
    near = [one for one in others if one.fit.loss < most]
    work.total = work.done + len(near)
    return perturbed + work.all(baseline.perturbed, near)


def _simplex_searched(
    baseline: Baseline, candidates: Sequence[FittedHypothesis], work: _Work
) -> list[FittedHypothesis]:
    """The best effects where they leave more than noise, searched without derivatives."""
    best = best_of_each(candidates)[:SEARCHED]
    least = min((one.fit.loss for one in best), default=0.0)
    if least < SEARCH.noise_loss * baseline.estimator.samples:
        return []
    near = [
        one for one in best if one.fit.loss < SEARCH.near_loss * least and len(one.fit.x) <= FEW
    ]
    return work.all(baseline.simplex_searched, near)


def _shown_without_impacts(baseline: Baseline, candidates: Sequence[FittedHypothesis]) -> bool:
    """Whether segments without impacts tell of an effect, with which only noise is left of them:
    then the restitution of the ends is asked once that is added."""
    samples = baseline.estimator.samples
    best = min(candidates, key=lambda one: one.score, default=None)
    if best is None or best.fit.loss > SEARCH.noise_loss * samples:
        return False
    return baseline.fit.loss - best.fit.loss - best.cost > max(
        SEARCH.smooth_gain, SEARCH.smooth_gain_per_sample * samples
    )


def _only_noise(candidate: FittedHypothesis, estimator: SegmentEstimator) -> bool:
    """Whether a candidate leaves no more than noise of some segments."""
    return candidate.fit.loss < SEARCH.noise_loss * estimator.samples


def _restarted(baseline: Baseline, candidates: Sequence[FittedHypothesis]) -> Baseline:
    """The model as it is, fitted from where the best candidate is too: it may do as well from
    there."""
    estimator, base = baseline.estimator, baseline.base
    if not candidates:
        return baseline
    best = min(candidates, key=lambda one: one.fit.loss).fit
    fit = estimator.fit(base.simulator, base.unknowns, best.x[: base.count], best.start)
    fit = estimator.refit(base.simulator, base.unknowns, fit)
    return replace(baseline, fit=min(baseline.fit, fit, key=lambda one: one.loss))
