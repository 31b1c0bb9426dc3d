"""What drives a joint away so fast that a fit does not come back within usual segments, as a detent
of a light knob may: it is sought in much shorter ones, and told where it holds in longer ones too,
as far as a joint that moves so can be followed."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import Baseline, fit_segments
from joda.diagnosis.ranking import Ranking, evidence, hopeful
from joda.diagnosis.selection import Evidence, Selection, decide
from joda.diagnosis.settings import SETTINGS
from joda.estimation.problem import posed, segments_for
from joda.estimation.segmentation import shortest
from joda.estimation.segments import Segments
from joda.measured.measured_joint import Measured

Array = NDArray[np.float64]


def runs_away(found: Evidence, selection: Selection) -> bool:
    """Whether no effect follows the joint in usual segments, by what they leave there."""
    return selection.verdict == "unexplained" and found.left[:1] >= (SETTINGS.search.runaway,)


def in_shorter(
    measured: Measured,
    usual: Baseline,
    ask: Callable[[Baseline], Ranking],
    closer_asked: Callable[[Baseline, Ranking], Ranking],
    strictness: float,
) -> tuple[Ranking, Selection, list[Evidence]] | None:
    """What is named in the longest of them, and what each look found; None where nothing is, or not
    the same in all.

    Args:
        measured: the joint and its runs.
        usual: the model fitted in usual segments.
        ask: what ranks all that may be missing.
        closer_asked: what ranks the best of that again, in longer segments.
        strictness: see `decide`.
    """
    search, longest, near = SETTINGS.search, usual.estimator.segments.length, usual.fit.x
    length = max(longest / search.shorter, shortest(measured.runs))
    if length * search.confirmed_last > longest or not segments_for(measured, length).usable.any():
        return None
    ranking = ask(fit_segments(measured, partial(telling, measured, length, near), near))
    found = [evidence(ranking)]
    selection = decide(found[0], strictness)
    for longer in (search.confirmed_in, search.confirmed_last):
        if selection.verdict == "adequate" or not hopeful(ranking):
            return None
        first = ranking.candidates[0]
        moved = replace(measured, profile=first.written(ranking.baseline.base))
        cut = partial(segments_for, moved, longer * length)
        closer = closer_asked(fit_segments(measured, cut, ranking.baseline.fit.x), ranking)
        found.append(evidence(closer))
        selection, ranking = decide(found[-1], strictness), closer
        if selection.effects[:1] != (first.hypothesis.effect,):
            return None
    return (ranking, selection, found) if selection.verdict == "missing_effect" else None


def telling(measured: Measured, length: float, near: Array, *, fine: bool) -> Segments:
    """Of all segments of a length (s), those that a model with factors `near` misses most, and as
    many of the others, evenly."""
    segments = segments_for(measured, length, fine)
    estimator, base = posed(measured, segments)
    squares = estimator.begun(base.simulator, near).squares
    each = np.where(estimator.counts, squares / np.maximum(segments.count, 1), -np.inf)
    order = np.argsort(-each)[: np.count_nonzero(estimator.counts)]
    others = np.sort(order[SETTINGS.search.most_missed :])
    every = max(len(others) // SETTINGS.search.most_missed, 1)
    kept = np.zeros(len(each), bool)
    kept[order[: SETTINGS.search.most_missed]] = kept[others[::every]] = True
    return segments.only(kept)
