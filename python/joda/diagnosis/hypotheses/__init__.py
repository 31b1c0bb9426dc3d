"""What may be missing from a joint's model: every template and effect, with unknown numbers."""

from collections.abc import Mapping

from joda.diagnosis.hypotheses.base import Hypothesis
from joda.diagnosis.hypotheses.effects import free_curves, from_effects
from joda.diagnosis.hypotheses.templates import from_templates
from joda.effects import written_as
from joda.effects.guesses import Units
from joda.profile import Profile
from joda.template import Template

__all__ = ["Hypothesis", "hypotheses"]


def hypotheses(
    units: Units, templates: Mapping[str, Template], profile: Profile
) -> list[Hypothesis]:
    """All that may be missing; what the profile has already may not."""
    out = [*from_templates(units, templates), *free_curves(units), *from_effects(units)]
    present = {effect.key for effect in profile.effects}
    return [h for h in out if not _there(h, present)]


def _there(h: Hypothesis, present: set[str]) -> bool:
    listed = written_as(h.effect)
    if h.direction == "both" or listed != h.effect:
        return any(key.split()[0] == listed for key in present)
    return bool({f"{listed} {h.direction}", f"{listed} both"} & present)
