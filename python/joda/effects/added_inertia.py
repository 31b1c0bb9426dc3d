"""More inertia."""

from collections.abc import Iterator
from math import nan
from typing import Literal

from joda.effects.base import Effect, Motion, parameter
from joda.effects.guesses import MOVED, InitialGuess, Units

HEAVY = 300.0
"""Added inertia, in units of the joint's, up to which is looked."""


class AddedInertia(Effect):
    """More inertia than the bodies have."""

    NAME = "more inertia than the model has"
    LIKE_A_NUMBER = True
    CONFUSED_WITH = ("gravity_offset",)
    DESCRIPTION = "The joint is harder to set in motion than its bodies' masses make it."
    LAW = "force -inertia dv/dt"
    SOURCE = "Newton's second law; `armature` of the joint in the scene"
    SHOWS = "All accelerations under a known force are too small by one factor."

    effect: Literal["added_inertia"] = "added_inertia"
    inertia: float = parameter("additional inertia", "kg·m²", "kg", (0.001, 5), gt=0)

    def largest_force(self, motion: Motion) -> float:
        """In such a motion, N·m or N."""
        return self.inertia * motion.acceleration

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """From a tenth of the joint's own."""
        yield InitialGuess(
            [(1e-4, 5.0, 0.002, nan, HEAVY)],
            [[0.1]],
            lambda x: cls(inertia=joint.inertia * x[0]),
            lambda x: joint.inertia * x[0],
            "kg·m²" if joint.hinge else "kg",
            itself=lambda x: x[0] < MOVED * HEAVY,
        )
