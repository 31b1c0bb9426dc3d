"""Profiles as arrays for MJX, and where in its constraints their joints have rows."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from joda.component import Curve
from joda.effects import CurveEffect, LearnedForce
from joda.errors import JodaError
from joda.field import jaxeffects, jaxfield, jaxtable
from joda.field.jaxeffects import Effects, from_effects
from joda.profile import CHANNELS, Profile
from joda.scenes.model import find_joint
from joda.scenes.scene import damping_equality

Array = jax.Array


@dataclass(frozen=True)
class Place:
    """Where a joint is in the model.

    Attributes:
        joint: id.
        dof: address of its degree of freedom.
        qpos: address of its position.
        friction_row: row of its dry friction among the constraints, -1: none.
        damping_row: row of its damping, -1: none.
        equality: id of the constraint that has that row, -1: none.
        limit_row: row of the end of its range that is near, -1: none.
    """

    joint: int
    dof: int
    qpos: int
    friction_row: int
    damping_row: int
    equality: int
    limit_row: int


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("conservative", "friction", "damping", "range", "effects"),
    meta_fields=("place",),
)
@dataclass(frozen=True)
class Field:
    """A joint's profile.

    Attributes:
        conservative: force, N or N·m.
        friction: bound of the dry friction, N or N·m.
        damping: N·s/m or N·m·s/rad.
        range: joint position at s = 0 and at s = 1, m or rad, shape (2,).
        effects: beyond the three channels.
        place: where the joint is in the model; not a number to differentiate by.
    """

    conservative: jaxfield.Channel
    friction: jaxfield.Channel
    damping: jaxfield.Channel
    range: Array
    effects: Effects
    place: Place

    def replace(self, **changes: Any) -> "Field":
        """The same with other channels, range or effects."""
        return replace(self, **changes)


Fields = dict[str, Field]
"""Joint name to field: what `step` takes. A pytree; all its leaves are floating-point arrays."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("conservative", "friction", "damping", "range", "effects"),
    meta_fields=("places", "orders"),
)
@dataclass(frozen=True)
class Prepared:
    """All joints' fields after `prepare`, stacked; `step` takes it in the fields' place.

    Attributes:
        conservative: channels of all joints, one stack of joints for each way of combining.
        friction: the same.
        damping: the same.
        range: shape (joints, 2).
        effects: those that any joint has, stacked.
        places: by joint.
        orders: for each channel, where in its stacks the joints are.
    """

    conservative: tuple[jaxfield.Cubics, ...]
    friction: tuple[jaxfield.Cubics, ...]
    damping: tuple[jaxfield.Cubics, ...]
    range: Array
    effects: Effects
    places: tuple[Place, ...]
    orders: tuple[tuple[int, ...], ...]


def put_fields(
    model: mujoco.MjModel,
    profiles: Mapping[str, Profile],
    *,
    components: int = 0,
    knots: int = 0,
    table: tuple[int, int] = jaxtable.MIN_SHAPE,
    effects: Collection[str] = (),
    dtype: Any = None,
) -> Fields:
    """The fields of profiles that a scene carries.

    Args:
        model: the scene that `joda attach` wrote, compiled; for `mjx.put_model`.
        profiles: joint name to profile, as of `joda.read_profiles`.
        components: at least so many places for components in each channel, so that profiles of
            different sizes can be stacked.
        knots: at least so many places for control points in each component.
        table: at least so many places for positions and velocities in that of a learned force.
        effects: names of effects for which there is room at least.
        dtype: of the arrays; by default JAX's own.

    Returns:
        joint name to field. All have the same shapes, and the effects that any of them has: for a
        joint without it an effect does nothing.

    Raises:
        JodaError: a joint does not exist, has no friction row although its profile has friction,
            or the scene's options are none that MJX and the plugin share.
    """
    _check_options(model)
    channels = [getattr(p.channels, name) for p in profiles.values() for name in CHANNELS]
    components = max([components, *(len(channel.components) for channel in channels)])
    curves: list[Curve] = [part for channel in channels for part in channel.components]
    listed = [effect for profile in profiles.values() for effect in profile.effects]
    curves += [effect for effect in listed if isinstance(effect, CurveEffect)]
    knots = max([knots, *(len(curve.x) for curve in curves)])
    tables = [effect for effect in listed if isinstance(effect, LearnedForce)]
    size = (
        max([table[0], *(len(one.positions) for one in tables)]),
        max([table[1], *(len(one.velocities) for one in tables)]),
    )
    # the added inertia is in the model
    present = {*effects, *(effect.effect for effect in listed)} - {"added_inertia"}
    fields = {}
    for name, profile in profiles.items():
        place = _place(model, find_joint(model, name))
        _check_friction_row(model, name, profile, place)
        parts = {
            key: jaxfield.from_channel(getattr(profile.channels, key), components, knots, dtype)
            for key in CHANNELS
        }
        limits = jnp.asarray(profile.joint.range, dtype)
        own = from_effects(profile.effects, present, knots, size, dtype)
        fields[name] = Field(**parts, range=limits, effects=own, place=place)
    return fields


