"""Effects that the measurements cannot tell apart."""

from functools import cache

from joda.diagnosis.ranking import Ranking
from joda.diagnosis.selection import LEFT, LITTLE, SETTINGS, Selection
from joda.effects import CHANNEL_EFFECTS, EFFECTS
from joda.template import read_templates

RIVAL = 0.35
"""Part of the excess that an effect may leave that counts as an alternative."""
ALIKE = 0.1
"""By how much of the misfit two effects may differ that the data cannot tell apart."""


def indistinguishable(
    ranking: Ranking, selection: Selection, number: int, one_way: bool
) -> tuple[str, ...]:
    """Effects that the data cannot tell from a candidate."""
    own, left = selection.excess
    undecided = SETTINGS.telling / max(ranking.n_effective, 1.0)
    names = [candidate.hypothesis.effect for candidate in ranking.candidates]
    alike = {
        name
        for k, name in enumerate(names)
        if abs(left[k] - left[number]) < max(ALIKE * (left[number] + LITTLE), undecided)
        and left[k] < max(RIVAL * own, LEFT)
    }
    if one_way and (mine := _kind(names[number])):
        alike |= set([name for name in names if _kind(name) not in (None, mine)][:1])
    return tuple(name for name in names if name in alike and name != names[number])


@cache
def _kind(effect: str) -> str | None:
    """A force over position or a resistance: the same where the joint goes one way only."""
    if effect in EFFECTS:
        return EFFECTS[effect].KIND
    template = read_templates().get(effect)
    forces = template is not None and template.channels.conservative is not None
    return "force" if forces else "resistance" if template or effect in CHANNEL_EFFECTS else None
