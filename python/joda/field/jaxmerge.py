"""The steepest descents of a channel in JAX, where its components overlap."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from joda.field.jaxcubics import Array, Cubics, cubic, largest

BISECTIONS = 60
"""Halvings that find where two components of a maximum cross."""


def merge(cubics: Cubics) -> tuple[Array, Array, Array]:
    """The channel as one piecewise cubic: `Cubics.pieces`.

    Args:
        cubics: of the channel's components, at least one.

    Returns:
        left and right ends in s of its cubics, and the steepest descent max(-dF/ds, 0) on each;
        three arrays of one shape.
    """
    return _merge_max(cubics) if cubics.combine == "max" else _merge_sum(cubics)


def _merge_sum(cubics: Cubics) -> tuple[Array, Array, Array]:
    left, right, c, _ = _between_knots(cubics)
    return left, right, _descent(c.sum(1), jnp.zeros_like(left), right - left)


def _merge_max(cubics: Cubics) -> tuple[Array, Array, Array]:
    """As `_merge_sum`; the intervals are cut wherever two components cross."""
    left, right, c, covers = _between_knots(cubics)
    first, second = np.triu_indices(c.shape[1], 1)
    both = covers[:, first] & covers[:, second]
    difference = jnp.where(both[..., None], c[:, first] - c[:, second], 0)
    width = right - left
    roots = _roots(difference, width[:, None]).reshape(len(left), -1)
    ends = (jnp.zeros_like(left)[:, None], roots, width[:, None])
    cuts = jnp.sort(jnp.concatenate(ends, axis=1), axis=1)
    lo, hi = cuts[:, :-1], cuts[:, 1:]
    value, _ = cubic(c[:, None], 0.5 * (lo + hi)[..., None])
    top = jnp.argmax(jnp.where(covers[:, None], value, -jnp.inf), axis=2)
    highest = jnp.take_along_axis(c, top[..., None], axis=1)
    out = (left[:, None] + lo, left[:, None] + hi, _descent(highest, lo, hi))
    return tuple(part.ravel() for part in out)  # type: ignore[return-value]


def _between_knots(cubics: Cubics) -> tuple[Array, Array, Array, Array]:
    """The intervals between all components' knots, and the components' cubics there.

    Returns:
        left and right ends, shape (n,); coefficients in s about the left end, (n, components, 4);
        whether the component covers the interval, (n, components).
    """
    width = cubics.width
    inside = jnp.minimum(cubics.x, 1)  # filling stands at the end, where it makes no interval
    t = jnp.where(inside < 1, cubics.a[:, None] + width[:, None] * inside, cubics.b[:, None])
    breaks = jnp.sort(t.ravel())
    left, right = breaks[:-1], breaks[1:]
    middle = left + 0.5 * (right - left)

    def about(a: Array, b: Array, w: Array, t: Array, last: Array, c: Array) -> Any:
        k = jnp.clip(jnp.sum(t <= middle[:, None], axis=1) - 1, 0, last - 1)
        c = c[k] / w ** jnp.arange(4)
        value, slope = cubic(c, left - t[k])
        shifted = (value, slope, 3 * c[:, 3] * (left - t[k]) + c[:, 2], c[:, 3])
        return jnp.stack(shifted, axis=1), (a <= middle) & (middle <= b)

    args = (cubics.a, cubics.b, width, t, cubics.last, cubics.c)
    c, covers = jax.vmap(about, out_axes=1)(*args)
    return left, right, jnp.where(covers[..., None], c, 0), covers


def _descent(c: Array, lo: Array, hi: Array) -> Array:
    """Largest -slope (or 0) of cubics on [lo, hi]: a parabola, so at an end or at its vertex."""
    bent = c[..., 3] != 0
    vertex = -c[..., 2] / (3 * jnp.where(bent, c[..., 3], 1))
    inside = bent & (vertex > lo) & (vertex < hi)
    places = jnp.stack((lo, hi, jnp.where(inside, vertex, lo)))
    return jnp.maximum(0, largest(-cubic(c, places)[1]))


def _roots(c: Array, w: Array) -> Array:
    """Sign changes of cubics, shape (..., 4), on [0, w]; w where there are fewer than three.

    Found by bisection between the turning points; the derivatives are those of the implicit
    function theorem.
    """
    fixed, width = jax.lax.stop_gradient((c, jnp.broadcast_to(w, c.shape[:-1])))
    lo, hi = _monotone_parts(fixed, width)
    wide = fixed[..., None, :]
    sign = jnp.sign(cubic(wide, lo)[0])
    crosses = sign * jnp.sign(cubic(wide, hi)[0]) < 0

    def halve(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        middle = 0.5 * (low + high)
        same = jnp.sign(cubic(wide, middle)[0]) == sign
        return jnp.where(same, middle, low), jnp.where(same, high, middle)

    root = jax.lax.stop_gradient(jax.lax.fori_loop(0, BISECTIONS, halve, (lo, hi))[1])
    value, slope = cubic(c[..., None, :], root)
    step = jnp.where(slope != 0, value / jnp.where(slope != 0, slope, 1), 0)
    root = root - (step - jax.lax.stop_gradient(step))  # as if one more Newton step
    return jnp.where(crosses, root, jnp.where(sign == 0, lo, w[..., None]))


def _monotone_parts(c: Array, w: Array) -> tuple[Array, Array]:
    """Low and high ends of the three parts of [0, w] between turning points, shape (..., 3)."""
    qa, qb, qc = 3 * c[..., 3], 2 * c[..., 2], c[..., 1]
    root = jnp.sqrt(jnp.maximum(qb * qb - 4 * qa * qc, 0))
    q = -0.5 * (qb + jnp.where(qb < 0, -root, root))
    found = [
        jnp.where(under != 0, over / jnp.where(under != 0, under, 1), w)
        for over, under in ((q, qa), (qc, q))
    ]
    turns = jnp.sort(jnp.stack([jnp.where((t > 0) & (t < w), t, w) for t in found], -1), axis=-1)
    ends = jnp.concatenate((jnp.zeros_like(w)[..., None], turns, w[..., None]), axis=-1)
    return ends[..., :-1], ends[..., 1:]
