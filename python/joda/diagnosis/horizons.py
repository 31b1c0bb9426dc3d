"""Looks at the measurements: in the usual segments, and in longer ones where these leave a question
or name no effect for sure."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import Baseline, fit_baseline
from joda.diagnosis.data_sufficiency import moved_one_way
from joda.diagnosis.free_runs import FreeRuns, free_runs
from joda.diagnosis.plausible import Needs
from joda.diagnosis.ranking import Ranking, evidence, hopeful, shows
from joda.diagnosis.search import Progress, always, narrowed, rank
from joda.diagnosis.selection import (
    Evidence,
    Selection,
    closer_counts,
    decide,
    pooled,
    second_counts,
)
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shorter_segments import in_shorter, runs_away
from joda.measured.instability import longest_followed
from joda.measured.measured_joint import Measured

Array = NDArray[np.float64]

LONGER, MUCH_LONGER, LONGEST = 3.0, 1.5, 1.5
"""How much longer the segments of each further look are, at the least, and at most how long, s."""
FURTHER = 2
"""How many looks longer those are that follow where something is unexplained."""


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
    possible = Needs(measured).allow
    ranking = rank(baseline or fit_baseline(measured), exclude, progress, possible=possible)
    strictness = SETTINGS.selection.one_way if moved_one_way(measured) else 1.0
    found = [evidence(ranking)]
    selection = decide(found[0], strictness)
    first = ranking, selection
    free = None if selection.likely else free_runs(measured, ranking.baseline)
    if measured.runs and runs_away(found[0], selection):
        ask = partial(
            rank, exclude=exclude, progress=progress, promising=hopeful, possible=possible
        )
        closer_asked = partial(narrowed, progress=progress)
        shorter = in_shorter(measured, ranking.baseline, ask, closer_asked, strictness)
        if shorter is not None:
            own, anew, each = shorter
            return HorizonSearch(own, anew, (own, anew), (*found, *each), free)
    longer = _longer(measured, ranking.baseline)
    if selection.verdict != "missing_effect":
        drifts = bool(free and free.drifting)
        other = _shown(longer, first, drifts) if measured.runs else _noisier(measured, first)
        if other is not None:
            unexplained = selection.verdict == "unexplained" and bool(measured.runs)
            promising = hopeful if unexplained else always
            again = rank(other, exclude, progress, promising, possible)
            found.append(evidence(again))
            if measured.runs:
                anew = decide(found[-1], SETTINGS.selection.second_look, wholly=True)
            else:
                anew = replace(decide(found[-1], strictness), verdict="unexplained")
            if second_counts(selection, anew):
                ranking, selection = again, anew
    while _unsure(ranking, selection) and (other := next(longer, None)):
        closer = narrowed(other, ranking, progress)
        found.append(evidence(closer))
        anew = decide(found[-1], strictness)
        if not closer_counts(selection, anew):
            selection = pooled(selection, anew)
            break
        ranking, selection = closer, anew
    return HorizonSearch(ranking, selection, first, tuple(found), free)


def _unsure(ranking: Ranking, selection: Selection) -> bool:
    """Whether a closer look at the best effects is worth it: none is sure, and only noise is left,
    as what is wrong besides adds up in longer segments."""
    calm = ranking.level <= SETTINGS.selection.noise_square
    return (
        calm
        and selection.verdict == "missing_effect"
        and selection.probabilities[0] <= SETTINGS.selection.sure
    )


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
