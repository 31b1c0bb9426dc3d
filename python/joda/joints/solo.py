"""One joint by itself, in JAX: the physics step of MuJoCo with the plugin, solved in closed form.

With all other joints held, a step's constraint problem has one unknown, the joint's acceleration,
and at most three rows: dry friction, damping, an end of the range. Its optimality condition is
increasing and piecewise linear, so its solution can be written down; MuJoCo and MJX find the same
by iteration. That makes whole measured runs differentiable in milliseconds.
"""

from dataclasses import dataclass, field, replace
from functools import partial

import jax
import jax.numpy as jnp
import mujoco

from joda.field import jaxeffects, jaxfield
from joda.field.jaxeffects import Effects, from_effects
from joda.joints import laws
from joda.joints.parameters import Slot
from joda.joints.rig import gravity_factors
from joda.joints.stiffness import implicit_stiffness, reach, stays_beyond
from joda.profile import CHANNELS, Profile
from joda.scenes.context import Context

Array = jax.Array

MIN_IMPEDANCE, MAX_IMPEDANCE = 1e-4, 0.9999
"""mjMINIMP, mjMAXIMP."""
ONLY_SLIDES = 2
"""In `mjModel.body_simple`."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=(
        *("conservative", "friction", "damping", "range", "inertia", "gravity", "solref", "solimp"),
        *("effects", "seen"),
    ),
    meta_fields=("hinge",),
)
@dataclass(frozen=True)
class Solo:
    """A joint with its profile.

    Attributes:
        conservative, friction, damping: the channels, N or N·m and per m/s or rad/s.
        range: ends of the range, rad or m, shape (2,).
        inertia: kg·m² or kg, without the added inertia among the effects.
        gravity: hinge: factors of cos q and sin q of gravity's torque, N·m; slide: force and 0.
            Shape (2,).
        solref: time constant (s) and damping ratio of the range's ends, or minus their stiffness
            (1/s²) and damping (1/s), shape (2,); but for those with a restitution of their own.
        solimp: their impedance, shape (5,).
        effects: beyond the three channels.
        seen: what MuJoCo's rows take for the inertia of a body that only slides: its mass, without
            armature (kg); None of others, where they take all.
        hinge: whether it is a hinge.
    """

    conservative: jaxfield.Channel
    friction: jaxfield.Channel
    damping: jaxfield.Channel
    range: Array
    inertia: Array
    gravity: Array
    solref: Array
    solimp: Array
    effects: Effects
    seen: Array | None
    hinge: bool


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class State:
    """What a step begins with.

    Attributes:
        q: position, rad or m.
        v: velocity.
        held: friction force of the step before, N·m or N.
        g: with backlash, position of the handle or the load minus that of the part.
        w: with backlash, velocity of the handle, or of the load minus that of the part.
    """

    q: Array
    v: Array
    held: Array
    g: Array = field(default_factory=lambda: jnp.zeros(()))
    w: Array = field(default_factory=lambda: jnp.zeros(()))


Prepared = tuple[Solo, jaxfield.Cubics, jaxfield.Cubics, jaxfield.Cubics]


def from_context(
    context: Context,
    profile: Profile,
    model: mujoco.MjModel,
    joint: int,
    *,
    attached: bool = False,
) -> Solo:
    """The joint of a model with a profile.

    Args:
        context: the joint's.
        profile: of the joint.
        model: compiled; the solver parameters of the joint's ends are taken from it.
        joint: its id in the model.
        attached: whether the context is that of a scene to which the profile is attached: then its
            inertia holds the profile's added inertia.
    """
    effects = from_effects(profile.effects)
    inertia = jnp.array(context.equivalent_inertia)
    if attached and effects.added_inertia is not None:
        inertia = inertia - effects.added_inertia.inertia
    slides = model.body_simple[model.jnt_bodyid[joint]] == ONLY_SLIDES
    hinge = context.joint.type == "hinge"
    channels = {name: jaxfield.from_channel(getattr(profile.channels, name)) for name in CHANNELS}
    return Solo(
        **channels,
        range=jnp.array(profile.joint.range),
        inertia=inertia,
        gravity=jnp.array(gravity_factors(context) if hinge else (context.gravity_force[0], 0.0)),
        solref=jnp.array(model.jnt_solref[joint]),
        solimp=jnp.array(model.jnt_solimp[joint]),
        effects=effects,
        seen=jnp.array(1 / model.dof_invweight0[model.jnt_dofadr[joint]]) if slides else None,
        hinge=hinge,
    )


def changed(first: Solo, slots: tuple[Slot, ...], values: jax.Array) -> Solo:
    """The joint with other numbers; differentiable.

    Args:
        first: the joint as it was.
        slots: what each number is.
        values: the numbers times their scales, shape (n,).
    """
    channels: dict[str, dict[str, jax.Array]] = {
        name: {part: getattr(getattr(first, name), part) for part in ("a", "b", "y", "strength")}
        for name in CHANNELS
    }
    solref, inertia, gravity = first.solref, first.inertia, first.gravity
    for k, slot in enumerate(slots):
        if slot.kind == "values":
            y = channels[slot.channel]["y"]
            channels[slot.channel]["y"] = y.at[slot.component, slot.index].set(values[k])
        elif slot.kind == "intervals":
            part = "ab"[slot.index]
            ends = channels[slot.channel][part]
            channels[slot.channel][part] = ends.at[slot.component].set(values[k])
        elif slot.kind == "strengths":
            channels[slot.channel]["strength"] = values[k]
        elif slot.kind == "damping_ratio":
            solref = solref.at[1].multiply(jnp.exp(values[k]))
        elif slot.kind == "inertia":
            inertia = inertia * jnp.exp(values[k])
        else:
            gravity = gravity.at[slot.index].add(values[k])
    parts = {name: replace(getattr(first, name), **channels[name]) for name in CHANNELS}
    return replace(first, **parts, solref=solref, inertia=inertia, gravity=gravity)


def prepare(joint: Solo) -> Prepared:
    """Does once what does not depend on the state."""
    return (
        replace(joint, effects=jaxeffects.prepare(joint.effects)),
        jaxfield.prepare(joint.conservative, pieces=True),
        jaxfield.prepare(joint.friction),
        jaxfield.prepare(joint.damping),
    )


def step(prepared: Prepared, state: State, force: Array, h: float) -> State:
    """One step of semi-implicit Euler.

    Args:
        prepared: the joint.
        state: before.
        force: applied from outside, N·m or N.
        h: timestep, s.

    Returns:
        the state after.
    """
    joint, conservative, friction, damping = prepared
    own, q, v = joint.effects, state.q, state.v
    lo, hi = joint.range[0], joint.range[1]
    span, (inertia, seen) = hi - lo, _inertia(joint)
    s = (q - lo) / span
    lifted, descent = laws.gravity(own.gravity_offset, q)
    spring = jaxfield.evaluate(conservative, s)[0] + lifted
    far = reach(v, spring, seen, 1 / span, h)
    near = jaxfield.max_descent(conservative, s - far, s + far)
    constant = stays_beyond(s, v, spring, seen, 1 / span, h)
    stiffness = h * implicit_stiffness(spring, near, descent, constant, seen, 1 / span, h)
    weight = _weight(joint, q)
    channels = jaxfield.evaluate(damping, s)[0], jaxfield.evaluate(friction, s)[0]

    def resistance(velocity: Array) -> laws.Resistance:
        return laws.resistance(own, *channels, s, velocity, weight + force)

    whole = resistance(v)
    passage = laws.meet(
        *(own.backlash, state.g, state.w, v, inertia, spring + weight + force, whole, stiffness),
        resistance(v + state.w),
        h,
    )
    drag, up, down = whole.part(passage.resistance)
    bound = 0.5 * (up + down)
    held = jnp.clip(state.held, -bound, bound)
    stiff, bristles = laws.friction_row(
        own.presliding_friction, held, bound, v, seen, h, passage.resistance
    )
    drag = drag + passage.scale * stiffness + bristles
    pushed, g, w = laws.backlash(own.backlash, state.g, state.w, v, force, h)
    drive = passage.scale * (spring + weight + pushed) + passage.force + 0.5 * (down - up)

    # Optimality: mass * a = drive + friction(a) + limit(a); mass and drive hold the damping row.
    mass = inertia + h * drag
    drive = drive - drag * v
    # friction(a) = clamp(offset - stiff a, -bound, bound)
    offset = held - stiff * v / h
    sign, D, reference = _limit(joint, q, v, s, h)

    def solved(extra_mass: Array, extra_drive: Array) -> tuple[Array, Array]:
        """Acceleration and friction force, with or without the limit's row."""
        m, f = mass + extra_mass, drive + extra_drive
        stuck = (f + offset) / (m + stiff)
        up, down = (f + bound) / m, (f - bound) / m
        at_stuck = offset - stiff * stuck
        a = jnp.where(at_stuck > bound, up, jnp.where(at_stuck < -bound, down, stuck))
        return a, jnp.clip(at_stuck, -bound, bound)

    free, force_free = solved(jnp.zeros_like(mass), jnp.zeros_like(mass))
    held_back, force_back = solved(D, D * sign * reference)
    pushes = (D > 0) & (sign * free - reference < 0)
    a = jnp.where(pushes, held_back, free)
    after = v + h * a
    g, w = laws.settle(own.backlash, passage, g, w, after, h)
    return State(q + h * after, after, jnp.where(pushes, force_back, force_free), g, w)


