"""The laws of the effects beyond the three channels, in JAX: as in cpp/effects.h.

For one joint: numbers in, numbers out. An effect that is None is not computed. Units are those of a
hinge; for a slide read N, m and kg.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from joda.field import jaxfield, jaxtable
from joda.field.jaxeffects import (
    Backlash,
    Curve,
    Directed,
    Effects,
    EndStops,
    GravityOffset,
    Learned,
    Presliding,
    Stribeck,
)
from joda.joints.stiffness import IDLE_ROW, STIFF_ROW
from joda.scenes.limits import IMPEDANCE, STIFFNESS

Array = jax.Array

SLIPPING = 1e-6
"""Part of the bristles' stiffness that is left while they slip."""
MIN_SHARE = 0.05
"""Part of it that is left in the row where it is far stiffer than the step resolves."""
STILL = 1e-9
"""As kStill in cpp/effects.h."""
HEAVIEST_LOAD = 0.95
"""As kHeaviestLoad in cpp/effects.h."""
NOTHING = 1e-30
"""Less than any number that matters."""
FADED = 6.0
"""ln (|v| / velocity)^exponent at which Stribeck's friction is gone: exp(-exp(6)) = 6e-176."""


class Resistance(NamedTuple):
    """Damping, N·m·s/rad; largest friction in positive and in negative motion, N·m."""

    drag: Array
    up: Array
    down: Array

    def part(self, share: Array | float) -> "Resistance":
        """A share of it."""
        return Resistance(share * self.drag, share * self.up, share * self.down)


class Passage(NamedTuple):
    """What a load behind a play makes of the joint's step.

    Attributes:
        side: of the joint, at which it moves the load: 1, -1, or 0 for none.
        scale: of the known forces on the joint: where it moves alone, the inertia is too large.
        resistance: of friction and damping.
        force: besides: the load's blow, N·m.
        g: the load's position minus the joint's before the step, rad.
        w: velocity of the load after the step, by itself, rad/s.
    """

    side: Array
    scale: Array
    resistance: Array
    force: Array
    g: Array
    w: Array


def resistance(
    own: Effects, drag: Array, dry: Array, s: Array, v: Array, load: Array
) -> Resistance:
    """Damping and friction.

    Args:
        own, s, v: as for `extra_damping`.
        drag, dry: of the channels, N·m·s/rad and N·m.
        load: as for `friction_bounds`.
    """
    up, down = friction_bounds(own, s, v, load)
    return Resistance(drag + extra_damping(own, s, v), dry + up, dry + down)


def extra_damping(own: Effects, s: Array, v: Array) -> Array:
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


def friction_bounds(own: Effects, s: Array, v: Array, load: Array) -> tuple[Array, Array]:
    """What is added to the largest friction in positive and in negative motion, N·m.

    Args:
        own, s, v: as for `extra_damping`.
        load: gravity's force on the joint and the force that is applied to it, N·m.
    """
    both = jnp.zeros_like(v)
    if own.stribeck_friction is not None:
        both = both + _stribeck_friction(own.stribeck_friction, s, v)
    if own.load_dependent_friction is not None:
        both = both + own.load_dependent_friction.coefficient * jnp.abs(load)
    sides = own.asymmetric_friction
    if sides is None:
        return both, both
    return both + _value(sides.positive, s), both + _value(sides.negative, s)


