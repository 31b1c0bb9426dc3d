"""By how much stretches of runs are missed, and the derivatives of that: compiled by JAX.

Compiled once per structure of the joint and size of the data, which is why sizes are rounded up.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from joda import solo
from joda.parameters import Slot
from joda.solo import Solo, State, changed
from joda.stretches import Batch

jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]

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
