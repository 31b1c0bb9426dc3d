"""The plugin's law in JAX: forces and rows of all joints that carry a profile."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from joda.field import jaxfield
from joda.field.jaxeffects import EndStops
from joda.joints import laws
from joda.joints.stiffness import IDLE_ROW, implicit_stiffness, reach, stays_beyond
from joda.mjx.fields import Prepared
from joda.mjx.internals import Last, Rows, Settle
from joda.mjx.state import pack, unpack
from joda.profile import CHANNELS

Array = jax.Array


def act(m: mjx.Model, d: mjx.Data, last: Last, prepared: Prepared) -> tuple[mjx.Data, Settle]:
    """The plugin's compute: forces and rows of all joints, from the state before the step.

    Args:
        m: model.
        d: the state, with its rows and passive forces made.
        last: the forces of the step before.
        prepared: the fields.

    Returns:
        the state, and what moves loads behind plays, and memories, once the step is taken.
    """
    off, bit = m.opt.disableflags, mjx.DisableBit
    spring, damper = not off & bit.SPRING, not off & bit.DAMPER
    if not (spring or damper):  # MuJoCo skips all passive forces then
        return d, lambda d: d
    index = {
        key: np.array([getattr(place, key) for place in prepared.places])
        for key in vars(prepared.places[0])
    }
    dof, h, own = index["dof"], m.opt.timestep, prepared.effects
    inertia, v, q = 1 / m.dof_invweight0[dof], d.qvel[dof], d.qpos[index["qpos"]]
    lo, hi = prepared.range[:, 0], prepared.range[:, 1]
    per_range = 1 / (hi - lo)
    s = (q - lo) * per_range
    order = dict(zip(CHANNELS, prepared.orders, strict=True))

    force, descent = jax.vmap(laws.gravity_force)(own.gravity_offset, q)
    near, damping, dry = (jnp.zeros_like(v) for _ in range(3))
    if spring:
        stacks = prepared.conservative
        force = force + _each(stacks, order["conservative"], jaxfield.evaluate, s)[0]
        far = reach(v, force, inertia, per_range, h)
        near = _each(stacks, order["conservative"], jaxfield.max_stiffness, s - far, s + far)
    constant = stays_beyond(s, v, force, inertia, per_range, h)
    stiffness = implicit_stiffness(force, near, descent, constant, inertia, per_range, h)
    if damper:
        damping = _each(prepared.damping, order["damping"], jaxfield.evaluate, s)[0]
    if not off & bit.FRICTIONLOSS:
        dry, _ = _each(prepared.friction, order["friction"], jaxfield.evaluate, s)
        dry = dry + m.dof_frictionloss[dof]
    g, w, remembered = unpack(m, d, own, len(dof))
    yielding = h * stiffness
    if damper:
        every = jax.vmap(laws.learned_force, in_axes=(0, 0, 0, 0, None))
        learned, slows = every(own.learned_force, s, v, remembered, h)
        force, yielding = force + learned, yielding + slows
    external = load = jnp.zeros_like(v)
    if own.load_dependent_friction is not None or own.backlash is not None:
        external = _external(m, d, index["joint"], dof)
    if own.load_dependent_friction is not None:
        rows_of_own = [index[f"{kind}_row"] for kind in ("friction", "damping", "limit")]
        load = external + last.unknown_load(dof, np.array(rows_of_own))

    def resistance(v: Array) -> laws.Resistance:
        whole = jax.vmap(laws.resistance)(own, damping, dry, s, v, load)
        if not damper:
            whole = whole._replace(drag=damping)
        if off & bit.FRICTIONLOSS:
            whole = whole._replace(up=dry, down=dry)
        return whole

    whole, other = resistance(v), resistance(v + w)
    meet = jax.vmap(laws.meet, in_axes=(*[0] * 9, None))
    passage = meet(
        own.backlash, g, w, v, m.dof_M0[dof], force + external, whole, yielding, other, h
    )
    drag, up, down = jax.vmap(laws.Resistance.part)(whole, passage.resistance)
    force, yielding = passage.scale * force, passage.scale * yielding
    drag = drag + yielding

    rows, at = Rows(d), np.flatnonzero(index["friction_row"] >= 0)
    row = index["friction_row"][at]
    bound = 0.5 * (up + down)[at]
    psi = jnp.clip(last.force[row], -bound, bound)
    bristles = jax.tree.map(lambda x: x[at], own.presliding_friction)
    stiff = jax.vmap(laws.stiffen_friction_row, in_axes=(0, 0, 0, 0, 0, None, 0))
    D, slipping = stiff(bristles, psi, bound, v[at], inertia[at], h, passage.resistance[at])
    rows.set(row, D, bound, psi, v[at] / h)
    if damper:
        drag = drag.at[at].add(slipping)
    shift = jnp.zeros_like(v).at[at].set(0.5 * (down - up)[at])  # as the row is symmetric
    up, down = up.at[at].set(0), down.at[at].set(0)

    at = np.flatnonzero(index["damping_row"] >= 0)
    row, on = index["damping_row"][at], d.eq_active[index["equality"][at]] != 0
    D = jnp.maximum(h * drag[at], IDLE_ROW * inertia[at])
    rows.set(row, D, 0, 0, v[at] / h)
    held = jnp.zeros(len(dof), bool).at[at].set(on)
    if own.end_stop_restitution is not None:
        at = np.flatnonzero(index["limit_row"] >= 0)
        stops = jax.tree.map(lambda x: x[at], own.end_stop_restitution)
        _set_stops(rows, index["limit_row"][at], dof[at], stops, v[at], inertia[at], h)
    force = jnp.where(held, force, force / (1 + h * yielding / inertia))
    drag = jnp.where(held, 0, drag)

    # what has no row becomes a force that at most stops the joint within the step
    stop, dry = inertia * jnp.abs(v) / h, jnp.where(v < 0, down, up)
    limited = jnp.minimum(dry + drag * jnp.abs(v) / (1 + h * drag / inertia), stop)
    force = force + shift - jnp.sign(v) * limited
    force = force + passage.force + (passage.scale - 1) * external
    applied = d.qfrc_applied[dof]
    push = jax.vmap(laws.backlash_force, in_axes=(0, 0, 0, 0, 0, None))
    pushed, g, w = push(own.backlash, g, w, v, applied, h)
    d = rows.write(d)
    d = d.replace(qfrc_passive=d.qfrc_passive.at[dof].add(force + pushed - applied))
    after = jax.vmap(laws.settle, in_axes=(0, 0, 0, 0, 0, None))

    def settle(d: mjx.Data) -> mjx.Data:
        loose = after(own.backlash, passage, g, w, d.qvel[dof], h)
        recall = jax.vmap(laws.remember, in_axes=(0, 0, 0, None))
        return pack(m, d, own, *loose, recall(own.learned_force, d.qvel[dof], remembered, h))

    return d, settle


def _set_stops(
    rows: Rows, row: Any, dof: Any, stops: EndStops, v: Array, inertia: Array, h: Array
) -> None:
    """Sets the rows of joints beyond an end of the range that has a restitution of its own.

    Args:
        rows: of the step.
        row, dof: of the joints.
        stops: theirs.
        v: their velocities, rad/s.
        inertia: theirs, kg·m².
        h: timestep, s.
    """
    side = rows.J[row, dof]  # 1: beyond the low end, -1: the high one, 0: neither
    has, D, stiffness, damping = laws.stop_row(stops, side > 0, inertia, h)
    reference = -damping * side * v - stiffness * rows.pos[row]
    rows.limit(row, has & (side != 0), D, reference)


def _external(m: mjx.Model, d: mjx.Data, joint: Any, dof: Any) -> Array:
    """Force on joints of gravity, less gravcomp, and of what is applied, N·m or N."""
    body, axis = m.jnt_bodyid[joint], d.xaxis[joint]
    hinge = m.jnt_type[joint] == mjx.JointType.HINGE

    def along(force: Array, point: Array) -> Any:
        """Of forces at points, each for all joints or one for each; shape (joints, forces)."""
        arm = point - d.xanchor[joint][:, None]
        turned = jnp.where(hinge[:, None, None], jnp.cross(axis[:, None], arm), axis[:, None])
        return (turned * force).sum(-1)

    out: Array = d.qfrc_applied[dof] + d.qfrc_gravcomp[dof] * (1 - m.jnt_actgravcomp[joint])
    if not m.opt.disableflags & mjx.DisableBit.GRAVITY:
        out = out + m.body_subtreemass[body] * along(m.opt.gravity, d.subtree_com[body, None])[:, 0]
    force, torque = d.xfrc_applied[:, :3], d.xfrc_applied[:, 3:]
    applied = along(force, d.xipos) + hinge[:, None] * (axis @ torque.T)
    return out + jnp.where(_carries(m, body), applied, 0).sum(1)


def _carries(m: mjx.Model, body: Any) -> Any:
    """Which bodies move with some, shape (some, bodies)."""
    root = np.arange(m.nbody)
    out = root == body[:, None]
    for k in range(1, m.nbody):
        out[:, k] |= out[:, m.body_parentid[k]]
    return out


def _each(
    stacks: tuple[jaxfield.Cubics, ...], order: tuple[int, ...], of: Any, *args: Array
) -> Any:
    """Applies `of(cubics, ...)` to each joint; arguments and results in the joints' order."""
    back = np.argsort(np.array(order, int))
    parts, first = [], 0
    for stack in stacks:
        members = back[first : first + len(stack.a)]
        parts.append(jax.vmap(of)(stack, *(arg[members] for arg in args)))
        first += len(members)
    return jax.tree.map(lambda *p: jnp.concatenate(p)[np.array(order, int)], *parts)
