"""Friction and damping of a profile with its effects, for pictures and quasi-static curves."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda.component import Component, Curve
from joda.effects import (
    AsymmetricFriction,
    DirectionDependentDamping,
    LearnedForce,
    LoadDependentFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.field import evaluate
from joda.field.table import resistance
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
    both = evaluate(profile.channels.friction, s)[0]
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


def damping(profile: Profile, s: ArrayLike, v: ArrayLike) -> Array:
    """Resistance divided by speed; of a learned force without its memory.

    Args:
        profile: of the joint.
        s: normalised positions, shape (n,).
        v: velocity or velocities there, rad/s or m/s; the sign is the direction.

    Returns:
        shape (n,), N·m·s/rad or N·s/m.
    """
    out = evaluate(profile.channels.damping, s)[0]
    v = np.asarray(v, float)
    up = np.where(v > 0, 1.0, 0.0)
    ways = {"both": np.ones_like(up), "positive": up, "negative": 1 - up}
    for effect in profile.effects:
        if isinstance(effect, DirectionDependentDamping):
            out = out + _curve(effect, s) * ways[effect.direction]
        elif isinstance(effect, QuadraticDamping):
            out = out + _curve(effect, s) * np.abs(v) * ways[effect.direction]
        elif isinstance(effect, LearnedForce):
            force, slope = resistance(effect, s, v)
            out = out + np.where(v == 0, slope, force / np.where(v == 0, 1, v))
    return out


def _curve(curve: Curve, s: ArrayLike) -> Array:
    component = Component(interval=curve.interval, x=curve.x, y=curve.y)
    return evaluate(Channel(components=(component,)), s)[0]
