"""The verdict as a sentence."""

from collections.abc import Mapping

from joda.diagnosis import phrases
from joda.diagnosis.findings import Finding
from joda.diagnosis.selection import Selection
from joda.diagnosis.settings import SETTINGS
from joda.measured.measured_joint import Measured
from joda.measured.quasi_static import compared
from joda.template import Template

STILL = " With it the held-out segment error is still {:.0f} times the noise."
SAME = (
    ": the joint was moved in one direction only, or nearly so, where a resistance and a force "
    "over position are the same"
)
ENDS_LEFT = "The ends of the range throw the joint back more than the model's: not explained."
BLIND = (
    " With its own numbers fitted the held-out segment error is less than what was taken for "
    "noise, part of which may be what the joint does between two samples: record faster."
)


def other_unit(measured: Measured) -> str | None:
    """That the force of a curve may be in another unit, a clause; None if not."""
    if not (times := measured.unit_factor):
        return None
    return f"{compared(times)}: see to its unit first"


def summarised(
    first: Finding,
    selection: Selection,
    floor: float,
    one_way: bool,
    restitution: bool,
    confounder: str | None = None,
    templates: Mapping[str, Template] | None = None,
) -> str:
    """The verdict in a sentence, where something is missing.

    "The model lacks" is said only of an answer that is more likely than not, and with which the
    error on segments held out of the fit falls from more than the noise, and not to many times the
    noise.

    Args:
        first: the likeliest effect.
        selection: the ranking's probabilities.
        floor: noise of the measurement, in the unit of the errors held out.
        one_way: whether the joint was moved in one direction only.
        restitution: of the ends, as in `Ranking`.
        confounder: of `one_factor` or `other_unit`: then it is a candidate.
        templates: by name, which call effects what they call them; None: the library's.
    """
    name = first.name
    alike = first.indistinguishable_from
    others = " or ".join(phrases.named(other, templates) for other in alike)
    either = f"{name} or {others}" if others else name
    if selection.verdict == "unexplained":
        return _unexplained(first, either if one_way else name, selection, one_way, restitution)
    likely = f"probability {phrases.percent(first.probability)}"
    if not helps(first, floor):
        return (
            f"Something is missing that no known effect explains. Best guess: {name} ({likely}); "
            "but with it the held-out segment error is as large."
        )
    after = first.held_out_error_after
    far = far_off(first, floor)
    blind = first.held_out_error_before < floor
    probability = _sum(first, selection) if others else first.probability
    head = (
        "Best guess:"
        if blind or far or confounder or probability <= SETTINGS.selection.likely
        else "The model lacks"
    )
    more = BLIND if blind else STILL.format(after / floor) if far else ""
    if others:
        why = SAME if one_way else ": these data cannot tell which"
        return f"{head} {either}{why}.{more}"
    return f"{head} {name} ({likely}).{more}"


def heavier_summary(found: Finding, numbers_off: str) -> str:
    """That more inertia is missing, which the model's own numbers tell.

    Args:
        found: that.
        numbers_off: how far off they would be without it.
    """
    likely = f"probability {phrases.percent(found.probability)}"
    return (
        f"The model lacks {found.name} ({likely}): without it, its own numbers "
        f"would be off by one and the same factor ({numbers_off}), which chance seldom makes."
    )


def helps(found: Finding, floor: float) -> bool:
    """Whether what was held out is missed by less with an effect; where it is missed by less than
    the noise even without, whether not by clearly more: there its error is noise with and without.
    """
    before, after = found.held_out_error_before, found.held_out_error_after
    return after < before or (before < floor and SETTINGS.naming.held_out_left * after < before)


def far_off(found: Finding, floor: float) -> bool:
    """Whether what was held out is still missed by many noises with an effect, and by more than a
    small part of what it was missed by without."""
    after = found.held_out_error_after
    return (
        after > SETTINGS.naming.held_out_noises * floor
        and after > SETTINGS.naming.held_out_share * found.held_out_error_before
    )


def _sum(first: Finding, selection: Selection) -> float:
    """Probability that it is the first or one that these data cannot tell from it."""
    alike = (first.effect, *first.indistinguishable_from)
    return sum(p for name, p in selection.named if name in alike)


def _unexplained(
    first: Finding, what: str, selection: Selection, one_way: bool, restitution: bool
) -> str:
    if restitution and selection.excess[0] < SETTINGS.selection.unexplained_excess:
        return ENDS_LEFT
    share = 100 * min(selection.share, 1.0)
    same = SAME if one_way and " or " in what else ""
    if share <= 1:
        none = phrases.percent(selection.unknown or 0.0)
        likely = phrases.percent(first.probability)
        return (
            f"Best guess: {what}{same} (probability {likely}); that none of the known effects "
            f"explains the data has {none}."
        )
    part = f"{share:.0f} %"
    if share < SETTINGS.naming.something_else:
        return (
            f"Best guess: {what}, but not only that{same}; it leaves {part} of the misfit, which "
            "no known effect explains."
        )
    return (
        f"Something is missing that no known effect explains: the best of them, {what}, leaves "
        f"{part} of the misfit."
    )
