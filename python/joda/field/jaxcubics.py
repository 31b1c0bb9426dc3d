"""The cubics of a channel's curves in JAX: their coefficients, and their values."""

from dataclasses import dataclass
from functools import partial
from typing import Literal

import jax
import jax.numpy as jnp

Array = jax.Array


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("a", "b", "x", "last", "c", "pieces"),
    meta_fields=("combine",),
)
@dataclass(frozen=True)
class Cubics:
    """What of a channel does not depend on the position; see `joda.field.jaxfield.prepare`.

    Attributes:
        a: low ends of the intervals, shape (components,).
        b: high ends, shape (components,).
        x: knots in u, shape (components, knots).
        last: number of cubics that are not filling, shape (components,).
        c: coefficients in u about the left knots, constant first, shape (components, knots - 1, 4).
        pieces: None, or left and right ends in s of the channel's cubics and the steepest descent
            max(-dF/ds, 0) on each, three arrays of one shape.
        combine: "sum" or "max".
    """

    a: Array
    b: Array
    x: Array
    last: Array
    c: Array
    pieces: tuple[Array, Array, Array] | None
    combine: Literal["sum", "max"]

    @property
    def width(self) -> Array:
        """Of the intervals, 1 where there is none, shape (components,)."""
        return jnp.where(self.b > self.a, self.b - self.a, 1)


def pchip_slopes(x: Array, y: Array, n: Array) -> Array:
    """Slopes dy/dx of one curve at its knots, of which those after the first n are filling."""
    h = jnp.diff(x)
    m = jnp.diff(y) / h
    first = _end_slope(h[0], h[1], m[0], m[1])
    p, q = n - 2, jnp.maximum(n - 3, 0)
    last = _end_slope(h[p], h[q], m[p], m[q])
    d = jnp.concatenate((first[None], _inner_slopes(h, m), last[None]))
    d = jnp.where(jnp.arange(len(x)) == n - 1, last, d)
    return jnp.where(n == 2, m[0], d)


def pchip_cubics(x: Array, y: Array, n: Array) -> Array:
    """Coefficients of its cubics about their left knots, constant first, shape (knots - 1, 4)."""
    h = jnp.diff(x)
    m = jnp.diff(y) / h
    d = pchip_slopes(x, y, n)
    c2 = (3 * m - 2 * d[:-1] - d[1:]) / h
    c3 = (d[:-1] + d[1:] - 2 * m) / h**2
    return jnp.stack((y[:-1], d[:-1], c2, c3), axis=1)


def _inner_slopes(h: Array, m: Array) -> Array:
    """Weighted harmonic means (Fritsch & Butland 1984), written so that nothing overflows.

    (w1 + w2) / (w1 / m1 + w2 / m2) with the smaller slope taken out of the denominator.
    """
    w1, w2 = 2 * h[1:] + h[:-1], h[1:] + 2 * h[:-1]
    monotone = jnp.sign(m[1:]) * jnp.sign(m[:-1]) > 0
    left, right = jnp.where(monotone, m[:-1], 1), jnp.where(monotone, m[1:], 1)
    swap = jnp.abs(left) > jnp.abs(right)
    small, large = jnp.where(swap, right, left), jnp.where(swap, left, right)
    ws, wl = jnp.where(swap, w2, w1), jnp.where(swap, w1, w2)
    return jnp.where(monotone, small * ((w1 + w2) / (ws + wl * (small / large))), 0)


def _end_slope(h0: Array, h1: Array, m0: Array, m1: Array) -> Array:
    slope = ((2 * h0 + h1) * m0 - h0 * m1) / (h0 + h1)
    limited = (jnp.sign(m0) != jnp.sign(m1)) & (jnp.abs(slope) > 3 * jnp.abs(m0))
    return jnp.where(jnp.sign(slope) != jnp.sign(m0), 0, jnp.where(limited, 3 * m0, slope))


def curve(x: Array, c: Array, last: Array, u: Array) -> tuple[Array, Array]:
    """Value and slope d/du of one curve at one place."""
    k = jnp.clip(jnp.sum(x <= u) - 1, 0, last - 1)
    return cubic(c[k], u - x[k])


def cubic(c: Array, t: Array) -> tuple[Array, Array]:
    """Value and slope of cubics, shape (..., 4), at t."""
    value = c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
    return value, c[..., 1] + t * (2 * c[..., 2] + 3 * t * c[..., 3])


def largest(values: Array) -> Array:
    """The largest along the first axis, with the derivative of that one.

    Not jnp.max: its derivative looks for the entries that equal the maximum, and is 0 / 0 where the
    compiler has rounded one of the two otherwise.
    """
    return jnp.take_along_axis(values, jnp.argmax(values, axis=0)[None], axis=0)[0]
