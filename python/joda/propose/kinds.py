"""What kinds of joints there are, as far as names, motion and gravity tell, and what each does.

Places are shares of the way from the closed end (0) to the other (1). In an effect's name {closed}
and {open} stand for those ends, {opening} and {closing} for the sign of the motion.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from joda._compile import reference_scales
from joda._context import Context
from joda.proposal import Label

Gravity = Literal["level", "opens", "closes"]


@dataclass(frozen=True)
class Part:
    """An effect of a kind.

    Attributes:
        effect: the template's name.
        place: from where to where.
        conservative, friction, damping: strengths.
        reason: why it is there.
        serves: the wishes that it is there for; without them it goes.
    """

    effect: str
    place: tuple[float, float]
    reason: str
    conservative: Label = "none"
    friction: Label = "none"
    damping: Label = "none"
    serves: tuple[str, ...] = ()


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


def _catch(strength: Label, width: float, what: str) -> Part:
    serves = ("closes_near", "held_shut")
    return Part(MAGNET, (0, width), what, strength, serves=serves)


def _returns_inside(context: Context) -> bool:
    """Whether the joint's reference position lies between its ends."""
    return context.closed_end == "unknown"


def _level_slide(context: Context) -> bool:
    """Whether the joint slides horizontally, far enough for something to be put into it."""
    lo, hi = context.joint.range
    return abs(context.axis_world[2]) < 0.5 and hi - lo > 0.05


