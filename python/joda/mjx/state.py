"""The state of handles and loads with play, which `mjx.Data` has no place for: in `userdata`."""

import jax.numpy as jnp
from mujoco import mjx

from joda.errors import JodaError
from joda.mjx.fields import Fields, Prepared


def put_state(m: mjx.Model, d: mjx.Data, fields: Fields | Prepared) -> mjx.Data:
    """The data with what is beyond the play of joints with backlash in the middle of it.

    Handles are at rest there; loads move with their joint.

    Args:
        m: of `mjx.put_model`.
        d: the data; what is in its `userdata` stays.
        fields: of `put_fields`.

    Returns:
        the data. If a joint has backlash, two numbers per joint of the fields, in their order, are
        behind the model's own `userdata`: position of the handle or the load minus that of the part
        (rad or m), and velocity of the handle, or of the load minus that of the part.
    """
    state = jnp.zeros(_size(fields), d.qpos.dtype)
    return d.replace(userdata=jnp.concatenate([d.userdata[: m.nuserdata], state]))


def check_state(m: mjx.Model, d: mjx.Data, fields: Fields | Prepared) -> None:
    """Raises JodaError where a joint has backlash and `put_state` was not called."""
    size = _size(fields)
    if size and d.userdata.size != m.nuserdata + size:
        raise JodaError(
            "a joint has backlash and the data no state for it; call "
            "d = joda.mjx.put_state(m, d, fields) once."
        )


def _size(fields: Fields | Prepared) -> int:
    if isinstance(fields, Prepared):
        return 2 * len(fields.places) if fields.effects.backlash is not None else 0
    return 2 * sum(field.effects.backlash is not None for field in fields.values())
