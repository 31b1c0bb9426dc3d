"""Dry friction with bristles."""

from collections.abc import Iterator
from itertools import product
from math import exp, log
from typing import Literal

from joda.effects.base import Effect, parameter
from joda.effects.guesses import InitialGuess, Trial, Units


class PreslidingFriction(Effect):
    """Dry friction that gives way elastically before it slides."""

    NAME = "dry friction that gives way elastically before it slides"
    KIND = "resistance"
    ON_FRICTION = True
    SHAPE_ERROR = 0.04  # bristles yield before they slide
    CONFUSED_WITH = ("backlash",)
    DESCRIPTION = (
        "Before dry friction slides it gives way like a spring: small motions come back, reversals "
        "are soft."
    )
    LAW = (
        "force -p, dp/dt = stiffness (1 - a p / f) v, |p| <= f, plus damping (1 - a p / f) v; a "
        "rises from 0 at p = breakaway f to 1 at p = f"
    )
    SOURCE = (
        "Dupont, Hayward, Armstrong and Altpeter, IEEE TAC 47 (2002) 787; breakaway 0 is Dahl's "
        "model (1968), 1 Prandtl's"
    )
    SHOWS = (
        "Hysteresis loops in small reversals, a spring rate at the beginning of each motion, "
        "ringing around rest."
    )

    effect: Literal["presliding_friction"] = "presliding_friction"
    stiffness: float = parameter("of the bristles", "N·m/rad", "N/m", (10, 1e5), gt=0)
    damping: float = parameter("of the bristles", "N·m·s/rad", "N·s/m", (0, 10), default=0.0, ge=0)
    breakaway: float = parameter(
        "share of the friction at which they begin to slide", "1", "1", (0, 1), default=1.0, ge=0,
        le=1,
    )  # fmt: skip

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """By how far the bristles give way, and when they begin to slide."""
        if not joint.friction:
            return
        soft = joint.friction / joint.span

        def stiffness(x: Trial) -> float:
            return soft * exp(x[0])

        def effect(x: Trial) -> PreslidingFriction:
            damping = x[1] * (stiffness(x) * joint.inertia) ** 0.5
            return cls(stiffness=stiffness(x), damping=damping, breakaway=x[2])

        yield InitialGuess(
            [(log(20.0), log(5e3), 0.05, log(4.0), log(5e3)), (0.0, 1.5, 0.02), (0.0, 0.95, 0.03)],
            [
                (log(1 / part), 0.0, begin)
                for part, begin in product((0.001, 0.003, 0.01, 0.03), (0.0, 0.6))
            ],
            effect,
            stiffness,
            "N·m/rad" if joint.hinge else "N/m",
            exact=False,
        )
