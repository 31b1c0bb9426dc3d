"""Damping by direction."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from joda.component import Points
from joda.effects.base import DIRECTIONS, CurveEffect, Direction, parameter
from joda.effects.guesses import InitialGuess, Units


class DirectionDependentDamping(CurveEffect):
    """More damping in one direction than in the other."""

    NAME = "more damping in one direction than in the other"
    KIND = "resistance"
    CONFUSED_WITH = (
        "asymmetric_friction",
        "quadratic_damping",
    )
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
