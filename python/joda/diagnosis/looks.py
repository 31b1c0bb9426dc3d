"""One look at the measurements or two: the usual windows, and longer ones where these leave a
question."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from joda.diagnosis.asking import Asked, asked
from joda.diagnosis.coverage import moved_one_way
from joda.diagnosis.plausible import Needs
from joda.diagnosis.ranking import Ranking, Told, rank
from joda.diagnosis.weighing import (
    SETTINGS,
    Evidence,
    Weighed,
    decide,
    evidence,
    excess_of,
    second_counts,
)
from joda.diagnosis.whole import FreeRuns, free_runs
from joda.measured.reading import Measured

LONGER, LONGEST = 9.0, 1.5
"""How much longer the windows of a second look are, and at most how long, s."""
LOOSELY = 3.0
"""Strictness where the joint went one way only, which tells little."""


@dataclass(frozen=True)
class Looked:
    """What looking at the measurements found.

    Attributes:
        ranking, weighed: of the look that counts.
        first: the first look's ranking, and what it says.
        evidence: of each look.
        free: what free runs as a whole say, where windows name nothing for sure; else None.
    """

    ranking: Ranking
    weighed: Weighed
    first: tuple[Ranking, Weighed]
    evidence: tuple[Evidence, ...]
    free: FreeRuns | None = None


def looked(measured: Measured, exclude: Collection[str], told: Told) -> Looked:
    """Ranks what may be missing; once more in longer windows, where what is weak shows.

    Args:
        measured: the joint and its runs or curves.
        exclude: effects that are not considered.
        told: how much is done, of how much, and what.
    """
    needs = Needs(measured)

    def ranked(begun: Asked) -> Ranking:
        """What may be missing and needs no more force than the measurements can."""
        return rank(
            begun, exclude, told, possible=lambda *one: not needs.exceeded(needs.exerted(*one))
        )

    ranking = ranked(asked(measured))
    strictness = LOOSELY if moved_one_way(measured) else 1.0
    found = evidence(ranking)
    weighed = decide(found, strictness)
    first = ranking, weighed
    free = None if weighed.likely else free_runs(measured, ranking.asked)
    if weighed.verdict == "missing_effect":
        return Looked(ranking, weighed, first, (found,), free)
    again = _again(measured, first, bool(free and free.drifting), ranked)
    if again is None:
        return Looked(ranking, weighed, first, (found,), free)
    more = evidence(again)
    if measured.runs:
        anew = decide(more, SETTINGS.strictly, wholly=True)
    else:
        anew = replace(decide(more, strictness), verdict="unexplained")
    if second_counts(weighed, anew):
        ranking, weighed = again, anew
    return Looked(ranking, weighed, first, (found, more), free)


def _again(
    measured: Measured,
    first: tuple[Ranking, Weighed],
    drifts: bool,
    ranked: Callable[[Asked], Ranking],
) -> Ranking | None:
    """A second ranking; None where nothing shows that is to be explained, nor free runs drift.

    Of curves as if their noise were what the best effect usually leaves: a hand trembles, and
    friction is uneven, by more than a gauge's noise. That stays unexplained, but it no longer
    decides what is named.
    """
    ranking, weighed = first
    calm, judge = weighed.verdict == "adequate", ranking.asked.judge
    if measured.runs:
        longer = asked(measured, min(LONGER * judge.windows.length, LONGEST), ranking.asked.fit.x)
        if calm and not drifts and excess_of(longer) <= SETTINGS.noticed:
            return None
        return ranked(longer)
    if calm:
        return None
    best = ranking.guesses[0].fit if ranking.guesses else ranking.asked.fit
    left = best.squares / np.maximum(judge.windows.count, 1)
    factor = max(float(np.sqrt(np.median(left[judge.counts]))), 1.0)
    noisier = measured.with_curves([curve.noisier(factor) for curve in measured.curves])
    return ranked(asked(noisier))
