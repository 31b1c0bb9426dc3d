"""Effects that change the joint's dry friction."""

from collections.abc import Iterator
from itertools import product
from math import exp, log, nan
from typing import Literal

from pydantic import Field

from joda.component import Points
from joda.effects.base import DIRECTIONS, CurveEffect, Direction, Effect, parameter
from joda.effects.guesses import MOVED, InitialGuess, Trial, Units

JAMMED = 1.0
"""Friction per load that no force moves."""


class AsymmetricFriction(CurveEffect):
    """More dry friction in one direction than in the other."""

    NAME = "more dry friction in one direction than in the other"
    KIND = "resistance"
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


class StribeckFriction(CurveEffect):
    """More dry friction at rest than in motion."""

    NAME = "more dry friction at rest than in motion (Stribeck)"
    KIND = "resistance"
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


class LoadDependentFriction(Effect):
    """Dry friction that grows with the load on the joint."""

    NAME = "dry friction that grows with the load"
    KIND = "resistance"
    DESCRIPTION = "Dry friction grows with the load that the joint carries."
    LAW = (
        "f = f_max(s) + coefficient |load|; load: what its gear transmits, the actuator's force "
        "minus gravity's, contacts' and the applied one"
    )
    SOURCE = "Coulomb 1785; Hamon, Gautier and Garrec, IROS 2010"
    SHOWS = "Friction that is larger where gravity pulls more, or where hand or motor push more."

    effect: Literal["load_dependent_friction"] = "load_dependent_friction"
    coefficient: float = parameter("friction per load", "1", "1", (0.02, 0.5), ge=0)

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


class PreslidingFriction(Effect):
    """Dry friction that gives way elastically before it slides."""

    NAME = "dry friction that gives way elastically before it slides"
    KIND = "resistance"
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
