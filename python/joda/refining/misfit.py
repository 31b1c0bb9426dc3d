"""By how much stretches of runs are missed, and the derivatives of that: compiled by JAX.

Compiled once per structure of the joint and size of the data, which is why sizes are rounded up.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from joda.joints import solo
from joda.joints.parameters import Slot
from joda.joints.solo import Solo, State, changed
from joda.refining.stretches import Batch, Stretches

Array = NDArray[np.float64]

jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]

STARTS = 10
"""Iterations that fit the starts of stretches."""
START = 3.0
"""How far a start may be from the measured one, in its standard deviations."""
REACH = 0.004
"""How far ends of intervals are moved (normalised position) to see what that does: where a curve
jumps at an end, the derivative along the path does not know of it."""


def _predicted(
    values: jax.Array,
    start: jax.Array,
    part: Batch,
    first: Solo,
    slots: tuple[Slot, ...],
    h: float,
) -> jax.Array:
    """Predicted minus measured positions of one stretch."""
    joint = changed(first, slots, values)
    state = State(start[0], start[1], jnp.zeros_like(start[0]))
    path = solo.rollout(joint, state, part.force, h)
    before, after = path[part.index], path[part.index + 1]
    misfit = before + part.weight * (after - before) - part.position
    return jnp.where(part.mask > 0, misfit, 0.0)


@partial(jax.jit, static_argnames=("slots", "h"))
def slopes(
    values: jax.Array,
    starts: jax.Array,
    batch: Batch,
    first: Solo,
    slots: tuple[Slot, ...],
    h: float,
) -> tuple[jax.Array, jax.Array]:
    """`_predicted` of all stretches, and its derivatives by the values and the start."""
    n = len(slots)
    ends = np.array([k for k, slot in enumerate(slots) if slot.kind == "intervals"], int)
    along = REACH * np.eye(n + 2)[ends]
    moves = jnp.array(np.vstack([np.zeros(n + 2), along, -along]))

    def one(start: jax.Array, part: Batch) -> tuple[jax.Array, jax.Array]:
        def predicted(x: jax.Array) -> jax.Array:
            return _predicted(x[:n], x[n:], part, first, slots, h)

        x = jnp.concatenate([values, start])
        moved = jax.vmap(predicted)(x + moves)
        J = jax.jacfwd(predicted)(x)
        by_ends = (moved[1 : 1 + len(ends)] - moved[1 + len(ends) :]).T / (2 * REACH)
        return moved[0], J.at[:, ends].set(by_ends)

    return jax.vmap(one)(starts, batch)


@partial(jax.jit, static_argnames=("slots", "h"))
def start_slopes(
    values: jax.Array,
    starts: jax.Array,
    batch: Batch,
    first: Solo,
    slots: tuple[Slot, ...],
    h: float,
) -> tuple[jax.Array, jax.Array]:
    """Misfits of all stretches, and their derivatives by the start."""

    def one(start: jax.Array, part: Batch) -> tuple[jax.Array, jax.Array]:
        def misfit(x: jax.Array) -> tuple[jax.Array, jax.Array]:
            out = _predicted(values, x, part, first, slots, h)
            return out, out

        J, out = jax.jacfwd(misfit, has_aux=True)(start)
        return out, J

    return jax.vmap(one)(starts, batch)


def fitted_starts(
    values: Array,
    data: Stretches,
    sigma: float,
    doubt: Array,
    first: Solo,
    slots: tuple[Slot, ...],
    h: float,
) -> Array:
    """Misfits from the starts, within their measurement's errors, that fit best.

    Args:
        values: the numbers times their scales, shape (n,).
        data: the stretches.
        sigma: noise of the position, rad or m.
        doubt: standard deviations of the starts, shape (stretches, 2).
        first, slots, h: the joint as it was; what each number is; timestep, s.

    Returns:
        predicted minus measured positions, shape (stretches, samples).
    """
    count = len(data.start)
    x = np.zeros_like(doubt)
    damping = np.full(count, 1e-3)

    def fitted(x: Array) -> tuple[Array, Array, Array]:
        starts = data.filled(data.start + doubt * x)
        misfit, J = start_slopes(values, starts, data.batch, first, slots, h)
        r = np.nan_to_num(np.asarray(misfit)[:count], nan=1e6) / sigma
        J = np.nan_to_num(np.asarray(J)[:count]) * doubt[:, None, :] / sigma
        return r, J, (r**2).sum(axis=1) + (x**2).sum(axis=1)

    r, J, cost = fitted(x)
    for _ in range(STARTS):
        A = np.einsum("kia,kib->kab", J, J) + np.eye(2)
        A = A * (1 + damping[:, None, None] * np.eye(2))
        g = np.einsum("kia,ki->ka", J, r) + x
        trial = np.clip(x - np.linalg.solve(A, g[..., None])[..., 0], -START, START)
        new = fitted(trial)
        better = new[2] < cost
        damping = np.where(better, np.maximum(damping / 10, 1e-9), damping * 10)
        settled = np.all(cost - new[2] < 1e-4 * cost)
        x = np.where(better[:, None], trial, x)
        r = np.where(better[:, None], new[0], r)
        J = np.where(better[:, None, None], new[1], J)
        cost = np.where(better, new[2], cost)
        if settled:
            break
    return r * sigma
