"""The table of a learned force in JAX: differentiable in every number, as `joda.field.table`.

Tables have fixed shapes, so that they can be stacked: one with fewer velocities is filled up with
velocities that no joint has, one with fewer positions with its last row beyond s = 1.
"""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from joda.component import MAX_VALUE
from joda.effects.learned_force import EDGE, LearnedForce
from joda.field.jaxcubics import Array, cubic, pchip_cubics

register = jax.tree_util.register_dataclass

MIN_SHAPE = (2, 3)
"""Fewest positions and velocities of a table in JAX."""
FILLING = 2 * MAX_VALUE
"""Velocity from which on there is filling."""


@register
@dataclass(frozen=True)
class Table:
    """Resistance over position and velocity.

    Attributes:
        interval: [a, b] in normalised position, shape (2,).
        positions: increasing, shape (positions,). Those above 1 are filling.
        velocities: increasing, rad/s, shape (velocities,). From `FILLING` on they are filling.
        y: N·m, shape (positions, velocities).
    """

    interval: Array
    positions: Array
    velocities: Array
    y: Array


@register
@dataclass(frozen=True)
class Patches:
    """What of a table does not depend on the state.

    Attributes:
        interval, positions, velocities: of the table.
        fastest: its last velocity, rad/s.
        last: how many cubics of a row are not filling.
        c: coefficients about the velocities, shape (positions, velocities - 1, 4).
    """

    interval: Array
    positions: Array
    velocities: Array
    fastest: Array
    last: Array
    c: Array


def from_effect(effect: LearnedForce | None, size: tuple[int, int], dtype: Any = None) -> Table:
    """An effect's table as arrays; zero without an effect.

    Args:
        effect: the effect.
        size: at least so many places for positions and for velocities.
        dtype: of the arrays; by default JAX's own.
    """
    none = LearnedForce(velocities=(-1.0, 0.0, 1.0), y=((0.0, 0.0, 0.0),))
    own = effect or none
    n, m = len(own.positions), len(own.velocities)
    rows, columns = max(size[0], n, MIN_SHAPE[0]), max(size[1], m, MIN_SHAPE[1])
    beyond = FILLING * np.arange(1, columns - m + 1)
    y = np.pad(np.array(own.y), ((0, rows - n), (0, columns - m)), mode="edge")
    parts = (own.interval, (*own.positions, *range(2, 2 + rows - n)), (*own.velocities, *beyond), y)
    return Table(*(jnp.asarray(part, dtype) for part in parts))


def prepare(table: Table) -> Patches:
    """Does once what does not depend on the state."""
    v = table.velocities
    count = jnp.sum(v < FILLING)
    c = jax.vmap(lambda row: pchip_cubics(v, row, count))(table.y)
    return Patches(table.interval, table.positions, v, v[count - 1], count - 1, c)


def resistance(table: Table | Patches, s: Array, v: Array) -> tuple[Array, Array]:
    """R(s, v), N·m, and its slope dR/dv, at one place; as `joda.field.table.resistance`."""
    own = table if isinstance(table, Patches) else prepare(table)
    s, x = jnp.where(s < 0, 0, jnp.where(s > 1, 1, s)), own.positions
    k = jnp.clip(jnp.sum(x <= s) - 1, 0, len(x) - 2)
    part = jnp.clip((s - x[k]) / (x[k + 1] - x[k]), 0, 1)
    slowest = own.velocities[0]
    inside = jnp.where(v < slowest, slowest, jnp.where(v > own.fastest, own.fastest, v))
    i = jnp.clip(jnp.sum(own.velocities <= inside) - 1, 0, own.last - 1)
    c = (1 - part) * own.c[k, i] + part * own.c[k + 1, i]
    value, slope = cubic(c, inside - own.velocities[i])
    weight = _fade(own.interval, s)
    return weight * value, jnp.where(inside == v, weight * slope, 0)


def _fade(interval: Array, s: Array) -> Array:
    a, b = interval
    width = jnp.minimum(EDGE, (b - a) / 2)
    left = jnp.where(a > 0, jnp.clip((s - a) / width, 0, 1), 1)
    right = jnp.where(b < 1, jnp.clip((b - s) / width, 0, 1), 1)
    return left**2 * (3 - 2 * left) * right**2 * (3 - 2 * right)
