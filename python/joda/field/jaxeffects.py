"""A joint's effects beyond the three channels in JAX: differentiable in every number.

Units are those of a hinge; for a slide read N, m and kg. Their laws are in `joda.joints.laws`.
"""

from collections.abc import Collection
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, cast

import jax
import jax.numpy as jnp

from joda import effects
from joda.component import Component
from joda.field import jaxfield, jaxtable
from joda.profile import Channel

Array = jax.Array
Curve = jaxfield.Channel | jaxfield.Cubics
register = jax.tree_util.register_dataclass

RIGID = 1e30
"""Stiffness of bristles that do not give: beyond any row's."""
SCENES = -1.0
"""Damping of an end stop whose restitution is the scene's."""


@register
@dataclass(frozen=True)
class Directed:
    """A curve for each direction of motion; `both` directions have the same one twice."""

    positive: Curve
    negative: Curve


@register
@dataclass(frozen=True)
class Stribeck:
    """Friction at rest above that in motion, N·m; its velocity, rad/s; its exponent."""

    curve: Curve
    velocity: Array
    exponent: Array


@register
@dataclass(frozen=True)
class LoadFriction:
    """Friction per load."""

    coefficient: Array


@register
@dataclass(frozen=True)
class Presliding:
    """Bristles: stiffness, N·m/rad; damping, N·m·s/rad; share of friction at which they slip."""

    stiffness: Array
    damping: Array
    breakaway: Array


@register
@dataclass(frozen=True)
class GravityOffset:
    """Factors of sin q and cos q, N·m: 0 for a slide; a constant force, N: 0 for a hinge."""

    sin: Array
    cos: Array
    force: Array


@register
@dataclass(frozen=True)
class Backlash:
    """Width of the play, rad; inertia of the handle before the joint or of the load behind it,
    kg·m², 0 for none; share of friction and damping that acts on the load."""

    play: Array
    handle: Array
    load: Array
    share: Array


@register
@dataclass(frozen=True)
class Learned:
    """A table of resistance, and a memory.

    Attributes:
        table: the table.
        stiffness: gain of a memory of position, N·m/rad.
        change: gain of a memory of speed, s/rad.
        time: of the memory, s.
        follows: 1 for a memory of position, 0 for one of speed or none.
    """

    table: jaxtable.Table | jaxtable.Patches
    stiffness: Array
    change: Array
    time: Array
    follows: Array


@register
@dataclass(frozen=True)
class EndStops:
    """Damping of the end stops with a restitution of their own, times the timestep: at least 0.

    See `joda._core.stop_damping`. Below 0 an end is as the scene has it.
    """

    low: Array
    high: Array


@register
@dataclass(frozen=True)
class AddedInertia:
    """kg·m²; MJX has it in the joint's armature."""

    inertia: Array


@register
@dataclass(frozen=True)
class Effects:
    """A joint's effects, named as in the profile; a pytree whose leaves are numbers.

    A restitution of both end stops is in the scene's solver parameters.
    """

    direction_dependent_damping: Directed | None = None
    quadratic_damping: Directed | None = None
    asymmetric_friction: Directed | None = None
    stribeck_friction: Stribeck | None = None
    load_dependent_friction: LoadFriction | None = None
    presliding_friction: Presliding | None = None
    gravity_offset: GravityOffset | None = None
    backlash: Backlash | None = None
    added_inertia: AddedInertia | None = None
    end_stop_restitution: EndStops | None = None
    learned_force: Learned | None = None

    def replace(self, **changes: Any) -> "Effects":
        """The same with other effects."""
        return replace(self, **changes)


NAMES = tuple(field.name for field in fields(Effects))
NEUTRAL: dict[str, dict[str, float]] = {
    "stribeck_friction": {"velocity": 1.0, "exponent": 1.0},
    "load_dependent_friction": {"coefficient": 0.0},
    "presliding_friction": {"stiffness": RIGID, "damping": 0.0, "breakaway": 1.0},
    "gravity_offset": {"sin": 0.0, "cos": 0.0, "force": 0.0},
    "backlash": {"play": 0.0, "handle": 0.0, "load": 0.0, "share": 0.0},
    "added_inertia": {"inertia": 0.0},
}
"""Numbers with which an effect does nothing."""

NUMBERS = {
    "load_dependent_friction": LoadFriction,
    "presliding_friction": Presliding,
    "gravity_offset": GravityOffset,
    "backlash": Backlash,
    "added_inertia": AddedInertia,
}
"""Effects that have numbers and no curve."""

WAYS = ("positive", "negative")
ENDS = ("low", "high")


def from_effects(
    listed: Collection[effects.Effect],
    present: Collection[str] | None = None,
    knots: int = 0,
    table: tuple[int, int] = jaxtable.MIN_SHAPE,
    dtype: Any = None,
) -> Effects:
    """A profile's effects as arrays.

    Args:
        listed: the effects.
        present: names of those that are put there, also where the joint does not have them: they
            do nothing then. By default those that it has.
        knots: at least so many places for control points in each curve.
        table: at least so many places for positions and velocities in that of a learned force.
        dtype: of the arrays; by default JAX's own.
    """
    present = {effect.effect for effect in listed} if present is None else present
    own = {effect.key: effect for effect in listed}
    put = partial(jnp.asarray, dtype=dtype)

    def curve(*keys: str) -> jaxfield.Channel:
        parts = tuple(_component(own[key]) for key in keys if key in own)
        return jaxfield.from_channel(Channel(components=parts), 1, knots, dtype)

    def numbers(name: str) -> dict[str, Array]:
        effect = own.get(name)
        return {key: put(getattr(effect, key, none)) for key, none in NEUTRAL[name].items()}

    def make(name: str) -> Any:
        if name == "stribeck_friction":
            return Stribeck(curve(name), **numbers(name))
        if name in NUMBERS:
            return NUMBERS[name](**numbers(name))
        if name == "learned_force":
            return _learned(own.get(name), table, dtype)
        if name == "end_stop_restitution":
            return EndStops(*(put(_stop(own.get(f"{name} {end}"))) for end in ENDS))
        return Directed(*(curve(f"{name} {way}", f"{name} both") for way in WAYS))

    return Effects(**{name: make(name) for name in NAMES if name in present})


def prepare(own: Effects) -> Effects:
    """Does once what does not depend on the state."""

    def is_part(node: Any) -> bool:
        return isinstance(node, jaxfield.Channel | jaxtable.Table)

    def once(node: Any) -> Any:
        if isinstance(node, jaxtable.Table):
            return jaxtable.prepare(node)
        return jaxfield.prepare(node) if is_part(node) else node

    return cast(Effects, jax.tree.map(once, own, is_leaf=is_part))


def _learned(effect: effects.Effect | None, size: tuple[int, int], dtype: Any) -> Learned:
    assert effect is None or isinstance(effect, effects.LearnedForce)
    table = jaxtable.from_effect(effect, size, dtype)
    memory, gain, time = (effect.memory, effect.gain, effect.time) if effect else ("none", 0, 1)
    follows = memory == "position"
    numbers = (gain * follows, gain * (memory == "speed"), time, follows)
    return Learned(table, *(jnp.asarray(float(number), dtype) for number in numbers))


def _component(effect: effects.Effect) -> Component:
    assert isinstance(effect, effects.CurveEffect)
    return Component(interval=effect.interval, x=effect.x, y=effect.y)


def _stop(effect: effects.Effect | None) -> float:
    if effect is None:
        return SCENES
    import joda._core as core

    assert isinstance(effect, effects.EndStopRestitution)
    return core.stop_damping(effect.restitution)
