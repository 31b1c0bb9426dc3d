"""The channels of a profile in JAX: differentiable in every number that they hold.

The meaning is that of `joda.field.evaluate`, to rounding. Channels have fixed shapes, so that
profiles can be stacked, mapped over and exchanged without compiling anew: a curve with fewer
control points is filled up with points beyond u = 1, a channel with fewer components with
components beyond s = 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from joda import profile

Array = jax.Array

BISECTIONS = 60
"""Halvings that find where two components of a maximum cross."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("a", "b", "x", "y", "strength"),
    meta_fields=("combine",),
)
@dataclass(frozen=True)
class Channel:
    """Local PCHIP curves, summed or the largest of those that cover s.

    Attributes:
        a: low ends of the intervals in normalised joint position, shape (components,).
        b: high ends, shape (components,).
        x: control points in u = (s - a) / (b - a), from 0 to 1, shape (components, knots). Those
            above 1.5 are filling.
        y: values there in physical units, shape (components, knots).
        strength: factor on the whole channel, a number.
        combine: "sum" or "max".
    """

    a: Array
    b: Array
    x: Array
    y: Array
    strength: Array
    combine: Literal["sum", "max"] = "sum"

    def replace(self, **changes: Any) -> "Channel":
        """The same with other numbers."""
        return replace(self, **changes)


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("a", "b", "x", "last", "c", "pieces"),
    meta_fields=("combine",),
)
@dataclass(frozen=True)
class Cubics:
    """What of a channel does not depend on the position; see `prepare`.

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


def from_channel(
    channel: profile.Channel, components: int = 0, knots: int = 0, dtype: Any = None
) -> Channel:
    """A profile's channel as arrays, its strength 1.

    Args:
        channel: the channel.
        components: at least so many places for components; the rest is filling.
        knots: at least so many places for control points.
        dtype: of the arrays; by default JAX's own (float32, or float64 with jax_enable_x64).

    Returns:
        the channel.
    """
    size = max(components, len(channel.components))
    width = max(knots, 3, *(len(part.x) for part in channel.components), 3)
    a, b = np.full(size, 2.0), np.full(size, 3.0)
    x, y = np.tile(np.arange(float(width)), (size, 1)), np.zeros((size, width))
    for k, part in enumerate(channel.components):
        n = len(part.x)
        a[k], b[k] = part.interval
        x[k] = (*part.x, *range(2, 2 + width - n))
        y[k] = (*part.y, *[part.y[-1]] * (width - n))
    put = partial(jnp.asarray, dtype=dtype)
    return Channel(put(a), put(b), put(x), put(y), put(1.0), channel.combine)


def to_channel(channel: Channel, labels: Sequence[str] = ()) -> profile.Channel:
    """The profile's channel that has these numbers; the inverse of `from_channel`.

    Args:
        channel: the channel, not batched.
        labels: of its components.

    Returns:
        the channel; the ends of intervals and control points are put back to where they belong if
        an optimiser has moved them by rounding.
    """
    a, b, x, y = (np.asarray(part, float) for part in (channel.a, channel.b, channel.x, channel.y))
    parts: list[profile.Component] = []
    for k in np.flatnonzero(a < 1.5):
        n = int((x[k] < 1.5).sum())
        parts.append(
            profile.Component(
                label=labels[len(parts)] if len(parts) < len(labels) else "",
                interval=(float(max(a[k], 0)), float(min(b[k], 1))),
                x=(0.0, *x[k, 1 : n - 1].tolist(), 1.0),
                y=tuple((float(channel.strength) * y[k, :n]).tolist()),
            )
        )
    return profile.Channel(combine=channel.combine, components=tuple(parts))


def evaluate(channel: Channel | Cubics, s: ArrayLike) -> tuple[Array, Array]:
    """Value and slope of a channel.

    Args:
        channel: its components and how they are combined.
        s: normalised joint positions, any shape; beyond [0, 1] the value at that end is held.

    Returns:
        value in the channel's unit and slope d/ds, arrays of the shape of s.
    """
    cubics = channel if isinstance(channel, Cubics) else prepare(channel)
    position = jnp.asarray(s, cubics.c.dtype)
    if not cubics.a.size:
        return jnp.zeros_like(position), jnp.zeros_like(position)
    value, slope = jnp.vectorize(partial(_evaluate, cubics))(position)
    return value, slope


def max_descent(channel: Channel | Cubics, lo: ArrayLike, hi: ArrayLike) -> Array:
    """Steepest descent max(-dF/ds, 0) on the cubics that touch [lo, hi].

    Args:
        channel: its components and how they are combined.
        lo: low end in normalised joint position.
        hi: high end.

    Returns:
        the largest stiffness there, in the channel's unit per range; a number.
    """
    cubics = channel if isinstance(channel, Cubics) else prepare(channel, pieces=True)
    if not cubics.a.size:
        return jnp.zeros((), cubics.c.dtype)
    assert cubics.pieces is not None
    left, right, descent = cubics.pieces
    end = jnp.max(jnp.where(right > left, right, 0))
    touches = (left <= hi) & ((right > lo) | ((right >= end) & (lo <= end)))
    return jnp.max(jnp.where(touches & (right > left), descent, 0))


def prepare(channel: Channel, pieces: bool = False) -> Cubics:
    """Does once what does not depend on the position.

    Args:
        channel: the channel.
        pieces: whether `max_descent` will be asked for.

    Returns:
        what `evaluate` and `max_descent` take in the channel's place.
    """
    size, knots = channel.x.shape
    if not size:
        c = jnp.zeros((0, knots - 1, 4), channel.y.dtype)
        last = jnp.zeros(0, int)
        return Cubics(channel.a, channel.b, channel.x, last, c, None, channel.combine)
    c = channel.strength * jax.vmap(_pchip)(channel.x, channel.y)
    last = jnp.sum(channel.x < 1.5, axis=1) - 1
    cubics = Cubics(channel.a, channel.b, channel.x, last, c, None, channel.combine)
    if not pieces:
        return cubics
    merged = _merge_max(cubics) if channel.combine == "max" else _merge_sum(cubics)
    return Cubics(channel.a, channel.b, channel.x, last, c, merged, channel.combine)


def _pchip(x: Array, y: Array) -> Array:
    """Coefficients of one curve's cubics about their left knots, shape (knots - 1, 4)."""
    h = jnp.diff(x)
    m = jnp.diff(y) / h
    n = jnp.sum(x < 1.5)
    inside = _inner_slopes(h, m)
    first = _end_slope(h[0], h[1], m[0], m[1])
    p, q = n - 2, jnp.maximum(n - 3, 0)
    last = _end_slope(h[p], h[q], m[p], m[q])
    place = jnp.arange(len(x))
    d = jnp.concatenate((first[None], inside, last[None]))
    d = jnp.where(place == n - 1, last, d)
    d = jnp.where(n == 2, m[0], d)
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


