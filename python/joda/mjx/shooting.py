"""A scene simulated from many states side by side, with derivatives: for multiple shooting.

Windows of any length are stepped in pieces of one length and batches of one size, and derivatives
are taken forward along so many directions at once, so that JAX compiles twice: the motion, and the
motion with its derivatives.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from importlib import import_module
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.mjx.fields import Fields, prepare, put_fields
from joda.mjx.simulate import step
from joda.mjx.state import put_state
from joda.profile import Profile
from joda.scenes.model import sentence

Array = NDArray[np.float64]
Numbers = tuple[Fields, dict[str, NDArray[Any]]]
"""Of profiles and of the model."""

PIECE, BATCH, WAYS = 20, 32, 8
"""Steps that are compiled as one, segments side by side, and directions of derivatives: all are
filled up to multiples of these."""
STATE = ("qpos", "qvel", "qacc_warmstart", "qfrc_constraint", "qfrc_actuator", "userdata")
FORCE = "_impl.efc_force"
"""What of the state a step hands to the next."""
OWN = ("dof_armature", "dof_M0", "dof_invweight0", "body_invweight0", "jnt_solref")
"""Numbers of the model that change where a joint's inertia or the ends of its range do."""
_where: Any = jax if hasattr(jax, "enable_x64") else import_module("jax.experimental")
enable_x64 = _where.enable_x64
"""What makes numbers double within; older versions of JAX have it in another place."""
HELD = 1e8
"""Inertia of a joint that is held, in units of the scene's mean."""


class Scene:
    """A scene in MJX, from states of some of its joints; the others are held at the reference.

    Attributes:
        model: compiled.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        profiles: Mapping[str, Profile],
        joints: Sequence[int],
        effects: Sequence[str] = (),
    ) -> None:
        """Puts the scene into MJX.

        Args:
            model: compiled, as `joda attach` wrote it.
            profiles: that it carries, joint name to profile.
            joints: ids of those that move, hinges and slides.
            effects: names of those that other profiles may have besides.

        Raises:
            JodaError: MJX cannot simulate the scene, or its actuators have a state.
        """
        if model.na:
            raise JodaError("the scene's actuators have a state (dyntype), which no run tells.")
        self.model, self._profiles = copy(model), dict(profiles)
        named = {effect.effect for profile in profiles.values() for effect in profile.effects}
        self._effects = named | set(effects)
        dofs = model.jnt_dofadr[list(joints)]
        self._places = model.jnt_qposadr[list(joints)]
        self._of_start = np.stack([self._places, model.nq + dofs], axis=1).ravel()
        held = np.setdiff1d(np.arange(model.nv), dofs)
        self.model.dof_armature[held] += HELD * model.stat.meaninertia
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))
        with enable_x64(True):
            fields = self._fields({})
            try:
                self._m = mjx.put_model(self.model)
            except (NotImplementedError, ValueError) as error:
                raise JodaError(f"MJX cannot simulate this scene: {sentence(error)}") from None
            self._data = put_state(self._m, mjx.make_data(self._m), fields)
            self._rest = np.asarray(_packed(self._data))
        self._go = jax.jit(jax.vmap(self._piece, (None, 0, 0)))
        self._along = jax.jit(jax.vmap(self._derived, (None, None, 0, 0, 0)))

    def numbers(
        self, profiles: Mapping[str, Profile], changed: Mapping[str, NDArray[Any]]
    ) -> Numbers:
        """The scene with other profiles and other ones of the model's numbers (`OWN`): a pytree
        whose leaves are floating-point arrays, whose shapes no number changes."""
        own = {name: changed.get(name, getattr(self.model, name)) for name in OWN}
        with enable_x64(True):
            fields: Fields = jax.tree.map(np.asarray, self._fields(profiles))
        return fields, own

    def paths(self, numbers: Numbers, start: Array, inputs: Sequence[Array]) -> list[Array]:
        """Positions of the joints.

        Args:
            numbers: see there.
            start: of each segment, positions and velocities (rad or m, and per s) joint by joint;
                shape (m, 2 joints).
            inputs: of each segment, actuators' commands and forces on all degrees of freedom; shape
                (steps, nu + nv).

        Returns:
            of each segment, rad or m, shape (steps + 1, joints).
        """
        begun = self._begun(start)
        found = _run(lambda state, piece: self._go(numbers, state, piece), begun, inputs)
        first = begun[:, None, self._places]
        return [np.concatenate([a, path]) for a, path in zip(first, found, strict=True)]

    def slopes(
        self,
        numbers: Numbers,
        ways: Sequence[Numbers],
        start: Array,
        turns: Array,
        inputs: Sequence[Array],
    ) -> list[Array]:
        """Derivatives of `paths`.

        Args:
            numbers, start, inputs: see there.
            ways: directions of the numbers.
            turns: directions of the starts, shape (m, d, 2 joints).

        Returns:
            along the ones and then the others; of each segment, shape (steps + 1, ways + d,
            joints).
        """
        count, (many, own) = len(ways), turns.shape[:2]
        filled = count + -(-(count + own) // WAYS) * WAYS - count
        none = jax.tree.map(np.zeros_like, numbers)
        stacked = [*ways, *[none] * (filled - count)]
        tangents = jax.tree.map(lambda *leaves: np.stack(leaves), *stacked)
        moved = np.zeros((many, filled, len(self._rest)))
        moved[:, count : count + own, self._of_start] = turns
        begun = np.concatenate([self._begun(start)[:, None], moved], axis=1)

        def go(state: Any, piece: Array) -> tuple[Any, Any]:
            out: tuple[Any, Any] = self._along(numbers, tangents, state[:, 0], state[:, 1:], piece)
            return out

        found = _run(go, begun, inputs)
        first = moved[:, None, :, self._places]
        pairs = zip(first, found, strict=True)
        return [np.concatenate([a, path])[:, : count + own] for a, path in pairs]

    def _fields(self, profiles: Mapping[str, Profile]) -> Fields:
        every = {**self._profiles, **profiles}
        return put_fields(self.model, every, effects=sorted(self._effects))

    def _begun(self, start: Array) -> Array:
        """The states, shape (m, state)."""
        out = np.tile(self._rest, (len(start), 1))
        out[:, self._of_start] = start
        return out

    def _piece(self, numbers: Numbers, state: Any, inputs: Any) -> tuple[Any, Any]:
        """A segment's next steps: the state then, and the positions after each."""
        fields, own = numbers
        m, prepared = self._m.replace(**own), prepare(fields)

        def once(state: Any, put: Any) -> tuple[Any, Any]:
            d = _unpacked(self._data, state)
            d = d.replace(ctrl=put[: m.nu], qfrc_applied=put[m.nu :])
            d = step(m, d, prepared)
            return _packed(d), d.qpos[self._places]

        return jax.lax.scan(once, state, inputs)

    def _derived(
        self, numbers: Numbers, tangents: Numbers, state: Any, moved: Any, inputs: Any
    ) -> tuple[Any, Any]:
        """The same with derivatives: the state with its derivatives in the rows below, and the
        positions' derivatives, shape (steps, ways, joints)."""

        def along(tangent: Numbers, moves: Any) -> Any:
            return jax.jvp(
                lambda numbers, state: self._piece(numbers, state, inputs),
                (numbers, state),
                (tangent, moves),
            )

        (after, _), (turned, path) = jax.vmap(along, out_axes=(None, 0))(tangents, moved)
        return jnp.concatenate([after[None], turned]), path.transpose(1, 0, 2)


