"""The state of handles, loads and memories, which `mjx.Data` has no place for: in `userdata`."""

import jax
import jax.numpy as jnp
from mujoco import mjx

from joda.errors import JodaError
from joda.field.jaxeffects import Effects
from joda.mjx.fields import Fields, Prepared

Array = jax.Array


def put_state(m: mjx.Model, d: mjx.Data, fields: Fields | Prepared) -> mjx.Data:
    """The data with what is beyond the play of joints with backlash in the middle of it.

    Handles are at rest there; loads move with their joint. Learned forces remember nothing.

    Args:
        m: of `mjx.put_model`.
        d: the data; what is in its `userdata` stays.
        fields: of `put_fields`.

    Returns:
        the data. Behind the model's own `userdata` are, in the order of the fields: if a joint has
        backlash, two numbers per joint, position of the handle or the load minus that of the part
        (rad or m), and velocity of the handle, or of the load minus that of the part; then, if a
        joint has a learned force, one number per joint, what it remembers (rad, m, rad/s or m/s).
    """
    state = jnp.zeros(_size(fields), d.qpos.dtype)
    return d.replace(userdata=jnp.concatenate([d.userdata[: m.nuserdata], state]))


def check_state(m: mjx.Model, d: mjx.Data, fields: Fields | Prepared) -> None:
    """Raises JodaError where a joint needs state and `put_state` was not called."""
    size = _size(fields)
    if size and d.userdata.size != m.nuserdata + size:
        raise JodaError(
            "a joint has backlash or a learned force and the data no state for it; call "
            "d = joda.mjx.put_state(m, d, fields) once."
        )


def unpack(m: mjx.Model, d: mjx.Data, own: Effects, count: int) -> tuple[Array, Array, Array]:
    """Places and velocities of the joints' handles or loads, and memories; 0 where there are none.

    Args:
        m, d: model and data.
        own: the joints' effects.
        count: how many joints there are.
    """
    zero = jnp.zeros(count, d.qpos.dtype)
    loose, remembered = jnp.split(d.userdata[m.nuserdata :], [_loose_size(own, count)])
    g, w = (zero, zero) if own.backlash is None else loose.reshape(-1, 2).T
    return g, w, zero if own.learned_force is None else remembered


def pack(
    m: mjx.Model, d: mjx.Data, own: Effects, g: Array, w: Array, remembered: Array
) -> mjx.Data:
    """The data with other handles, loads and memories; arguments as of `unpack`."""
    parts = [] if own.backlash is None else [jnp.stack((g, w), axis=1).ravel()]
    parts += [] if own.learned_force is None else [remembered]
    if not parts:
        return d
    return d.replace(userdata=d.userdata.at[m.nuserdata :].set(jnp.concatenate(parts)))


def _loose_size(own: Effects, count: int) -> int:
    return 0 if own.backlash is None else 2 * count


def _size(fields: Fields | Prepared) -> int:
    every = (
        [(fields.effects, len(fields.places))]
        if isinstance(fields, Prepared)
        else [(field.effects, 1) for field in fields.values()]
    )
    return sum(_loose_size(own, n) + n * (own.learned_force is not None) for own, n in every)
