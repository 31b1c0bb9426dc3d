"""What kinds of joints there are and what each does.

Places and the names of effects are as in `joda.propose.parts`.
"""

from joda._context import Context
from joda.propose.parts import DAMPING, FRICTION, SNAP, SPRING, Kind, Part, catch


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
        parts=(catch("strong", 0.12, "a magnetic seal pulls it shut"), FRICTION, DAMPING),
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
            catch("medium", 0.12, "a catch pulls it shut"),
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
            catch("strong", 0.12, "a magnetic catch holds it shut"),
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
        parts=(catch("strong", 0.1, "a sprung hinge pulls it shut"), FRICTION, DAMPING),
    ),
    Kind(
        "drawer",
        own=r"drawer|tray|rack|shelf",
        objects=r"drawer|cabinet|dresser|desk|nightstand|chest",
        alone=True,
        joint="slide",
        wishes=("closes_near", "held_shut", "stays_put"),
        parts=(catch("strong", 0.12, "its runners pull it in"), FRICTION, DAMPING),
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
