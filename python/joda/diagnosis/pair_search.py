"""Where no effect explains what is missing, perhaps two do: which of them?"""

from collections.abc import Callable

from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.findings import Finding
from joda.diagnosis.holdout import Holdout
from joda.diagnosis.search import Ranking, rank
from joda.diagnosis.selection import weigh
from joda.diagnosis.shape_refinement import checked
from joda.diagnosis.verdict import finding
from joda.measured.reading import Measured

AHEAD = 4
"""Of how many effects it is seen what a second one adds."""


def pairs(
    measured: Measured, ranking: Ranking, progress: Callable[[str], None]
) -> tuple[tuple[Finding, ...], ...]:
    """The likeliest effects, each with what is missing beside it; the best pair first.

    The effect that explains most by itself often stands in for two.

    Args:
        measured: the joint and its runs.
        ranking: of what may be missing.
        progress: what is being done.
    """
    tried = []
    for first, candidate in zip(_found(measured, ranking, AHEAD), ranking.candidates, strict=False):
        progress(f"what is missing beside {candidate.hypothesis.effect}")
        beside = measured.changed(checked(candidate.written(ranking.baseline.base)))
        rest = rank(fit_baseline(beside), roughly=True)
        loss = min((one.fit.loss + one.cost for one in rest.candidates), default=candidate.fit.loss)
        tried.append((loss + candidate.cost, (first, *_found(beside, rest, 1))))
    return tuple(pair for _, pair in sorted(tried, key=lambda one: one[0]))


def _found(measured: Measured, ranking: Ranking, most: int) -> list[Finding]:
    """The likeliest candidates of a ranking, told."""
    selection, held = weigh(ranking), Holdout(ranking.baseline, measured)
    likeliest = range(len(ranking.candidates[:most]))
    return [finding(measured, ranking, held, k, selection) for k in likeliest]
