"""A joint's resistances, stops and return spring, and what its base model believes of them."""

from collections.abc import Collection

import numpy as np

from joda.hidden.stops import buffer, damping_ratio
from joda.hidden.truth import Joint, Truth

GRAVITY = 9.81
RUBBING = ("presliding_friction", "stribeck_friction", "backlash")
"""Effects that need dry friction of the base."""
BOUNCING = "end_stop_restitution"
PULLING = ("spring", "constant_p", "constant_n", "gravity")
"""How effects begin that a return spring of the base may be taken for."""
LIVELY = (50.0, 70.0)
"""Least and greatest frequency on a stop that throws back as the base model knows, rad per natural
time: a base model's steps are too long for harder ones."""
HARDEST = 150.0
"""Greatest frequency on a base model's stop, for the same reason."""
SLOW = 0.4
"""Natural time of a joint from which on MuJoCo's default stop makes sense, s."""


def pick(rng: np.random.Generator, least: float, most: float) -> float:
    """A size between two, evenly over its logarithm."""
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))


def furnish(
    rng: np.random.Generator,
    joint: Joint,
    names: Collection[str],
    stops: tuple[float, float],
    sprung: float = 0.0,
) -> Truth:
    """The joint with what resists it, and a base model that is 10 to 40 % off.

    Args:
        rng: of the draw.
        joint: its mechanics.
        names: of what it will hide.
        stops: least and greatest frequency on a stop, rad per natural time.
        sprung: probability of a return spring.
    """
    dry = joint.force * pick(rng, 0.03, 0.15)
    viscous = joint.force * joint.time / joint.span * pick(rng, 0.03, 0.15)
    absent = rng.choice(["friction", "damping", "none"], p=[0.15, 0.15, 0.7])
    if absent == "friction" and not any(name in RUBBING for name in names):
        dry = 0.0
    if absent == "damping":
        viscous = 0.0
    wrong = 1 + rng.choice([-1.0, 1.0], 2) * rng.uniform(0.1, 0.4, 2)
    common, ratio = pick(rng, *stops) / joint.time, 1.0
    if BOUNCING not in names and rng.random() < 0.1:
        common, ratio = pick(rng, *LIVELY) / joint.time, damping_ratio(rng.uniform(0.25, 0.45))
    low, high = (buffer(joint.inertia, common * rng.uniform(0.7, 1.4), ratio) for _ in range(2))
    stiffer = min(common * pick(rng, 0.5, 2.0), HARDEST / joint.time)
    believed: tuple[float, float] | None = (1 / (ratio * stiffer), ratio)
    if ratio == 1 and joint.time > SLOW and rng.random() < 0.4:
        believed = None
    spring = (0.0, 0.0)
    if rng.random() < sprung and not any(name.startswith(PULLING) for name in names):
        spring = (
            joint.force / joint.span * rng.uniform(0.3, 0.8),
            joint.lo - rng.uniform(0.1, 0.6) * joint.span,
        )
    return Truth(
        joint,
        dry,
        viscous,
        friction_model=float(dry * wrong[0]),
        damping_model=float(viscous * wrong[1]),
        stops=(low, high),
        spring=spring,
        limit_model=believed,
        tight=bool(rng.random() < 0.5),
    )
