"""Looks at the measurements: in the usual segments, and in longer ones where these leave a question
or name no effect for sure."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import Baseline, fit_baseline, fit_segments
from joda.diagnosis.coverage import moved_one_way
from joda.diagnosis.free_runs import FreeRuns, free_runs
from joda.diagnosis.plausible import Needs
from joda.diagnosis.ranking import WORST, Ranking, evidence, shows, weigh
from joda.diagnosis.search import Progress, always, narrowed, rank
from joda.diagnosis.selection import (
    SETTINGS,
    SURE,
    Evidence,
    Selection,
    closer_counts,
    decide,
    doubted,
    second_counts,
)
from joda.estimation.problem import posed, segments_for
from joda.estimation.segmentation import shortest
from joda.estimation.segments import Segments
from joda.measured.instability import longest_followed
from joda.measured.measured_joint import Measured
from joda.profile import Profile

Array = NDArray[np.float64]

LONGER, MUCH_LONGER, LONGEST = 3.0, 1.5, 1.5
"""How much longer the segments of each further look are, at the least, and at most how long, s."""
SHORTER, FOLLOWED = 9.0, (2.0, 3.0)
"""How much shorter those are in which what is unexplained is asked first, and how much longer than
these those in which what they tell must hold."""
RUNAWAY, TELLING = 1.0, 50
"""What the best effect leaves per sample, from which it is; and of how many segments that are
missed most, and how many others."""
FURTHER = 2
"""How many looks longer those are that follow where something is unexplained."""
LOOSELY = 3.0
"""Strictness where the joint went one way only, which tells little."""


@dataclass(frozen=True)
class HorizonSearch:
    """What looking at the measurements found.

    Attributes:
        ranking, selection: of the look that counts.
        first: the first look's ranking, and what it says; of the shorter ones where these count.
        evidence: of each look.
        free: what free runs as a whole say, where segments name nothing for sure; else None.
    """

    ranking: Ranking
    selection: Selection
    first: tuple[Ranking, Selection]
    evidence: tuple[Evidence, ...]
    free: FreeRuns | None = None


def ranked(
    needs: Needs,
    model: Baseline,
    exclude: Collection[str],
    progress: Progress,
    promising: Callable[[Ranking], bool] = always,
) -> Ranking:
    """What a model may lack that needs no more force than the measurements can; `promising`: as of
    `rank`."""

    def possible(profile: Profile, effect: str) -> bool:
        return not needs.exceeded(needs.exerted(profile, effect))

    return rank(model, exclude, progress, promising, possible)


def hopeful(few: Ranking) -> bool:
    """Whether, by the best effects that are fitted, some might explain the runs."""
    return sum(weigh(few).probabilities) > SETTINGS.hope


def looked(
    measured: Measured,
    exclude: Collection[str],
    progress: Progress,
    baseline: Baseline | None = None,
) -> HorizonSearch:
    """Ranks what may be missing; once more in longer segments, where these leave a question, and
    the best in longer and longer ones, while none is sure.

    Args:
        measured: the joint and its runs or curves.
        exclude: effects that are not considered.
        progress: how much is done, of how much, and what.
        baseline: the model fitted to them, in usual segments; None: it is fitted.
    """
    needs = Needs(measured)
    ranking = ranked(needs, baseline or fit_baseline(measured), exclude, progress)
    strictness = LOOSELY if moved_one_way(measured) else 1.0
    found = [evidence(ranking)]
    selection = decide(found[0], strictness)
    first = ranking, selection
    free = None if selection.likely else free_runs(measured, ranking.baseline)
    if measured.runs and selection.verdict == "unexplained":
        shorter = _in_shorter(measured, needs, ranking, exclude, progress)
        if shorter is not None:
            return HorizonSearch(*shorter[:2], shorter[:2], (*found, *shorter[2]), free)
    longer = _longer(measured, ranking.baseline)
    if selection.verdict != "missing_effect":
        drifts = bool(free and free.drifting)
        other = _shown(longer, first, drifts) if measured.runs else _noisier(measured, first)
        if other is not None:
            puzzled = selection.verdict == "unexplained" and bool(measured.runs)
            again = ranked(needs, other, exclude, progress, hopeful if puzzled else always)
            found.append(evidence(again))
            if measured.runs:
                anew = decide(found[-1], SETTINGS.strictly, wholly=True)
            else:
                anew = replace(decide(found[-1], strictness), verdict="unexplained")
            if second_counts(selection, anew):
                ranking, selection = again, anew
    while _unsure(ranking, selection) and (other := next(longer, None)):
        closer = narrowed(other, ranking, progress)
        found.append(evidence(closer))
        anew = decide(found[-1], strictness)
        if not closer_counts(selection, anew):
            selection = doubted(selection, anew)
            break
        ranking, selection = closer, anew
    return HorizonSearch(ranking, selection, first, tuple(found), free)


def _unsure(ranking: Ranking, selection: Selection) -> bool:
    """Whether a closer look at the best effects is worth it: none is sure, and only noise is left,
    as what is wrong besides adds up in longer segments."""
    calm = ranking.level <= WORST
    return calm and selection.verdict == "missing_effect" and selection.probabilities[0] <= SURE


def _in_shorter(
    measured: Measured,
    needs: Needs,
    before: Ranking,
    exclude: Collection[str],
    progress: Progress,
) -> tuple[Ranking, Selection, list[Evidence]] | None:
    """What much shorter segments tell, where that holds in all of them, too, and as long as a joint
    that moves so can be followed; None where nothing does.

    What is missing, as a detent of a light knob, may drive the joint away so fast that a fit does
    not come back from there within usual segments.
    """
    usual, own = before.baseline.estimator.segments.length, before.baseline.fit.x
    length = max(usual / SHORTER, shortest(measured.runs))
    if evidence(before).left[:1] < (RUNAWAY,) or length * FOLLOWED[-1] > usual:
        return None
    telling = fit_segments(measured, partial(_telling, measured, length, own), own)
    if not telling.estimator.samples:
        return None
    ranking = ranked(needs, telling, exclude, progress, hopeful)
    found = [evidence(ranking)]
    selection = decide(found[0])
    for longer in FOLLOWED:
        if selection.verdict == "adequate" or not hopeful(ranking):
            return None
        first = ranking.candidates[0]
        moved = replace(measured, profile=first.written(ranking.baseline.base))
        cut = partial(segments_for, moved, longer * length)
        closer = narrowed(fit_segments(measured, cut, ranking.baseline.fit.x), ranking, progress)
        found.append(evidence(closer))
        selection, ranking = decide(found[-1]), closer
        if selection.effects[:1] != (first.hypothesis.effect,):
            return None
    return (ranking, selection, found) if selection.verdict == "missing_effect" else None


def _telling(measured: Measured, length: float, near: Array, *, fine: bool) -> Segments:
    """Of all segments of a length (s), those that a model with factors `near` misses most, and as
    many of the others, evenly."""
    segments = segments_for(measured, length, fine)
    estimator, base = posed(measured, segments)
    squares = estimator.begun(base.simulator, near).squares
    each = np.where(estimator.counts, squares / np.maximum(segments.count, 1), -np.inf)
    order = np.argsort(-each)[: np.count_nonzero(estimator.counts)]
    others = np.sort(order[TELLING:])
    every = max(len(others) // TELLING, 1)
    kept = np.full(len(each), not len(order))
    kept[order[:TELLING]] = kept[others[::every]] = True
    return segments.only(kept)


def _longer(measured: Measured, baseline: Baseline) -> Iterator[Baseline]:
    """The model fitted to longer and longer segments, while runs are longer and it can follow."""
    segments = baseline.estimator.segments
    length, many, longest = segments.length, 0, longest_followed(measured, LONGEST)
    while measured.runs and len(segments.at) != many and length * MUCH_LONGER < longest:
        length, many = min(LONGER * length, longest), len(segments.at)
        baseline = fit_baseline(measured, length, baseline.fit.x)
        segments = baseline.estimator.segments
        if len(segments.at) < many:
            yield baseline


def _shown(
    longer: Iterator[Baseline], first: tuple[Ranking, Selection], drifts: bool
) -> Baseline | None:
    """The model in segments in which something shows that is to be explained; None where nothing
    does.

    Args:
        longer: the model in longer and longer segments.
        first: the ranking in usual ones, and what it says.
        drifts: whether free runs as a whole tell that something does.
    """
    ranking, selection = first
    if (
        drifts or selection.verdict != "adequate"
    ):  # what usual segments leave open needs much longer
        return next(reversed(tuple(islice(longer, FURTHER))), None)
    return next((one for one in longer if shows(ranking, one)), None)


def _noisier(measured: Measured, first: tuple[Ranking, Selection]) -> Baseline | None:
    """The model and curves that are asked once more; None where nothing is to be explained.

    As if their noise were what the best effect usually leaves: a hand trembles, and
    friction is uneven, by more than a gauge's noise. That stays unexplained, but it no longer
    decides what is named.
    """
    ranking, selection = first
    estimator = ranking.baseline.estimator
    if selection.verdict == "adequate":
        return None
    best = ranking.candidates[0].fit if ranking.candidates else ranking.baseline.fit
    left = best.squares / np.maximum(estimator.segments.count, 1)
    factor = max(float(np.sqrt(np.median(left[estimator.counts]))), 1.0)
    noisier = measured.with_curves([curve.noisier(factor) for curve in measured.curves])
    return fit_baseline(noisier)
