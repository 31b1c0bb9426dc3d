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
from joda.component import Component
from joda.field.jaxcubics import Array, Cubics, curve, largest, pchip_cubics
from joda.field.jaxmerge import merge

__all__ = [
    "Channel",
    "Cubics",
    "evaluate",
    "from_channel",
    "max_stiffness",
    "prepare",
    "to_channel",
]


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
    parts: list[Component] = []
    for k in np.flatnonzero(a < 1.5):
        n = int((x[k] < 1.5).sum())
        parts.append(
            Component(
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


def max_stiffness(channel: Channel | Cubics, lo: ArrayLike, hi: ArrayLike) -> Array:
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
    return largest(jnp.where(touches & (right > left), descent, 0))


def prepare(channel: Channel, pieces: bool = False) -> Cubics:
    """Does once what does not depend on the position.

    Args:
        channel: the channel.
        pieces: whether `max_stiffness` will be asked for.

    Returns:
        what `evaluate` and `max_stiffness` take in the channel's place.
    """
    size, knots = channel.x.shape
    if not size:
        c = jnp.zeros((0, knots - 1, 4), channel.y.dtype)
        last = jnp.zeros(0, int)
        return Cubics(channel.a, channel.b, channel.x, last, c, None, channel.combine)
    count = jnp.sum(channel.x < 1.5, axis=1)
    c = channel.strength * jax.vmap(pchip_cubics)(channel.x, channel.y, count)
    cubics = Cubics(channel.a, channel.b, channel.x, count - 1, c, None, channel.combine)
    if not pieces:
        return cubics
    return replace(cubics, pieces=merge(cubics))


def _evaluate(cubics: Cubics, position: Array) -> tuple[Array, Array]:
    """Value and slope at one position."""
    # not jnp.clip: its derivative is zero at the ends, where the channel's is not
    s = jnp.where(position < 0, 0, jnp.where(position > 1, 1, position))
    covers = (cubics.a <= s) & (s <= cubics.b)
    width = cubics.width
    # the inner where keeps the curve out of places where it could overflow
    u = jnp.where(covers, (s - cubics.a) / width, 0)
    value, slope = jax.vmap(curve)(cubics.x, cubics.c, cubics.last, u)
    slope = slope / width
    if cubics.combine == "sum":
        value, slope = jnp.where(covers, value, 0).sum(), jnp.where(covers, slope, 0).sum()
    else:
        top = jnp.argmax(jnp.where(covers, value, -jnp.inf))
        some = covers.any()
        value, slope = jnp.where(some, value[top], 0), jnp.where(some, slope[top], 0)
    return value, jnp.where(s == position, slope, 0)
