"""The laws of the effects beyond the three channels, as in cpp/effects.h, for one joint.

Units are those of a hinge; for a slide read N, m and kg.
"""

import warp as wp

from joda.scenes.limits import IMPEDANCE, STIFFNESS

STILL = wp.constant(1e-6)
"""Speed below which a joint counts as still: float32's rounding, larger than in cpp/effects.h."""
MAX_COST = wp.constant(1e3)
"""Largest bound² / D of a row of bristles: beside it float32 still resolves the others' cost."""
MIN_BRISTLE = wp.constant(1e-6)
"""As kMinBristleStiffness in cpp/effects.h, and so on."""
MIN_IN_ROW = wp.constant(0.05)
HEAVIEST_LOAD = wp.constant(0.95)
EXPLICIT_STIFFNESS = wp.constant(1.0)
"""As kExplicitStiffness in cpp/stiffness.h, and so on."""
STRIDE = wp.constant(0.25)
STIFF_ROW = wp.constant(1e4)
IDLE_ROW = wp.constant(1e-12)
STOP_STIFFNESS = wp.constant(float(STIFFNESS))
STOP_IMPEDANCE = wp.constant(IMPEDANCE)


@wp.struct
class Passage:
    """What a load behind a play makes of the joint's step: as Passage in cpp/effects.h."""

    side: float
    scale: float
    resistance: float
    force: float
    gap: float
    speed: float


@wp.func
def sign(x: float) -> float:
    """-1, 0 or 1."""
    return wp.where(x > 0.0, 1.0, wp.where(x < 0.0, -1.0, 0.0))


@wp.func
def stop_damping(rebounds: wp.array[float], restitution: float) -> float:
    """Damping of an end stop, times the timestep: as StopDamping in cpp/end_stop.h.

    `rebounds` has the restitution of a damping of 0 to 1 in equal steps; it falls.
    """
    last = rebounds.shape[0] - 1
    if restitution <= rebounds[last]:
        return 1.0
    below = int(0)
    above = int(last)
    while above - below > 1:
        middle = (below + above) / 2
        if rebounds[middle] > restitution:
            below = middle
        else:
            above = middle
    share = (rebounds[below] - restitution) / (rebounds[below] - rebounds[above])
    return (float(below) + wp.max(share, 0.0)) / float(last)


@wp.func
def stribeck_friction(excess: float, velocity: float, exponent: float, v: float) -> float:
    """Friction above Coulomb's that fades as the joint moves at v, N·m."""
    if excess <= 0.0:
        return 0.0
    return excess * wp.exp(-wp.pow(wp.abs(v) / velocity, exponent))


@wp.func
def bristle_stiffness_scale(breakaway: float, held: float, bound: float, v: float) -> float:
    """Part of the bristles' stiffness that is left where they hold `held` within +-bound."""
    against = wp.where(wp.abs(v) < STILL, 0.0, -held * sign(v))
    r = wp.where(bound > 0.0, wp.clamp(against / bound, -1.0, 1.0), 0.0)
    alpha = 0.5 + 0.5 * wp.sin(wp.pi * (r - 0.5 * (1.0 + breakaway)) / (1.0 - breakaway))
    if breakaway == 0.0 or r >= 1.0:
        alpha = 1.0
    elif r <= breakaway:
        alpha = 0.0
    return wp.max(MIN_BRISTLE, 1.0 - alpha * r)


@wp.func
def bristle_stiffness_scale_in_row(
    left: float, h: float, stiffness: float, inertia: float
) -> float:
    """D of the friction row where `left` of the bristles' stiffness is left, kg·m²."""
    in_row = wp.max(left, MIN_IN_ROW - inertia / (h * h * stiffness))
    if left <= MIN_BRISTLE:
        in_row = 1.0
    return wp.clamp(h * h * stiffness * in_row, IDLE_ROW * inertia, STIFF_ROW * inertia)


@wp.func
def coast(inertia: float, h: float, force: float, against: wp.vec3, v: float) -> float:
    """Velocity after a step of a mass by itself; `against`: damping, friction up and down."""
    mass = inertia + h * against[0]
    free = (inertia * v + h * force) / mass
    if free > 0.0:
        return wp.max(0.0, free - h * against[1] / mass)
    return wp.min(0.0, free + h * against[2] / mass)


@wp.func
def alone() -> Passage:
    """A joint without a load behind it."""
    out = Passage()
    out.scale = 1.0
    out.resistance = 1.0
    return out


@wp.func
def meet(
    play: float,
    load: float,
    share: float,
    h: float,
    inertia: float,
    force: float,
    v: float,
    own: wp.vec3,
    spring: float,
    other: wp.vec3,
    gap: float,
    speed: float,
) -> Passage:
    """Whether joint and load move together in a step: if they overlapped after one apart."""
    half = 0.5 * play
    part = wp.max(inertia - load, (1.0 - HEAVIEST_LOAD) * inertia)
    out = alone()
    out.gap = wp.clamp(gap, -half, half)
    out.speed = coast(load, h, 0.0, share * other, v + speed)
    rest = (1.0 - share) * own + wp.vec3(spring, 0.0, 0.0)
    ahead = out.gap + h * (out.speed - coast(part, h, force, rest, v))
    if wp.abs(ahead) >= half:
        out.side = sign(ahead)
        out.force = load * speed / h
    else:
        out.scale = inertia / part
        out.resistance = out.scale * (1.0 - share)
    return out


@wp.func
def settle(play: float, h: float, side: float, gap: float, speed: float, v: float) -> wp.vec2:
    """Gap and speed of the load after a step, at whose end the joint moves at v."""
    half = 0.5 * play
    ahead = speed - v
    if side != 0.0 and side * ahead >= 0.0:
        return wp.vec2(side * half, 0.0)
    return wp.vec2(wp.clamp(gap + h * ahead, -half, half), ahead)


@wp.func
def backlash_force(
    play: float, inertia: float, h: float, applied: float, v: float, gap: float, speed: float
) -> wp.vec3:
    """A step of the handle before the joint: its force on the joint, its gap and its speed."""
    half = 0.5 * play
    start = wp.clamp(gap, -half, half)
    after = wp.clamp(start + h * (speed + h * applied / inertia - v), -half, half)
    moved = v + (after - start) / h
    return wp.vec3(applied - inertia * (moved - speed) / h, after, moved)


@wp.func
def resisting(dry: float, drag: float, v: float, h: float, inertia: float) -> float:
    """What has no row, as a force that at most stops the joint within the step, N·m."""
    speed = wp.abs(v)
    resistance = dry + drag * speed / (1.0 + h * drag / inertia)
    return -sign(v) * wp.min(resistance, inertia * speed / h)
