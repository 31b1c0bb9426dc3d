"""Where no effect explains what is missing, perhaps two do: which of them?"""

from collections.abc import Callable

from joda.diagnosis.asking import asked
from joda.diagnosis.findings import Finding
from joda.diagnosis.holdout import Holdout
from joda.diagnosis.ranking import Ranking, rank
from joda.diagnosis.reshaping import checked
from joda.diagnosis.verdict import finding
from joda.diagnosis.weighing import weigh
from joda.measured.reading import Measured

AHEAD = 4
"""Of how many effects it is seen what a second one adds."""


def pairs(
    measured: Measured, ranking: Ranking, told: Callable[[str], None]
) -> tuple[tuple[Finding, ...], ...]:
    """The likeliest effects, each with what is missing beside it; the best pair first.

    The effect that explains most by itself often stands in for two.

    Args:
        measured: the joint and its runs.
        ranking: of what may be missing.
        told: what is being done.
    """
    tried = []
    for first, guess in zip(_found(measured, ranking, AHEAD), ranking.guesses, strict=False):
        told(f"what is missing beside {guess.hypothesis.effect}")
        beside = measured.changed(checked(guess.written(ranking.asked.base)))
        rest = rank(asked(beside), roughly=True)
        loss = min((one.fit.loss + one.cost for one in rest.guesses), default=guess.fit.loss)
        tried.append((loss + guess.cost, (first, *_found(beside, rest, 1))))
    return tuple(pair for _, pair in sorted(tried, key=lambda one: one[0]))


def _found(measured: Measured, ranking: Ranking, most: int) -> list[Finding]:
    """The likeliest guesses of a ranking, told."""
    weighed, held = weigh(ranking), Holdout(ranking.asked, measured)
    likeliest = range(len(ranking.guesses[:most]))
    return [finding(measured, ranking, held, k, weighed) for k in likeliest]