def _inertia(joint: Solo) -> tuple[Array, Array]:
    """With the added inertia, and what of it MuJoCo's rows see; kg·m² or kg."""
    added = joint.effects.added_inertia
    whole = joint.inertia if added is None else joint.inertia + added.inertia
    return whole, whole if joint.seen is None else joint.seen


def _weight(joint: Solo, q: Array) -> Array:
    """Gravity's force, N·m or N."""
    if joint.hinge:
        return joint.gravity[0] * jnp.cos(q) + joint.gravity[1] * jnp.sin(q)
    return joint.gravity[0]


def _limit(joint: Solo, q: Array, v: Array, s: Array, h: float) -> tuple[Array, Array, Array]:
    """The row of the end that is overstepped: sign, D (0: none), reference acceleration.

    MuJoCo's solver parameters, as in "Solver parameters" of its documentation.
    """
    lo, hi = joint.range[0], joint.range[1]
    low = s < 0.5
    sign = jnp.where(low, 1.0, -1.0)
    distance = jnp.where(low, q - lo, hi - q)
    first, second = joint.solref[0], joint.solref[1]
    dmin, dmax, width, mid, power = (joint.solimp[k] for k in range(5))
    dmin, dmax, mid = (jnp.clip(x, MIN_IMPEDANCE, MAX_IMPEDANCE) for x in (dmin, dmax, mid))
    x = jnp.minimum(jnp.abs(distance) / width, 1.0)
    below = jnp.where(x < mid, x, mid) / mid
    above = (1 - jnp.where(x < mid, mid, x)) / (1 - mid)
    rise = jnp.where(x < mid, mid * below**power, 1 - (1 - mid) * above**power)
    impedance = dmin + rise * (dmax - dmin)
    # a time constant is at least two steps: the engine's "refsafe"
    constant, ratio = (jnp.where(first > 0, x, 1.0) for x in (jnp.maximum(first, 2 * h), second))
    stiffness = jnp.where(first > 0, 1 / (constant * ratio) ** 2, -first) / dmax**2
    damping = jnp.where(first > 0, 2 / constant, -second) / dmax
    inertia = _inertia(joint)[1]
    D, stiffness = impedance / (1 - impedance) * inertia, stiffness * impedance
    if (stops := joint.effects.end_stop_restitution) is not None:
        has, *own = laws.end_stop(stops, low, inertia, h)
        scenes = D, stiffness, damping
        D, stiffness, damping = (
            jnp.where(has, one, other) for one, other in zip(own, scenes, strict=True)
        )
    D = jnp.where(distance < 0, D, 0.0)
    return sign, D, -damping * sign * v - stiffness * distance


def rollout(joint: Solo, start: State, force: Array, h: float) -> Array:
    """Positions of the joint under a force.

    Args:
        joint: the joint.
        start: its state at first.
        force: applied from outside at each step, N·m or N, shape (n,).
        h: timestep, s.

    Returns:
        positions before the first step and after each, rad or m, shape (n + 1,).
    """
    prepared = prepare(joint)

    def advance(state: State, applied: Array) -> tuple[State, Array]:
        after = step(prepared, state, applied, h)
        return after, after.q

    _, positions = jax.lax.scan(advance, start, force)
    return jnp.concatenate([start.q[None], positions])
