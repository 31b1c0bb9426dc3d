"""The laws of the effects beyond the three channels, in JAX: as in cpp/effects.h.

For one joint: numbers in, numbers out. An effect that is None is not computed. Units are those of a
hinge; for a slide read N, m and kg.
"""

import jax
import jax.numpy as jnp

from joda.field import jaxfield
from joda.field.jaxeffects import (
    Backlash,
    Curve,
    Directed,
    Effects,
    EndStops,
    GravityOffset,
    Presliding,
    Stribeck,
)
from joda.joints.stiffness import IDLE_ROW, STIFF_ROW
from joda.scenes.limits import IMPEDANCE, STIFFNESS

Array = jax.Array

SLIPPING = 1e-6
"""Part of the bristles' stiffness that is left while they slip."""
LEAST_SHARE = 0.05
"""Part of it that is left in the row where it is far stiffer than the step resolves."""
STILL = 1e-9
"""As kStill in cpp/effects.h."""
FADED = 6.0
"""ln (|v| / velocity)^exponent at which Stribeck's friction is gone: exp(-exp(6)) = 6e-176."""


def damping(own: Effects, s: Array, v: Array) -> Array:
    """What is added to the damping, N·m·s/rad.

    Args:
        own: the joint's effects.
        s: normalised position.
        v: velocity before the step, rad/s.
    """
    out = jnp.zeros_like(v)
    if own.direction_dependent_damping is not None:
        out = out + _along(own.direction_dependent_damping, s, v)
    if own.quadratic_damping is not None:
        out = out + _along(own.quadratic_damping, s, v) * jnp.abs(v)
    return out


def friction(own: Effects, s: Array, v: Array, load: Array) -> tuple[Array, Array]:
    """What is added to the largest friction in positive and in negative motion, N·m.

    Args:
        own, s, v: as for `damping`.
        load: gravity's force on the joint and the force that is applied to it, N·m.
    """
    both = jnp.zeros_like(v)
    if own.stribeck_friction is not None:
        both = both + _stribeck(own.stribeck_friction, s, v)
    if own.load_dependent_friction is not None:
        both = both + own.load_dependent_friction.coefficient * jnp.abs(load)
    sides = own.asymmetric_friction
    if sides is None:
        return both, both
    return both + _value(sides.positive, s), both + _value(sides.negative, s)


def friction_row(
    bristles: Presliding | None,
    held: Array,
    bound: Array,
    v: Array,
    inertia: Array,
    h: Array | float,
) -> tuple[Array, Array]:
    """How stiff friction's row is, and what it adds to the damping (N·m·s/rad).

    Args:
        bristles: None: none.
        held: the row's force in the step before, within the bound, N·m.
        bound: its largest, N·m.
        v: velocity before the step, rad/s.
        inertia: of the joint, kg·m².
        h: timestep, s.

    Returns:
        D of the row, kg·m², and the damping.
    """
    stiff = STIFF_ROW * inertia
    if bristles is None:
        return stiff, jnp.zeros_like(v)
    direction = jnp.where(jnp.abs(v) < STILL, 0, jnp.sign(v))
    r = jnp.clip(-held * direction / jnp.where(bound > 0, bound, 1), -1, 1)
    left = jnp.maximum(1 - _plastic(bristles.breakaway, r) * r, SLIPPING)
    resolved = h * h * bristles.stiffness
    # The row must also stop a part that turns back within the step. While it slips the bound gives
    # the law's force, so that all of the stiffness can be there; else what is too stiff for the
    # step keeps a share.
    in_row = jnp.maximum(left, LEAST_SHARE - inertia / resolved)
    in_row = jnp.where(left <= SLIPPING, 1, in_row)
    D = jnp.clip(resolved * in_row, IDLE_ROW * inertia, stiff)
    return D, bristles.damping * left


def gravity(offset: GravityOffset | None, q: Array) -> tuple[Array, Array]:
    """A gravity offset's force at q (rad), N·m, and its largest stiffness, N·m/rad."""
    if offset is None:
        return jnp.zeros_like(q), jnp.zeros_like(q)
    square = offset.sin**2 + offset.cos**2
    steepest = jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1)), 0)
    return offset.sin * jnp.sin(q) + offset.cos * jnp.cos(q) + offset.force, steepest


def backlash(
    handle: Backlash | None, g: Array, w: Array, v: Array, force: Array, h: Array | float
) -> tuple[Array, Array, Array]:
    """A step of the handle.

    Args:
        handle: None: the force acts on the part.
        g: the handle's position minus the part's, rad.
        w: its velocity, rad/s.
        v: velocity of the part before the step, rad/s.
        force: applied to the handle, N·m.
        h: timestep, s.

    Returns:
        the force on the part, and g and w after the step.
    """
    if handle is None:
        return force, g, w
    half = 0.5 * handle.play
    g = jnp.clip(g, -half, half)
    inertia = jnp.where(handle.inertia > 0, handle.inertia, 1)
    after = jnp.clip(g + h * (w + h * force / inertia - v), -half, half)
    speed = v + (after - g) / h
    return force - handle.inertia * (speed - w) / h, after, speed


def end_stop(
    own: EndStops, low: Array, inertia: Array, h: Array | float
) -> tuple[Array, Array, Array, Array]:
    """The row of an end stop with a restitution of its own.

    Args:
        own: the joint's.
        low: whether it is the low end.
        inertia: of the joint, kg·m².
        h: timestep, s.

    Returns:
        whether the end has one; if so D of its row, kg·m², and the stiffness, 1/s², and damping,
        1/s, of its reference acceleration.
    """
    damping = jnp.where(low, own.low, own.high)
    D = IMPEDANCE / (1 - IMPEDANCE) * inertia
    return damping >= 0, D, jnp.asarray(STIFFNESS / h**2), damping / (IMPEDANCE * h)


def _along(own: Directed, s: Array, v: Array) -> Array:
    """The curve's value in the direction of the motion; 0 at rest."""
    up, down = _value(own.positive, s), _value(own.negative, s)
    return jnp.where(v >= STILL, up, jnp.where(v <= -STILL, down, 0))


def _stribeck(own: Stribeck, s: Array, v: Array) -> Array:
    """e(s) exp(-(|v| / velocity)^exponent); the logarithm keeps derivatives finite."""
    x = jnp.abs(v) / own.velocity
    moves = x > 0
    power = jnp.minimum(own.exponent * jnp.log(jnp.where(moves, x, 1)), FADED)
    return _value(own.curve, s) * jnp.exp(-jnp.where(moves, jnp.exp(power), 0))


def _plastic(breakaway: Array, r: Array) -> Array:
    """How far bristles slip that carry the part r of their largest force (Dupont et al. 2002)."""
    width = jnp.where(breakaway < 1, 1 - breakaway, 1)
    rising = 0.5 + 0.5 * jnp.sin(jnp.pi * (r - 0.5 * (1 + breakaway)) / width)
    return jnp.where((breakaway == 0) | (r >= 1), 1, jnp.where(r <= breakaway, 0, rising))


def _value(curve: Curve, s: Array) -> Array:
    return jaxfield.evaluate(curve, s)[0]
