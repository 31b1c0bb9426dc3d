"""Friction and damping of a profile with its effects, for pictures and quasi-static curves."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda.component import Component, Curve
from joda.effects import (
    AsymmetricFriction,
    DirectionDependentDamping,
    LoadDependentFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.field import merge
from joda.profile import Channel, Profile

Array = NDArray[np.float64]


def friction_bounds(
    profile: Profile, s: ArrayLike, v: float = 0.0, load: ArrayLike = 0.0
) -> tuple[Array, Array]:
    """The largest dry friction against motion in the positive and in the negative direction.

    Args:
        profile: of the joint.
        s: normalised positions, shape (n,).
        v: velocity, rad/s or m/s.
        load: on the joint, N·m or N.

    Returns:
        two arrays of shape (n,), N·m or N; the friction force is between minus the first and the
        second.
    """
    both = merge(profile.channels.friction)(s)[0]
    sides = {"positive": np.zeros_like(both), "negative": np.zeros_like(both)}
    for effect in profile.effects:
        if isinstance(effect, StribeckFriction):
            both = both + _curve(effect, s) * np.exp(
                -((abs(v) / effect.velocity) ** effect.exponent)
            )
        elif isinstance(effect, LoadDependentFriction):
            both = both + effect.coefficient * np.abs(load)
        elif isinstance(effect, AsymmetricFriction):
            sides[effect.direction] += _curve(effect, s)
    return both + sides["positive"], both + sides["negative"]


def damping(profile: Profile, s: ArrayLike, v: float) -> Array:
    """Resistance divided by speed.

    Args:
        profile: of the joint.
        s: normalised positions, shape (n,).
        v: velocity, rad/s or m/s; its sign is the direction.

    Returns:
        shape (n,), N·m·s/rad or N·s/m.
    """
    out = merge(profile.channels.damping)(s)[0]
    direction = "positive" if v > 0 else "negative"
    for effect in profile.effects:
        if isinstance(effect, DirectionDependentDamping) and effect.direction == direction:
            out = out + _curve(effect, s)
        elif isinstance(effect, QuadraticDamping) and effect.direction in ("both", direction):
            out = out + _curve(effect, s) * abs(v)
    return out


def _curve(curve: Curve, s: ArrayLike) -> Array:
    component = Component(interval=curve.interval, x=curve.x, y=curve.y)
    return merge(Channel(components=(component,)))(s)[0]
