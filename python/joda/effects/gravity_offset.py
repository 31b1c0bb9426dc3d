"""Another pull of gravity."""

from collections.abc import Iterator
from math import hypot
from typing import Literal, Self

from pydantic import model_validator

from joda.effects.base import Effect, Motion, parameter
from joda.effects.guesses import TINY, TRIAL, InitialGuess, Units

PULL = (-300.0, 300.0, 0.005)
"""Bounds and step of a pull of gravity, in usual forces."""


class GravityOffset(Effect):
    """Gravity acts otherwise than the bodies' masses say: tilt, or a wrong centre of mass."""

    NAME = "another pull of gravity (tilt, or another centre of mass)"
    KIND = "force"
    LIKE_A_NUMBER = True
    CONFUSED_WITH = (
        "constant_positive_conservative_hinge",
        "constant_negative_conservative_hinge",
        "spring_return_to_low_end",
        "spring_return_to_high_end",
    )
    DESCRIPTION = "The axis is tilted, or the centre of mass is elsewhere than in the model."
    LAW = "force sin sin(q) + cos cos(q) on a hinge, force on a slide"
    SOURCE = "torque of a weight on an arm"
    SHOWS = (
        "A force, over a hinge's position like a sine and of a slide constant, the same in both "
        "directions and at rest; the joint drifts to another place than the model does."
    )

    effect: Literal["gravity_offset"] = "gravity_offset"
    sin: float = parameter("factor of sin q, of a hinge", "N·m", "-", (-5, 5), default=0.0)
    cos: float = parameter("factor of cos q, of a hinge", "N·m", "-", (-5, 5), default=0.0)
    force: float = parameter("constant, of a slide", "-", "N", (-20, 20), default=0.0)

    @model_validator(mode="after")
    def _something(self) -> Self:
        if not (self.sin or self.cos or self.force):
            raise ValueError("give sin or cos for a hinge, force for a slide")
        return self

    def largest_force(self, motion: Motion) -> float:
        """In such a motion, N·m or N."""
        return abs(self.force) + hypot(self.sin, self.cos)

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """A sine or a cosine of a hinge, a constant of a slide."""
        force, unit = joint.force, joint.of_force()
        if joint.hinge:
            yield InitialGuess(
                [PULL] * 2,
                [(TRIAL, 0.0), (0.0, TRIAL)],
                lambda x: cls(sin=force * x[0] or TINY, cos=force * x[1]),
                lambda x: force * hypot(*x),
                unit,
            )
        else:
            yield InitialGuess(
                [PULL],
                [[TRIAL]],
                lambda x: cls(force=force * x[0] or TINY),
                lambda x: force * abs(x[0]),
                unit,
            )

    def fits(self, kind: Literal["hinge", "slide"]) -> bool:
        """Whether only those numbers are set that such a joint has."""
        return not (self.force if kind == "hinge" else self.sin or self.cos)
