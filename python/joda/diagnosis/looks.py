"""Looks at the measurements: in the usual windows, and in longer ones where these leave a question
or name no effect for sure."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from joda.diagnosis.asking import Asked, asked
from joda.diagnosis.coverage import moved_one_way
from joda.diagnosis.plausible import Needs
from joda.diagnosis.ranking import WORST, Ranking, Told, narrowed, rank
from joda.diagnosis.weighing import (
    SETTINGS,
    SURE,
    Evidence,
    Weighed,
    closer_counts,
    decide,
    evidence,
    second_counts,
    shows,
)
from joda.diagnosis.whole import FreeRuns, free_runs
from joda.measured.reading import Measured

LONGER, MUCH_LONGER, LONGEST = 3.0, 1.5, 1.5
"""How much longer the windows of each further look are, at the least, and at most how long, s."""
FURTHER = 2
"""How many looks longer those are that follow where something is unexplained."""
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


def looked(
    measured: Measured, exclude: Collection[str], told: Told, begun: Asked | None = None
) -> Looked:
    """Ranks what may be missing; once more in longer windows, where these leave a question, and the
    best in longer and longer ones, while none is sure.

    Args:
        measured: the joint and its runs or curves.
        exclude: effects that are not considered.
        told: how much is done, of how much, and what.
        begun: the model fitted to them, in usual windows; None: it is fitted.
    """
    needs = Needs(measured)

    def ranked(model: Asked) -> Ranking:
        """What may be missing and needs no more force than the measurements can."""
        return rank(
            model, exclude, told, possible=lambda *one: not needs.exceeded(needs.exerted(*one))
        )

    ranking = ranked(begun or asked(measured))
    strictness = LOOSELY if moved_one_way(measured) else 1.0
    found = [evidence(ranking)]
    weighed = decide(found[0], strictness)
    first = ranking, weighed
    free = None if weighed.likely else free_runs(measured, ranking.asked)
    longer = _longer(measured, ranking.asked)
    if weighed.verdict != "missing_effect":
        drifts = bool(free and free.drifting)
        other = _shown(longer, first, drifts) if measured.runs else _noisier(measured, first)
        if other is not None:
            again = ranked(other)
            found.append(evidence(again))
            if measured.runs:
                anew = decide(found[-1], SETTINGS.strictly, wholly=True)
            else:
                anew = replace(decide(found[-1], strictness), verdict="unexplained")
            if second_counts(weighed, anew):
                ranking, weighed = again, anew
    while _unsure(ranking, weighed) and (other := next(longer, None)):
        closer = narrowed(other, ranking, told)
        found.append(evidence(closer))
        anew = decide(found[-1], strictness)
        if not closer_counts(weighed, anew):
            break
        ranking, weighed = closer, anew
    return Looked(ranking, weighed, first, tuple(found), free)


def _unsure(ranking: Ranking, weighed: Weighed) -> bool:
    """Whether a closer look at the best effects is worth it: none is sure, and only noise is left,
    as what is wrong besides adds up in longer windows."""
    calm = ranking.level <= WORST
    return calm and weighed.verdict == "missing_effect" and weighed.probabilities[0] <= SURE


def _longer(measured: Measured, begun: Asked) -> Iterator[Asked]:
    """The model fitted to longer and longer windows, while runs are longer."""
    windows = begun.judge.windows
    length, many = windows.length, 0
    while measured.runs and len(windows.at) != many and length * MUCH_LONGER < LONGEST:
        length, many = min(LONGER * length, LONGEST), len(windows.at)
        begun = asked(measured, length, begun.fit.x)
        windows = begun.judge.windows
        if len(windows.at) < many:
            yield begun


def _shown(longer: Iterator[Asked], first: tuple[Ranking, Weighed], drifts: bool) -> Asked | None:
    """The model in windows in which something shows that is to be explained; None where nothing
    does.

    Args:
        longer: the model in longer and longer windows.
        first: the ranking in usual ones, and what it says.
        drifts: whether free runs as a whole tell that something does.
    """
    ranking, weighed = first
    if drifts or weighed.verdict != "adequate":  # what usual windows leave open needs much longer
        return next(reversed(tuple(islice(longer, FURTHER))), None)
    return next((one for one in longer if shows(ranking, one)), None)


def _noisier(measured: Measured, first: tuple[Ranking, Weighed]) -> Asked | None:
    """The model and curves that are asked once more; None where nothing is to be explained.

    As if their noise were what the best effect usually leaves: a hand trembles, and
    friction is uneven, by more than a gauge's noise. That stays unexplained, but it no longer
    decides what is named.
    """
    ranking, weighed = first
    judge = ranking.asked.judge
    if weighed.verdict == "adequate":
        return None
    best = ranking.guesses[0].fit if ranking.guesses else ranking.asked.fit
    left = best.squares / np.maximum(judge.windows.count, 1)
    factor = max(float(np.sqrt(np.median(left[judge.counts]))), 1.0)
    noisier = measured.with_curves([curve.noisier(factor) for curve in measured.curves])
    return asked(noisier)