def stiffen_friction_row(
    bristles: Presliding | None,
    held: Array,
    bound: Array,
    v: Array,
    inertia: Array,
    h: Array | float,
    part: Array | float = 1.0,
) -> tuple[Array, Array]:
    """How stiff friction's row is, and what it adds to the damping (N·m·s/rad).

    Args:
        bristles: None: none.
        held: the row's force in the step before, within the bound, N·m.
        bound: its largest, N·m.
        v: velocity before the step, rad/s.
        inertia: of the joint, kg·m².
        h: timestep, s.
        part: of the bristles that is there.

    Returns:
        D of the row, kg·m², and the damping.
    """
    stiff = STIFF_ROW * inertia
    if bristles is None:
        return stiff, jnp.zeros_like(v)
    direction = jnp.where(jnp.abs(v) < STILL, 0, jnp.sign(v))
    r = jnp.clip(-held * direction / jnp.where(bound > 0, bound, 1), -1, 1)
    left = jnp.maximum(1 - _dupont_alpha(bristles.breakaway, r) * r, SLIPPING)
    resolved = jnp.maximum(h * h * (part * bristles.stiffness), NOTHING)
    # The row must also stop a part that turns back within the step. While it slips the bound gives
    # the law's force, so that all of the stiffness can be there; else what is too stiff for the
    # step keeps a share.
    in_row = jnp.maximum(left, MIN_SHARE - inertia / resolved)
    in_row = jnp.where(left <= SLIPPING, 1, in_row)
    D = jnp.clip(resolved * in_row, IDLE_ROW * inertia, stiff)
    return D, part * bristles.damping * left


def gravity_force(offset: GravityOffset | None, q: Array) -> tuple[Array, Array]:
    """A gravity offset's force at q (rad), N·m, and its largest stiffness, N·m/rad."""
    if offset is None:
        return jnp.zeros_like(q), jnp.zeros_like(q)
    square = offset.sin**2 + offset.cos**2
    steepest = jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1)), 0)
    return offset.sin * jnp.sin(q) + offset.cos * jnp.cos(q) + offset.force, steepest


def learned_force(
    own: Learned | None, s: Array, v: Array, remembered: Array, h: Array | float
) -> tuple[Array, Array]:
    """A learned force in a step: push - drag times the velocity after the step.

    Args:
        own: None: none.
        s, v: as for `extra_damping`.
        remembered: see `remember`.
        h: timestep, s.

    Returns:
        push, N·m, and drag, N·m·s/rad; why it is such: cpp/effects.h.
    """
    if own is None:
        return jnp.zeros_like(v), jnp.zeros_like(v)
    factor = jnp.maximum(0, 1 + own.change * remembered)
    value, slope = (factor * part for part in jaxtable.resistance(own.table, s, v))
    rests = jnp.abs(v) < STILL
    chord = jnp.where(rests, slope, value / jnp.where(rests, 1, v))
    drag = jnp.maximum(0, jnp.maximum(chord, slope))
    gone = -jnp.expm1(-h / own.time)
    push = drag * v - value - own.stiffness * (1 - gone) * remembered
    return push, drag + own.stiffness * gone * own.time


def remember(own: Learned | None, v: Array, remembered: Array, h: Array | float) -> Array:
    """What a learned force remembers after a step.

    Args:
        own: None: the same as before.
        v: velocity after the step, rad/s.
        remembered: before the step: of position a stretch, rad; of speed its mean, rad/s.
        h: timestep, s.
    """
    if own is None:
        return remembered
    toward = jnp.where(own.follows > 0.5, own.time * v, jnp.abs(v))
    return remembered - jnp.expm1(-h / own.time) * (toward - remembered)


