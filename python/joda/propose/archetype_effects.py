"""The effects that a kind of joint is made of.

Places are shares of the way from the closed end (0) to the other (1). In an effect's name {closed}
and {open} stand for those ends, {opening} and {closing} for the sign of the motion.
"""

from pydantic import Field

from joda.component import Frozen
from joda.proposal import Label


class ArchetypeEffect(Frozen):
    """An effect of a kind.

    Attributes:
        effect: the template's name; "detents" for one at each of a knob's positions.
        place: from where to where; with `reach`, in units of the way that this requirement names.
        reason: why it is there.
        conservative, friction, damping: strengths.
        serves: the requirements that it is there for; without them it goes.
        reach: a requirement that names an angle from which something happens.
    """

    effect: str
    place: tuple[float, float]
    reason: str
    conservative: Label = "none"
    friction: Label = "none"
    damping: Label = "none"
    serves: tuple[str, ...] = Field(default=())
    reach: str = ""


MAGNET = "magnetic_return_to_{closed}"
SPRING = "spring_return_to_{closed}"
SNAP = "spring_loaded_snap_detent_to_{closed}"


def part(
    effect: str,
    place: tuple[float, float],
    reason: str,
    conservative: Label = "none",
    friction: Label = "none",
    damping: Label = "none",
    serves: tuple[str, ...] = (),
    reach: str = "",
) -> ArchetypeEffect:
    """A `ArchetypeEffect`, its fields in order."""
    return ArchetypeEffect(
        effect=effect,
        place=place,
        reason=reason,
        conservative=conservative,
        friction=friction,
        damping=damping,
        serves=serves,
        reach=reach,
    )


def catch(strength: Label, width: float, what: str) -> ArchetypeEffect:
    """What pulls it shut over the last of its way, and holds it."""
    return part(MAGNET, (0, width), what, strength, serves=("closes_near", "held_shut"))


RISE = 1 / 3
"""Share of its way over which the pull of a sprung hinge or of a catch rises, before it fades."""
HELD = 0.4
"""Share of a magnet's interval from which on weak friction holds against its strong pull."""


def rising(
    requirement: str, width: float, fades: float, what: str, reach: str = ""
) -> tuple[ArchetypeEffect, ArchetypeEffect]:
    """A pull towards the closed end that rises over a third of a width, then fades.

    The leverage of a spring or roller grows as it is turned out of its seat, until it gives way.
    """
    serves, top = (requirement, "closes_near", "held_shut"), RISE * width
    return (
        part(SPRING, (0, top), what, "strong", serves=serves, reach=reach),
        part(MAGNET, (top, fades), "past that it fades", "strong", serves=serves, reach=reach),
    )
