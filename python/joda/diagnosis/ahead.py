"""Where no effect explains what is missing, perhaps two do: which of them is the first?"""

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


def first_of_two(
    measured: Measured, ranking: Ranking, told: Callable[[str], None]
) -> tuple[Finding, ...]:
    """The likeliest effects; first the one beside which another one explains most.

    The one that explains most by itself often stands in for both.

    Args:
        measured: the joint and its runs.
        ranking: of what may be missing.
        told: what is being done.
    """
    losses = []
    for guess in ranking.guesses[:AHEAD]:
        told(f"what is missing beside {guess.hypothesis.effect}")
        beside = measured.changed(checked(guess.written(ranking.asked.base)))
        both = rank(asked(beside)).guesses
        second = min((one.fit.loss + one.cost for one in both), default=guess.fit.loss)
        losses.append(second + guess.cost)
    order = sorted(range(len(losses)), key=losses.__getitem__)
    weighed, held = weigh(ranking), Holdout(ranking.asked)
    return tuple(finding(measured, ranking, held, k, weighed) for k in order)