def _packed(d: mjx.Data) -> Any:
    parts = [getattr(d, name) for name in STATE] + [d._impl.efc_force]
    return jnp.concatenate(parts)


def _unpacked(d: mjx.Data, state: Any) -> mjx.Data:
    parts, at = {}, 0
    for name in (*STATE, FORCE):
        size = (d._impl.efc_force if name == FORCE else getattr(d, name)).size
        parts[name] = state[at : at + size]
        at += size
    return d.tree_replace(parts)


def _run(
    go: Callable[[Any, Array], tuple[Any, Any]], begun: Array, inputs: Sequence[Array]
) -> list[Array]:
    """What `go` makes of each segment, piece by piece, segments of like length side by side.

    Args:
        go: states and inputs, shapes (BATCH, ...) and (BATCH, PIECE, inputs), to the states then
            and what is kept, shape (BATCH, PIECE, ...).
        begun: states at first, shape (m, ...).
        inputs: of each segment, shape (steps, inputs).
    """
    out: list[Any] = [None] * len(inputs)
    order = sorted(range(len(inputs)), key=lambda k: len(inputs[k]))
    for first in range(0, len(order), BATCH):
        own = order[first : first + BATCH]
        pieces = -(-len(inputs[own[-1]]) // PIECE)
        put = np.zeros((BATCH, pieces * PIECE, inputs[0].shape[1]))
        for row, k in zip(put, own, strict=False):
            row[: len(inputs[k])] = inputs[k]
        state: Any = begun[own + [own[0]] * (BATCH - len(own))]
        kept = []
        with enable_x64(True):
            for k in range(pieces):
                state, path = go(state, put[:, k * PIECE : (k + 1) * PIECE])
                kept.append(np.asarray(path))
        whole = np.concatenate(kept, axis=1)
        for row, k in zip(whole, own, strict=False):
            out[k] = row[: len(inputs[k])]
    return out