def _evaluate(cubics: Cubics, position: Array) -> tuple[Array, Array]:
    """Value and slope at one position."""
    # not jnp.clip: its derivative is zero at the ends, where the channel's is not
    s = jnp.where(position < 0, 0, jnp.where(position > 1, 1, position))
    covers = (cubics.a <= s) & (s <= cubics.b)
    width = _width(cubics)
    # the inner where keeps the curve out of places where it could overflow
    u = jnp.where(covers, (s - cubics.a) / width, 0)
    value, slope = jax.vmap(_curve)(cubics.x, cubics.c, cubics.last, u)
    slope = slope / width
    if cubics.combine == "sum":
        value, slope = jnp.where(covers, value, 0).sum(), jnp.where(covers, slope, 0).sum()
    else:
        top = jnp.argmax(jnp.where(covers, value, -jnp.inf))
        some = covers.any()
        value, slope = jnp.where(some, value[top], 0), jnp.where(some, slope[top], 0)
    return value, jnp.where(s == position, slope, 0)


def _curve(x: Array, c: Array, last: Array, u: Array) -> tuple[Array, Array]:
    """Value and slope d/du of one curve at one place."""
    k = jnp.clip(jnp.sum(x <= u) - 1, 0, last - 1)
    return _cubic(c[k], u - x[k])


