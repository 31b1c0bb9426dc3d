"""Where no effect explains what is missing, perhaps two do: which of them?"""

from collections.abc import Callable
from dataclasses import replace

from joda.diagnosis.baseline import Baseline, CoarseFit, fit_baseline
from joda.diagnosis.findings import Finding
from joda.diagnosis.holdout import Holdout
from joda.diagnosis.hypothesis_fits import FittedHypothesis
from joda.diagnosis.ranking import Ranking, select
from joda.diagnosis.report import finding
from joda.diagnosis.search import rank
from joda.diagnosis.shape_refinement import checked
from joda.measured.measured_joint import Measured

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
    some = ranking.candidates[:AHEAD]
    ranking = replace(ranking, candidates=tuple(_even(ranking.baseline, one) for one in some))
    tried = []
    for first, candidate in zip(_found(measured, ranking, AHEAD), ranking.candidates, strict=False):
        progress(f"what is missing beside {candidate.hypothesis.effect}")
        beside = measured.changed(checked(candidate.written(ranking.baseline.base)))
        anew = fit_baseline(beside)
        even = tuple(replace(one, uneven=None) for one in anew.hypotheses)
        rest = rank(replace(anew, hypotheses=even), promising=lambda few: False)
        loss = min((one.fit.loss + one.cost for one in rest.candidates), default=candidate.fit.loss)
        tried.append((loss + candidate.cost, (first, *_found(beside, rest, 1))))
    return tuple(pair for _, pair in sorted(tried, key=lambda one: one[0]))


def _even(baseline: Baseline, candidate: FittedHypothesis) -> FittedHypothesis:
    """The candidate as large everywhere: what differs along the way may stand in for a second."""
    if not (count := candidate.hypothesis.factors):
        return candidate
    own = candidate.hypothesis.effect, candidate.hypothesis.direction
    flat = next(one for one in baseline.hypotheses if (one.effect, one.direction) == own)
    fit = replace(candidate.fit, x=candidate.fit.x[:-count])
    return baseline.refined(CoarseFit(replace(flat, uneven=None), (fit,)))


def _found(measured: Measured, ranking: Ranking, most: int) -> list[Finding]:
    """The likeliest candidates of a ranking, told."""
    selection, held = select(ranking), Holdout(ranking.baseline, measured)
    likeliest = range(len(ranking.candidates[:most]))
    return [finding(measured, ranking, held, k, selection) for k in likeliest]