DOOR = r"door|lid|hinge|flap|panel|front|hatch"
KINDS = (
    Kind(
        "robot joint",
        own=r"(?<![a-z])arm(?![a-z])|robot|panda|franka|finger|gripper|wrist|elbow|shoulder|forearm|actuat|motor",
        parts=(
            Part("constant_friction_hinge", (0, 1), "its gears rub", friction="weak"),
            Part("constant_damping_hinge", (0, 1), "its gears are greased", damping="weak"),
        ),
    ),
    Kind(
        "microwave door",
        own=DOOR,
        objects=r"micro",
        joint="hinge",
        gravity=("level",),
        wishes=("latched", "stays_put"),
        parts=(
            Part(SNAP, (0, 0.07), "hooks snap in", "strong", "weak", serves=("latched",)),
            FRICTION,
            DAMPING,
        ),
    ),
    Kind(
        "refrigerator door",
        own=DOOR,
        objects=r"fridge|refrigerator|freezer|icebox",
        joint="hinge",
        gravity=("level",),
        wishes=("closes_near", "held_shut", "stays_put"),
        parts=(_catch("strong", 0.12, "a magnetic seal pulls it shut"), FRICTION, DAMPING),
    ),
    Kind(
        "oven door",
        own=DOOR,
        objects=r"oven|stove|broiler",
        joint="hinge",
        gravity=("opens",),
        wishes=("closes_near", "held_shut", "stays_half", "stays_open"),
        parts=(
            Part(
                SPRING,
                (0, 1),
                "springs in the hinges carry its weight and shut it",
                "strong",
                serves=("closes_near", "held_shut", "stays_half"),
            ),
            Part("constant_friction_hinge", (0, 1), "its hinges are stiff", friction="medium"),
            Part("constant_damping_hinge", (0, 1), "grease", damping="medium"),
        ),
    ),
    Kind(
        "dishwasher door",
        own=DOOR,
        objects=r"dish",
        joint="hinge",
        gravity=("opens",),
        wishes=("closes_near", "held_shut", "stays_half", "stays_open"),
        parts=(
            Part(
                SPRING,
                (0, 1),
                "springs carry its weight",
                "strong",
            ),
            _catch("medium", 0.12, "a catch pulls it shut"),
            Part("constant_friction_hinge", (0, 1), "the springs' ropes rub", friction="medium"),
            Part(
                "constant_{opening}_conservative_hinge",
                (0.85, 1),
                "past the dead point it tends to lie open",
                "weak",
                serves=("stays_open",),
            ),
            Part("constant_damping_hinge", (0, 1), "the springs' ropes", damping="medium"),
        ),
    ),
    Kind(
        "flap that its weight opens",
        own=DOOR,
        objects=r"cabinet|cupboard|closet|bureau|desk|flap",
        joint="hinge",
        gravity=("opens",),
        wishes=("closes_near", "held_shut", "opens_past"),
        parts=(
            _catch("strong", 0.12, "a magnetic catch holds it shut"),
            FRICTION,
            Part(
                "constant_damping_hinge",
                (0, 1),
                "a damper lets it down gently",
                damping="medium",
            ),
        ),
    ),
    Kind(
        "laptop lid",
        own=r"lid|screen|display|door|hinge|top",
        objects=r"laptop|notebook|computer|monitor",
        joint="hinge",
        wishes=("stays_put",),
        parts=(
            Part(
                "constant_friction_hinge",
                (0, 1),
                "a friction hinge holds it at any angle",
                friction="medium",
                serves=("stays_put",),
            ),
            DAMPING,
        ),
    ),
    Kind(
        "lid that its weight closes",
        own=r"lid|cover|flap|hatch|seat|door",
        objects=r"chest|box|bin|toilet|trash|trunk",
        alone=True,
        joint="hinge",
        gravity=("closes",),
        wishes=("held_shut",),
        parts=(
            FRICTION,
            Part("constant_damping_hinge", (0, 1), "it comes down gently", damping="medium"),
        ),
    ),
    Kind(
        "cabinet door",
        own=DOOR,
        objects=r"cabinet|cupboard|closet|wardrobe|locker|sideboard|hingecab",
        joint="hinge",
        gravity=("level",),
        wishes=("closes_near", "held_shut", "stays_put"),
        parts=(_catch("strong", 0.1, "a sprung hinge pulls it shut"), FRICTION, DAMPING),
    ),
    Kind(
        "drawer",
        own=r"drawer|tray|rack|shelf",
        objects=r"drawer|cabinet|dresser|desk|nightstand|chest",
        alone=True,
        joint="slide",
        wishes=("closes_near", "held_shut", "stays_put"),
        parts=(_catch("strong", 0.12, "its runners pull it in"), FRICTION, DAMPING),
        suits=_level_slide,
    ),
    Kind(
        "sliding door",
        own=r"slid(?:e|ing)|door|window|panel|gate",
        joint="slide",
        wishes=("stays_put",),
        parts=(FRICTION, DAMPING),
    ),
    Kind(
        "lighter button",
        own=r"button|push|trigger|igniter",
        objects=r"lighter",
        joint="slide",
        wishes=("closes_anywhere", "snaps"),
        parts=(
            Part(SPRING, (0, 1), "a spring pushes it back", "strong", serves=("closes_anywhere",)),
            Part(
                "detent_internal",
                (0.3, 0.7),
                "the striker is cocked, then let go",
                "medium",
                serves=("snaps",),
            ),
            FRICTION,
        ),
    ),
    Kind(
        "push button",
        own=r"button|key|pedal|plunger",
        wishes=("closes_anywhere",),
        parts=(
            Part(SPRING, (0, 1), "a spring pushes it back", "strong", serves=("closes_anywhere",)),
            FRICTION,
            DAMPING,
        ),
    ),
    Kind(
        "switch",
        own=r"switch|rocker|toggle|breaker",
        wishes=("two_sides",),
        parts=(
            Part(
                "bistable_mechanism",
                (0, 1),
                "a spring snaps it over its middle to either side",
                "strong",
                "weak",
                "weak",
                serves=("two_sides",),
            ),
        ),
    ),
    Kind(
        "selector knob",
        own=r"knob|dial|selector|rotary",
        joint="hinge",
        wishes=("clicks",),
        parts=(
            Part("detents", (0, 1), "it clicks into its positions", "medium", serves=("clicks",)),
            FRICTION,
            DAMPING,
        ),
    ),
    Kind(
        "handle that springs back to its middle",
        own=r"handle|latch|lever|stick",
        wishes=("returns_to_middle",),
        parts=(
            Part(
                "detent_internal",
                (0, 1),
                "springs hold it in its middle",
                "strong",
                serves=("returns_to_middle",),
            ),
            FRICTION,
            DAMPING,
        ),
        suits=_returns_inside,
    ),
    Kind(
        "handle that springs back",
        own=r"handle|latch|lever",
        wishes=("closes_anywhere",),
        parts=(
            Part(SPRING, (0, 1), "a spring returns it", "strong", serves=("closes_anywhere",)),
            FRICTION,
            DAMPING,
        ),
        suits=lambda context: not _returns_inside(context),
    ),
    Kind(
        "door",
        own=r"door|gate|window",
        joint="hinge",
        gravity=("level",),
        wishes=("stays_put",),
        parts=(FRICTION, DAMPING),
    ),
)