def backlash_force(
    handle: Backlash | None, g: Array, w: Array, v: Array, force: Array, h: Array | float
) -> tuple[Array, Array, Array]:
    """A step of a handle before the joint.

    Args:
        handle: None, or without inertia: the force acts on the part.
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
    is_there = handle.handle > 0
    inertia = jnp.where(is_there, handle.handle, 1)
    after = jnp.clip(g + h * (w + h * force / inertia - v), -half, half)
    speed = v + (after - g) / h
    on_part = force - handle.handle * (speed - w) / h
    return on_part, jnp.where(is_there, after, g), jnp.where(is_there, speed, w)


def meet(
    behind: Backlash | None,
    g: Array,
    w: Array,
    v: Array,
    inertia: Array,
    force: Array,
    own: Resistance,
    spring: Array,
    other: Resistance,
    h: Array | float,
) -> Passage:
    """Whether the joint and the load behind it move together in a step.

    They do if they overlapped after a step by themselves.

    Args:
        behind: None, or without a load: the joint moves as it is.
        g: the load's position minus the joint's, rad.
        w: its velocity minus the joint's, rad/s.
        v: velocity of the joint before the step, rad/s.
        inertia: of both, kg·m².
        force: what is known to act on the joint, N·m.
        own, other: resistance at the joint's velocity and at the load's.
        spring: more damping of the joint alone, N·m·s/rad.
        h: timestep, s.
    """
    still, one = jnp.zeros_like(v), jnp.ones_like(v)
    if behind is None:
        return Passage(still, one, one, still, still, still)
    half, is_there = 0.5 * behind.play, behind.load > 0
    part = jnp.maximum(inertia - behind.load, (1 - HEAVIEST_LOAD) * inertia)
    load = jnp.where(is_there, behind.load, 1)
    g = jnp.clip(g, -half, half)
    after = _coast(load, still, other.part(behind.share), v + w, h)
    alone = own.part(1 - behind.share)
    alone = alone._replace(drag=alone.drag + spring)
    ahead = g + h * (after - _coast(part, force, alone, v, h))
    touches = (jnp.abs(ahead) >= half) | ~is_there
    scale = jnp.where(touches, 1, inertia / part)
    left = jnp.where(touches, 1, scale * (1 - behind.share))
    blow = jnp.where(touches, behind.load * w / h, 0)
    return Passage(jnp.where(touches, jnp.sign(ahead), 0), scale, left, blow, g, after)


def settle(
    behind: Backlash | None, passage: Passage, g: Array, w: Array, v: Array, h: Array | float
) -> tuple[Array, Array]:
    """The load after a step, at whose end the joint moves at v; g and w as for `meet`.

    Where they met, it is left behind only if it is slower. Without a load both stay as they are.
    """
    if behind is None:
        return g, w
    half, is_there = 0.5 * behind.play, behind.load > 0
    ahead = passage.w - v
    stays = (passage.side * ahead >= 0) & (passage.side != 0)
    after = jnp.clip(passage.g + h * ahead, -half, half)
    after, ahead = jnp.where(stays, passage.side * half, after), jnp.where(stays, 0, ahead)
    return jnp.where(is_there, after, g), jnp.where(is_there, ahead, w)


def _coast(inertia: Array, force: Array, against: Resistance, v: Array, h: Array | float) -> Array:
    """Velocity after a step of a mass by itself, which friction may stop."""
    mass = inertia + h * against.drag
    free = (inertia * v + h * force) / mass
    up, down = jnp.maximum(free - h * against.up / mass, 0), free + h * against.down / mass
    return jnp.where(free > 0, up, jnp.minimum(down, 0))


def stop_row(
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


def _stribeck_friction(own: Stribeck, s: Array, v: Array) -> Array:
    """e(s) exp(-(|v| / velocity)^exponent); the logarithm keeps derivatives finite."""
    x = jnp.abs(v) / own.velocity
    moves = x > 0
    power = jnp.minimum(own.exponent * jnp.log(jnp.where(moves, x, 1)), FADED)
    return _value(own.curve, s) * jnp.exp(-jnp.where(moves, jnp.exp(power), 0))


def _dupont_alpha(breakaway: Array, r: Array) -> Array:
    """How far bristles slip that carry the part r of their largest force (Dupont et al. 2002)."""
    width = jnp.where(breakaway < 1, 1 - breakaway, 1)
    rising = 0.5 + 0.5 * jnp.sin(jnp.pi * (r - 0.5 * (1 + breakaway)) / width)
    return jnp.where((breakaway == 0) | (r >= 1), 1, jnp.where(r <= breakaway, 0, rising))


def _value(curve: Curve, s: Array) -> Array:
    return jaxfield.evaluate(curve, s)[0]
