"""Dry friction by load."""

from collections.abc import Iterator
from math import nan
from typing import Literal

from joda.effects.base import Effect, Motion, parameter
from joda.effects.guesses import MOVED, InitialGuess, Units

JAMMED = 1.0
"""Friction per load that no force moves."""


class LoadDependentFriction(Effect):
    """Dry friction that grows with the load on the joint."""

    NAME = "dry friction that grows with the load"
    KIND = "resistance"
    ON_FRICTION = True
    CONFUSED_WITH = (
        "position_dependent_friction",
        "constant_friction_hinge",
    )
    DESCRIPTION = "Dry friction grows with the load that the joint carries."
    LAW = (
        "f = f_max(s) + coefficient |load|; load: what its gear transmits, the actuator's force "
        "minus gravity's, contacts' and the applied one"
    )
    SOURCE = "Coulomb 1785; Hamon, Gautier and Garrec, IROS 2010"
    SHOWS = "Friction that is larger where gravity pulls more, or where hand or motor push more."

    effect: Literal["load_dependent_friction"] = "load_dependent_friction"
    coefficient: float = parameter("friction per load", "1", "1", (0.02, 0.5), ge=0)

    def largest_force(self, motion: Motion) -> float:
        """In such a motion, N·m or N."""
        return self.coefficient * motion.force

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """Where there is a load. A contact's friction grows less than it, a bearing's later."""
        if joint.forced or joint.weight:
            yield InitialGuess(
                [(0.0, 0.7, 0.002, nan, JAMMED)],
                [[0.05]],
                lambda x: cls(coefficient=x[0]),
                lambda x: x[0],
                "1",
                exact=False,
                itself=lambda x: x[0] < MOVED * JAMMED,
            )
