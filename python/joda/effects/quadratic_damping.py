"""Drag by the square of speed."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from joda.component import Points
from joda.effects.base import CurveEffect, parameter
from joda.effects.guesses import AnyDirection, InitialGuess, Units


class QuadraticDamping(CurveEffect):
    """Drag that grows with the square of speed."""

    NAME = "drag that grows with the square of speed"
    KIND = "resistance"
    CONFUSED_WITH = (
        "constant_damping_hinge",
        "direction_dependent_damping",
    )
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