UNKNOWN = Kind("joint of an unknown kind", wishes=(), parts=(FRICTION, DAMPING))

WISHED: dict[str, tuple[Part, ...]] = {
    "closes_near": (_catch("strong", 0.1, "it is to close by itself"),),
    "held_shut": (_catch("strong", 0.1, "it is to stay shut"),),
    "closes_anywhere": (Part(SPRING, (0, 1), "it is to return from anywhere", "medium"),),
    "left_open": (
        Part("constant_friction_hinge", (0, 1), "it is not to close by itself", friction="weak"),
    ),
    "opens_past": (
        Part("constant_{opening}_conservative_hinge", (0.4, 1), "it is to open", "medium"),
    ),
    "latched": (Part(SNAP, (0, 0.07), "it is to latch", "strong", "weak"),),
    "stays_put": (
        Part("constant_friction_hinge", (0.1, 1), "it is to stay where left", friction="medium"),
    ),
    "stays_half": (
        Part("constant_friction_hinge", (0.3, 0.7), "it is to hold half-way", friction="strong"),
    ),
    "stays_open": (
        Part("magnetic_return_to_{open}", (0.88, 1), "it is to stay open", "medium", "weak"),
    ),
    "clicks": (Part("detents", (0, 1), "it is to click", "medium"),),
    "two_sides": (Part("bistable_mechanism", (0, 1), "it is to have two sides", "strong"),),
    "returns_to_middle": (Part("detent_internal", (0, 1), "it is to return", "strong"),),
    "snaps": (Part("detent_internal", (0.3, 0.7), "it is to snap through", "medium"),),
    "soft": (Part("constant_damping_hinge", (0, 0.3), "it is to close softly", damping="medium"),),
}
"""What is added for a wish that the kind does not have."""


def gravity_role(context: Context) -> Gravity:
    """What gravity does to the joint over most of its range."""
    force = context.gravity_force
    if context.gravity_scale < 0.05 * reference_scales(context)["conservative"]:
        return "level"
    towards_high = sum(force) > 0
    return "opens" if towards_high != (context.closed_end == "high_end") else "closes"


def recognise(context: Context, description: str = "") -> tuple[Kind, float]:
    """The kind of a joint, and how sure that is, 0 to 1.

    Args:
        context: the joint.
        description: what the user says of it; its words count most.
    """
    near = " ".join(context.names[:2]).lower()
    everything = " ".join((*context.names, *context.around)).lower()
    said = description.lower()
    best, most = UNKNOWN, 0
    for kind in KINDS:
        if context.joint.type not in kind.joint or gravity_role(context) not in kind.gravity:
            continue
        if not kind.suits(context):
            continue
        object_known = _in(kind.objects, everything) or _in(kind.objects, said)
        if kind.objects and not kind.alone and not object_known:
            continue
        score = 4 * _in(kind.own, near) + 3 * _in(kind.objects, everything)
        score += 10 * _in(kind.objects, said) + 5 * _in(_word(kind.own), said)
        if score > most:
            best, most = kind, score
    return best, {0: 0.2, 3: 0.4, 4: 0.5}.get(most, 0.7)


def _word(words: str) -> str:
    """As nouns: what latches, or needs a push to latch, is not a latch."""
    return rf"(?<!to )\b(?:{words})s?\b" if words else ""


def _in(words: str, text: str) -> bool:
    return bool(words and re.search(words, text))
