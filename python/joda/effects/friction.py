"""Effects that change the joint's dry friction."""

from typing import Literal

from pydantic import Field

from joda.component import Points
from joda.effects.base import CurveEffect, Direction, Effect, parameter


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
