"""Effects that change the joint's damping."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from joda.component import Points
from joda.effects.base import DIRECTIONS, CurveEffect, Direction, parameter
from joda.effects.guesses import AnyDirection, InitialGuess, Units


class DirectionDependentDamping(CurveEffect):
    """More damping in one direction than in the other."""

    NAME = "more damping in one direction than in the other"
    KIND = "resistance"
    DESCRIPTION = "Damping is larger in one direction: a soft-close damper, a door closer."
    LAW = "force -y(s) v while v has the direction, 0 otherwise"
    SOURCE = "Janot, Young and Gautier, Control Eng. Practice 73 (2018) on the EMPS drive"
    SHOWS = "A force that grows with speed in one direction more than in the other."
    POWER = 1

    effect: Literal["direction_dependent_damping"] = "direction_dependent_damping"
    direction: Direction = Field(description="in which damping is larger; positive: q grows")
    y: Points = parameter("additional damping", "N·m·s/rad", "N·s/m", (0.1, 50))

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """In each direction."""
        for direction in DIRECTIONS:
            yield cls.guess(joint, direction=direction)


class QuadraticDamping(CurveEffect):
    """Drag that grows with the square of speed."""

    NAME = "drag that grows with the square of speed"
    KIND = "resistance"
    DESCRIPTION = "Drag grows with the square of speed: air, oil through an orifice."
    LAW = "force -y(s) v |v|"
    SOURCE = "Newton's drag; Blevins, Applied Fluid Dynamics Handbook (1984)"
    SHOWS = "Fast motions lose more than in proportion; slow ones hardly anything."
    POWER = 2

    effect: Literal["quadratic_damping"] = "quadratic_damping"
    direction: AnyDirection = Field(
        default="both", description="in which it acts; positive: q grows"
    )
    y: Points = parameter("drag", "N·m·s²/rad²", "N·s²/m²", (0.01, 50))

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """In both directions."""
        yield cls.guess(joint)
