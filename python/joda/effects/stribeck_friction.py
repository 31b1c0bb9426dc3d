"""Dry friction by speed."""

from collections.abc import Iterator
from math import exp, log, nan
from typing import Literal

from joda.component import Points
from joda.effects.base import CurveEffect, parameter
from joda.effects.guesses import InitialGuess, Units


class StribeckFriction(CurveEffect):
    """More dry friction at rest than in motion."""

    NAME = "more dry friction at rest than in motion (Stribeck)"
    KIND = "resistance"
    ON_FRICTION = True
    CONFUSED_WITH = (
        "constant_friction_hinge",
        "asymmetric_friction",
    )
    DESCRIPTION = "Dry friction is larger at rest and falls off with speed: it breaks away."
    LAW = "f = f_max(s) + y(s) exp(-(|v| / velocity)^exponent)"
    SOURCE = "Stribeck 1902; Bo and Pavelescu, Wear 82 (1982) 277"
    SHOWS = (
        "More force to start than to keep moving, slow motion that sticks and slips, friction "
        "that falls with speed."
    )

    effect: Literal["stribeck_friction"] = "stribeck_friction"
    velocity: float = parameter(
        "speed at which the additional friction has fallen to 37 %",
        "rad/s",
        "m/s",
        (0.01, 0.5),
        gt=0,
    )
    exponent: float = parameter("form of the fall", "1", "1", (0.5, 2), default=2.0, gt=0)
    y: Points = parameter("additional friction at rest", "N·m", "N", (0.05, 5))

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """With speeds at which it falls off from far below the usual one."""
        speeds = [log(v) for v in (0.02, 0.06, 0.2, 0.6)]
        speed = (log(1e-3), log(3.0), 0.05, nan, log(6.0))
        yield cls.guess(
            joint,
            [(speed, speeds)],
            lambda x: {"velocity": joint.speed * exp(x[1])},
            exact=False,
        )