def _cubic(c: Array, t: Array) -> tuple[Array, Array]:
    """Value and slope of cubics, shape (..., 4), at t."""
    value = c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
    return value, c[..., 1] + t * (2 * c[..., 2] + 3 * t * c[..., 3])


def _width(cubics: Cubics) -> Array:
    return jnp.where(cubics.b > cubics.a, cubics.b - cubics.a, 1)


def _between_knots(cubics: Cubics) -> tuple[Array, Array, Array, Array]:
    """The intervals between all components' knots, and the components' cubics there.

    Returns:
        left and right ends, shape (n,); coefficients in s about the left end, (n, components, 4);
        whether the component covers the interval, (n, components).
    """
    width = _width(cubics)
    inside = jnp.minimum(cubics.x, 1)  # filling stands at the end, where it makes no interval
    t = jnp.where(inside < 1, cubics.a[:, None] + width[:, None] * inside, cubics.b[:, None])
    breaks = jnp.sort(t.ravel())
    left, right = breaks[:-1], breaks[1:]
    middle = left + 0.5 * (right - left)

    def about(a: Array, b: Array, w: Array, t: Array, last: Array, c: Array) -> Any:
        k = jnp.clip(jnp.sum(t <= middle[:, None], axis=1) - 1, 0, last - 1)
        c = c[k] / w ** jnp.arange(4)
        value, slope = _cubic(c, left - t[k])
        shifted = (value, slope, 3 * c[:, 3] * (left - t[k]) + c[:, 2], c[:, 3])
        return jnp.stack(shifted, axis=1), (a <= middle) & (middle <= b)

    args = (cubics.a, cubics.b, width, t, cubics.last, cubics.c)
    c, covers = jax.vmap(about, out_axes=1)(*args)
    return left, right, jnp.where(covers[..., None], c, 0), covers


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
    value, _ = _cubic(c[:, None], 0.5 * (lo + hi)[..., None])
    top = jnp.argmax(jnp.where(covers[:, None], value, -jnp.inf), axis=2)
    highest = jnp.take_along_axis(c, top[..., None], axis=1)
    out = (left[:, None] + lo, left[:, None] + hi, _descent(highest, lo, hi))
    return tuple(part.ravel() for part in out)  # type: ignore[return-value]


def _descent(c: Array, lo: Array, hi: Array) -> Array:
    """Largest -slope (or 0) of cubics on [lo, hi]: a parabola, so at an end or at its vertex."""
    bent = c[..., 3] != 0
    vertex = -c[..., 2] / (3 * jnp.where(bent, c[..., 3], 1))
    inside = bent & (vertex > lo) & (vertex < hi)
    places = jnp.stack((lo, hi, jnp.where(inside, vertex, lo)))
    return jnp.maximum(0, -_cubic(c, places)[1]).max(0)


def _roots(c: Array, w: Array) -> Array:
    """Sign changes of cubics, shape (..., 4), on [0, w]; w where there are fewer than three.

    Found by bisection between the turning points; the derivatives are those of the implicit
    function theorem.
    """
    fixed, width = jax.lax.stop_gradient((c, jnp.broadcast_to(w, c.shape[:-1])))
    lo, hi = _monotone_parts(fixed, width)
    wide = fixed[..., None, :]
    sign = jnp.sign(_cubic(wide, lo)[0])
    crosses = sign * jnp.sign(_cubic(wide, hi)[0]) < 0

    def halve(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        middle = 0.5 * (low + high)
        same = jnp.sign(_cubic(wide, middle)[0]) == sign
        return jnp.where(same, middle, low), jnp.where(same, high, middle)

    root = jax.lax.stop_gradient(jax.lax.fori_loop(0, BISECTIONS, halve, (lo, hi))[1])
    value, slope = _cubic(c[..., None, :], root)
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
