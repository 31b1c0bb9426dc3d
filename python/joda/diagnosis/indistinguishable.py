"""Effects that the measurements cannot tell apart."""

from collections.abc import Mapping

from joda.diagnosis.phrases import words_of
from joda.diagnosis.ranking import Ranking
from joda.diagnosis.selection import Selection
from joda.diagnosis.settings import SETTINGS
from joda.effects.base import Kind
from joda.template import Template

Kinds = Mapping[str, Kind]
"""Of each effect that is one: a force over position or a resistance."""


def indistinguishable(
    ranking: Ranking, selection: Selection, number: int, kinds: Kinds
) -> tuple[str, ...]:
    """Effects that the data cannot tell from a candidate.

    Args:
        ranking: of what may be missing.
        selection: its probabilities.
        number: of the candidate.
        kinds: where the joint went one way only, of which a force and a resistance are the same;
            empty where it went both ways.
    """
    own, left = selection.excess
    undecided = SETTINGS.selection.same_loss / max(ranking.n_effective, 1.0)
    names = [candidate.hypothesis.effect for candidate in ranking.candidates]
    alike = {
        name
        for k, name in enumerate(names)
        if abs(left[k] - left[number])
        < max(
            SETTINGS.naming.alike * (left[number] + SETTINGS.selection.negligible_excess), undecided
        )
        and left[k]
        < max(SETTINGS.naming.alternative_share * own, SETTINGS.selection.unknown_excess)
    }
    if mine := kinds.get(names[number]):
        alike |= set([name for name in names if kinds.get(name, mine) != mine][:1])
    return tuple(name for name in names if name in alike and name != names[number])


def kinds_of(ranking: Ranking, templates: Mapping[str, Template]) -> Kinds:
    """Of the candidates of a ranking."""
    names = [candidate.hypothesis.effect for candidate in ranking.candidates]
    kinds = {name: words_of(name, templates).kind for name in names}
    return {name: kind for name, kind in kinds.items() if kind}