def prepare(fields: Fields) -> Prepared:
    """Does once what does not depend on the state; `rollout` calls it.

    Worth calling before a loop of your own. All fields must have the same shapes.
    """
    names = list(fields)
    stacks, orders = {}, []
    for key in CHANNELS:
        groups: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            groups.setdefault(getattr(fields[name], key).combine, []).append(k)
        make = partial(jaxfield.prepare, pieces=key == "conservative")
        stacks[key] = tuple(
            jax.vmap(make)(_stack([getattr(fields[names[k]], key) for k in members]))
            for members in groups.values()
        )
        members_in_turn = [k for members in groups.values() for k in members]
        orders.append(tuple(np.argsort(members_in_turn).tolist()))
    places = tuple(field.place for field in fields.values())
    limits = jnp.stack([field.range for field in fields.values()]) if names else jnp.zeros((0, 2))
    own = [field.effects for field in fields.values()]
    make_effects = jax.vmap(jaxeffects.prepare, axis_size=len(names))
    effects = make_effects(_stack(own)) if names else Effects()
    return Prepared(**stacks, range=limits, effects=effects, places=places, orders=tuple(orders))


def _check_friction_row(model: mujoco.MjModel, name: str, profile: Profile, place: Place) -> None:
    enabled = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
    rubs = profile.channels.friction.components or any(
        effect.ON_FRICTION for effect in profile.effects
    )
    if place.friction_row < 0 and enabled and rubs:
        raise JodaError(
            f"joint '{name}' has friction in its profile and no friction row; "
            'add frictionloss="1e-12" to the joint.'
        )


def _check_options(model: mujoco.MjModel) -> None:
    if model.opt.noslip_iterations:
        raise JodaError(
            "MJX has no noslip solver; set option/noslip_iterations to 0 to have one scene in both."
        )
    if model.opt.integrator not in (
        mujoco.mjtIntegrator.mjINT_EULER,
        mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    ):
        name = mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_")
        raise JodaError(
            f"joda.mjx steps with the integrators Euler and implicitfast, not {name}; "
            "set option/integrator."
        )


def _place(model: mujoco.MjModel, joint: int) -> Place:
    """Where a joint's rows are: MJX has all rows that there can be, in an order of its own."""
    off, bit = model.opt.disableflags, mujoco.mjtDisableBit
    none = bool(off & bit.mjDSBL_CONSTRAINT)
    kinds, sizes = mujoco.mjtEq, np.zeros(model.neq, int)
    for kind, size in (("CONNECT", 3), ("WELD", 6), ("JOINT", 1), ("TENDON", 1)):
        sizes[model.eq_type == int(getattr(kinds, f"mjEQ_{kind}"))] = size
    joints = model.eq_type == int(kinds.mjEQ_JOINT)
    before = sizes[np.isin(model.eq_type, (int(kinds.mjEQ_CONNECT), int(kinds.mjEQ_WELD)))].sum()
    equality = damping_row = friction_row = -1
    if not (none or off & bit.mjDSBL_EQUALITY):
        equality = damping_equality(model, joint)
        if equality >= 0:
            damping_row = int(before + joints[:equality].sum())
    dof = int(model.jnt_dofadr[joint])
    rows = 0 if off & bit.mjDSBL_EQUALITY else int(sizes.sum())
    if not (none or off & bit.mjDSBL_FRICTIONLOSS):
        if model.dof_frictionloss[dof] > 0:
            friction_row = rows + int((model.dof_frictionloss[:dof] > 0).sum())
        rows += int((model.dof_frictionloss > 0).sum() + (model.tendon_frictionloss > 0).sum())
    limit_row = -1
    if model.jnt_limited[joint] and not (none or off & bit.mjDSBL_LIMIT):
        ball = model.jnt_type == int(mujoco.mjtJoint.mjJNT_BALL)
        limited = model.jnt_limited != 0
        limit_row = rows + int((ball & limited).sum() + (~ball & limited)[:joint].sum())
    qpos = int(model.jnt_qposadr[joint])
    return Place(joint, dof, qpos, friction_row, damping_row, equality, limit_row)


def _stack(items: list[Any]) -> Any:
    try:
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *items)
    except (ValueError, TypeError):
        raise JodaError(
            "the fields of the joints have different shapes; make them with one put_fields, or "
            "give it components=, knots= and table=."
        ) from None
