"""The plugin's law in JAX: forces and rows of all joints that carry a profile."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from joda.field import jaxfield
from joda.field.jaxeffects import Backlash, EndStops
from joda.joints import laws
from joda.joints.stiffness import IDLE_ROW, implicit_stiffness, reach, stays_beyond
from joda.mjx.fields import Prepared
from joda.mjx.internals import Rows
from joda.profile import CHANNELS

Array = jax.Array


def act(m: mjx.Model, d: mjx.Data, psi: Array, prepared: Prepared) -> mjx.Data:
    """The plugin's compute: forces and rows of all joints, from the state before the step.

    Args:
        m: model.
        d: the state, with its rows and passive forces made.
        psi: the forces of all rows in the step before.
        prepared: the fields.
    """
    off, bit = m.opt.disableflags, mjx.DisableBit
    spring, damper = not off & bit.SPRING, not off & bit.DAMPER
    if not (spring or damper):  # MuJoCo skips all passive forces then
        return d
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

    force, descent = jax.vmap(laws.gravity)(own.gravity_offset, q)
    near, drag, up = (jnp.zeros_like(v) for _ in range(3))
    if spring:
        stacks = prepared.conservative
        force = force + _each(stacks, order["conservative"], jaxfield.evaluate, s)[0]
        far = reach(v, force, inertia, per_range, h)
        near = _each(stacks, order["conservative"], jaxfield.max_descent, s - far, s + far)
    constant = stays_beyond(s, v, force, inertia, per_range, h)
    stiffness = implicit_stiffness(force, near, descent, constant, inertia, per_range, h)
    if damper:
        drag = _each(prepared.damping, order["damping"], jaxfield.evaluate, s)[0]
        drag = drag + jax.vmap(laws.damping)(own, s, v)
    drag, down = drag + h * stiffness, up
    if not off & bit.FRICTIONLOSS:
        friction, _ = _each(prepared.friction, order["friction"], jaxfield.evaluate, s)
        load = jnp.zeros_like(v)
        if own.load_dependent_friction is not None:
            load = _gravity(m, d, index["joint"]) + d.qfrc_applied[dof]
        up, down = (friction + more for more in jax.vmap(laws.friction)(own, s, v, load))

    rows, at = Rows(d), np.flatnonzero(index["friction_row"] >= 0)
    row = index["friction_row"][at]
    bound = 0.5 * (up + down)[at] + m.dof_frictionloss[dof[at]]
    last = jnp.clip(psi[row], -bound, bound)
    bristles = jax.tree.map(lambda x: x[at], own.presliding_friction)
    stiff = jax.vmap(laws.friction_row, in_axes=(0, 0, 0, 0, 0, None))
    D, slipping = stiff(bristles, last, bound, v[at], inertia[at], h)
    rows.set(row, D, bound, last, v[at] / h)
    if damper:
        drag = drag.at[at].add(slipping)
    shift = jnp.zeros_like(v).at[at].set(0.5 * (down - up)[at])  # as the row is symmetric
    up, down = up.at[at].set(0), down.at[at].set(0)

    at = np.flatnonzero(index["damping_row"] >= 0)
    row, on = index["damping_row"][at], d.eq_active[index["equality"][at]] != 0
    resistance = jnp.maximum(h * drag[at], IDLE_ROW * inertia[at])
    rows.set(row, resistance, 0, 0, v[at] / h)
    held = jnp.zeros(len(dof), bool).at[at].set(on)
    if own.end_stop_restitution is not None:
        at = np.flatnonzero(index["limit_row"] >= 0)
        stops = jax.tree.map(lambda x: x[at], own.end_stop_restitution)
        _set_stops(rows, index["limit_row"][at], dof[at], stops, v[at], inertia[at], h)
    force = jnp.where(held, force, force / (1 + h * h * stiffness / inertia))
    drag = jnp.where(held, 0, drag)

    # what has no row becomes a force that at most stops the joint within the step
    stop, dry = inertia * jnp.abs(v) / h, jnp.where(v < 0, down, up)
    limited = jnp.minimum(dry + drag * jnp.abs(v) / (1 + h * drag / inertia), stop)
    force = force + shift - jnp.sign(v) * limited
    d, pushed = _move_handles(m, rows.write(d), dof, own.backlash)
    return d.replace(qfrc_passive=d.qfrc_passive.at[dof].add(force + pushed))


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
    has, D, stiffness, damping = laws.end_stop(stops, side > 0, inertia, h)
    reference = -damping * side * v - stiffness * rows.pos[row]
    rows.limit(row, has & (side != 0), D, reference)


def _gravity(m: mjx.Model, d: mjx.Data, joint: Any) -> Array:
    """Gravity's force on joints, from all that they move, N·m or N."""
    if m.opt.disableflags & mjx.DisableBit.GRAVITY:
        return jnp.zeros(len(joint))
    body, axis = m.jnt_bodyid[joint], d.xaxis[joint]
    hinge = m.jnt_type[joint] == mjx.JointType.HINGE
    arm = d.subtree_com[body] - d.xanchor[joint]
    along = jnp.where(hinge[:, None], jnp.cross(axis, arm), axis)
    weight: Array = m.body_subtreemass[body] * (along @ m.opt.gravity)
    return weight


def _move_handles(
    m: mjx.Model, d: mjx.Data, dof: Any, backlash: Backlash | None
) -> tuple[mjx.Data, Array]:
    """Steps the handles; what they push more than is applied to them, N·m or N."""
    applied = d.qfrc_applied[dof]
    if backlash is None:
        return d, jnp.zeros_like(applied)
    g, w = d.userdata[m.nuserdata :].reshape(-1, 2).T
    step = jax.vmap(laws.backlash, in_axes=(0, 0, 0, 0, 0, None))
    force, g, w = step(backlash, g, w, d.qvel[dof], applied, m.opt.timestep)
    state = jnp.stack([g, w], axis=1).ravel()
    return d.replace(userdata=d.userdata.at[m.nuserdata :].set(state)), force - applied


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
