"""What is a number of a joint in each world, and what is a curve: their places in the arrays."""

from enum import IntEnum


class Number(IntEnum):
    """Place of a number among those of a joint; `names` says what it is called outside."""

    RANGE_LO = 0
    RANGE_HI = 1
    CONSERVATIVE_STRENGTH = 2
    FRICTION_STRENGTH = 3
    DAMPING_STRENGTH = 4
    DIRECTION_DEPENDENT_DAMPING_STRENGTH = 5
    QUADRATIC_DAMPING_STRENGTH = 6
    ASYMMETRIC_FRICTION_STRENGTH = 7
    STRIBECK_FRICTION_STRENGTH = 8
    STRIBECK_FRICTION_VELOCITY = 9
    STRIBECK_FRICTION_EXPONENT = 10
    LOAD_DEPENDENT_FRICTION_COEFFICIENT = 11
    PRESLIDING_FRICTION_STIFFNESS = 12
    PRESLIDING_FRICTION_DAMPING = 13
    PRESLIDING_FRICTION_BREAKAWAY = 14
    GRAVITY_OFFSET_SIN = 15
    GRAVITY_OFFSET_COS = 16
    GRAVITY_OFFSET_FORCE = 17
    BACKLASH_PLAY = 18
    BACKLASH_HANDLE = 19
    BACKLASH_LOAD = 20
    BACKLASH_SHARE = 21
    END_STOP_RESTITUTION_LOW = 22
    END_STOP_RESTITUTION_HIGH = 23
    LEARNED_FORCE_STRENGTH = 24
    LEARNED_FORCE_STIFFNESS = 25
    """Gain of a memory of position; 0: there is none."""
    LEARNED_FORCE_CHANGE = 26
    """Gain of a memory of speed; 0: there is none."""
    LEARNED_FORCE_TIME = 27

    @property
    def title(self) -> str:
        """Its name outside: owner and number, as "friction.strength"."""
        owner, _, number = self.name.lower().rpartition("_")
        return f"{owner}.{number}"


class Curve(IntEnum):
    """Place of a curve among those of a joint."""

    CONSERVATIVE = 0
    FRICTION = 1
    DAMPING = 2
    DAMPING_UP = 3
    DAMPING_DOWN = 4
    QUADRATIC_UP = 5
    QUADRATIC_DOWN = 6
    ASYMMETRY_UP = 7
    ASYMMETRY_DOWN = 8
    STRIBECK = 9


class State(IntEnum):
    """Place of a number among those that a joint remembers."""

    TIME = 0
    """Of the step that was computed last, s; below 0: none yet."""
    FRICTION = 1
    """Of the last step, N·m or N."""
    GAP = 2
    """Position of the handle or the load minus the joint's, rad or m."""
    SPEED = 3
    """Of the handle, or of the load minus the joint's, rad/s or m/s."""
    NEXT_SIDE = 4
    """What the step being computed makes of these: side of the joint that moves the load,"""
    NEXT_GAP = 5
    NEXT_SPEED = 6
    """and the handle's numbers after it, or the load's gap before it and its speed by itself."""
    UNKNOWN_LOAD = 7
    """Of the load that friction depends on, what no step knows before its solver has run: that of
    the last step, N·m or N."""
    STOP_SIDE = 8
    """In the step being computed: 1 where the low end of the range is near, -1 the high one."""
    BESIDE_ROW = 9
    """In the step being computed: friction that is not in the row's force, N·m or N."""
    REMEMBERED = 10
    """By a learned force: rad, m, rad/s or m/s."""


class Row(IntEnum):
    """Place of a constraint's row among those of a joint."""

    FRICTION = 0
    DAMPING = 1
    LIMIT = 2


class Place(IntEnum):
    """Place of an integer among those that say where a joint is in the model."""

    JOINT = 0
    DOF = 1
    QPOS = 2
    BODY = 3
    LAST_BODY = 4
    """Of those that move with it, which follow one another."""
    EQUALITY = 5
    HINGE = 6
