"""Dry friction by direction."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from joda.component import Points
from joda.effects.base import DIRECTIONS, CurveEffect, Direction, parameter
from joda.effects.guesses import InitialGuess, Units


class AsymmetricFriction(CurveEffect):
    """More dry friction in one direction than in the other."""

    NAME = "more dry friction in one direction than in the other"
    KIND = "resistance"
    ON_FRICTION = True
    LIKE_A_NUMBER = True
    CONFUSED_WITH = (
        "constant_positive_conservative_hinge",
        "constant_negative_conservative_hinge",
        "stribeck_friction",
    )
    DESCRIPTION = "Dry friction is larger while moving in one direction than in the other."
    LAW = "f = f_max(s) + y(s) while v has the direction, f_max(s) otherwise"
    SOURCE = "Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083"
    SHOWS = (
        "A constant difference in force between the two directions that does not grow with speed. "
        "A constant force and more symmetric friction look the same while the joint moves."
    )

    effect: Literal["asymmetric_friction"] = "asymmetric_friction"
    direction: Direction = Field(description="in which friction is larger; positive: q grows")
    y: Points = parameter("additional friction", "N·m", "N", (0.05, 5))

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """In each direction."""
        for direction in DIRECTIONS:
            yield cls.guess(joint, direction=direction)
