"""The plugin's law in JAX: forces and rows of all joints that carry a profile."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from mujoco import mjx

from joda.field import jaxfield
from joda.mjx.fields import Prepared
from joda.mjx.internals import Rows
from joda.profile import CHANNELS
from joda.stiffness import STIFF_ROW, implicit_stiffness, reach

Array = jax.Array

IDLE_ROW = 1e-12
"""As kIdleRow in cpp/joint_dynamics.cc."""


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
        for key in ("dof", "qpos", "friction_row", "damping_row", "equality")
    }
    dof, h = index["dof"], m.opt.timestep
    inertia, v = 1 / m.dof_invweight0[dof], d.qvel[dof]
    lo, hi = prepared.range[:, 0], prepared.range[:, 1]
    per_range = 1 / (hi - lo)
    s = (d.qpos[index["qpos"]] - lo) * per_range
    order = dict(zip(CHANNELS, prepared.orders, strict=True))

    force = stiffness = drag = friction = jnp.zeros_like(v)
    if spring:
        stacks = prepared.conservative
        force, _ = _each(stacks, order["conservative"], jaxfield.evaluate, s)
        far = reach(v, force, inertia, per_range, h)
        descent = jaxfield.max_descent
        steepest = _each(stacks, order["conservative"], descent, s - far, s + far)
        stiffness = implicit_stiffness(force, steepest, inertia, per_range, h)
        drag = h * stiffness
    if damper:
        drag = drag + _each(prepared.damping, order["damping"], jaxfield.evaluate, s)[0]
    if not off & bit.FRICTIONLOSS:
        friction, _ = _each(prepared.friction, order["friction"], jaxfield.evaluate, s)

    rows, at = Rows(d), np.flatnonzero(index["friction_row"] >= 0)
    row = index["friction_row"][at]
    bound = friction[at] + m.dof_frictionloss[dof[at]]
    rows.set(row, STIFF_ROW * inertia[at], bound, jnp.clip(psi[row], -bound, bound), v[at] / h)
    friction = friction.at[at].set(0)

    at = np.flatnonzero(index["damping_row"] >= 0)
    row, on = index["damping_row"][at], d.eq_active[index["equality"][at]] != 0
    resistance = jnp.maximum(h * drag[at], IDLE_ROW * inertia[at])
    rows.set(row, resistance, 0, 0, v[at] / h)
    held = jnp.zeros(len(dof), bool).at[at].set(on)
    force = jnp.where(held, force, force / (1 + h * h * stiffness / inertia))
    drag = jnp.where(held, 0, drag)

    # what has no row becomes a force that at most stops the joint within the step
    stop = inertia * jnp.abs(v) / h
    limited = jnp.minimum(friction + drag * jnp.abs(v) / (1 + h * drag / inertia), stop)
    force = force - jnp.sign(v) * limited
    d = rows.write(d)
    return d.replace(qfrc_passive=d.qfrc_passive.at[dof].add(force))


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
