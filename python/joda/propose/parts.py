"""What a kind of joint is, and the effects that it is made of.

Places are shares of the way from the closed end (0) to the other (1). In an effect's name {closed}
and {open} stand for those ends, {opening} and {closing} for the sign of the motion.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from joda._context import Context
from joda.proposal import Label

Gravity = Literal["level", "opens", "closes"]


@dataclass(frozen=True)
class Part:
    """An effect of a kind.

    Attributes:
        effect: the template's name.
        place: from where to where; with `reach`, in units of the way that this wish names.
        conservative, friction, damping: strengths.
        reason: why it is there.
        serves: the wishes that it is there for; without them it goes.
        reach: a wish that names an angle from which something happens.
    """

    effect: str
    place: tuple[float, float]
    reason: str
    conservative: Label = "none"
    friction: Label = "none"
    damping: Label = "none"
    serves: tuple[str, ...] = ()
    reach: str = ""


@dataclass(frozen=True)
class Kind:
    """A kind of joint.

    Attributes:
        title: what it is.
        own: words in the name of the joint or of the body that it moves.
        objects: words in any name around, of the object that it belongs to.
        alone: whether its own name is enough where there are `objects`.
        joint: hinge, slide, or either.
        gravity: what gravity may do to it.
        wishes: what it does, by name; {number} wishes get theirs from `count`.
        parts: how.
    """

    title: str
    own: str = ""
    objects: str = ""
    alone: bool = False
    joint: str = "hinge or slide"
    gravity: tuple[Gravity, ...] = ("level", "opens", "closes")
    wishes: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    suits: Callable[[Context], bool] = lambda context: True


FRICTION = Part("constant_friction_hinge", (0, 1), "hinges and guides rub", friction="weak")
DAMPING = Part("constant_damping_hinge", (0, 1), "grease and air", damping="weak")
MAGNET = "magnetic_return_to_{closed}"
SPRING = "spring_return_to_{closed}"
SNAP = "spring_loaded_snap_detent_to_{closed}"


def catch(strength: Label, width: float, what: str) -> Part:
    """What pulls it shut over the last of its way, and holds it."""
    serves = ("closes_near", "held_shut")
    return Part(MAGNET, (0, width), what, strength, serves=serves)


RISE = 1 / 3
"""Share of its way over which the pull of a sprung hinge or of a catch rises, before it fades."""
HELD = 0.4
"""Share of a magnet's interval from which on weak friction holds against its strong pull."""


def rising(wish: str, width: float, fades: float, what: str, reach: str = "") -> tuple[Part, Part]:
    """A pull towards the closed end that rises over a third of a width, then fades.

    The leverage of a spring or roller grows as it is turned out of its seat, until it gives way.
    """
    serves, top = (wish, "closes_near", "held_shut"), RISE * width
    return (
        Part(SPRING, (0, top), what, "strong", serves=serves, reach=reach),
        Part(MAGNET, (top, fades), "past that it fades", "strong", serves=serves, reach=reach),
    )
