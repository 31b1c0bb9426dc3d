"""Effects that the measurements cannot tell apart."""

from functools import cache

from joda.diagnosis.ranking import Ranking
from joda.diagnosis.selection import Selection
from joda.diagnosis.settings import SETTINGS
from joda.effects import CHANNEL_EFFECTS, EFFECTS
from joda.template import read_templates


def indistinguishable(
    ranking: Ranking, selection: Selection, number: int, one_way: bool
) -> tuple[str, ...]:
    """Effects that the data cannot tell from a candidate."""
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
