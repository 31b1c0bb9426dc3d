"""Profiles inside MJX: the law of the engine plugin, in JAX.

`step` is `mujoco.mjx.step` with the profiles that a scene carries. It solves the problem that the
plugin solves, through the same two rows per joint (docs/physics.md), and is differentiable in both
modes: at a solution of the constraint solver the derivatives are those of the implicit function
theorem, whatever the solver did to get there.

    profiles = joda.read_profiles("scene.xml")
    model = mujoco.MjModel.from_xml_path("scene.xml")
    fields = joda.mjx.put_fields(model, profiles)
    m, d = mjx.put_model(model), mjx.make_data(model)
    d = jax.jit(joda.mjx.step)(m, d, fields)

A joint's friction of the last step, which the plugin keeps in `plugin_state`, is read from
`d._impl.efc_force`, so no state is needed beyond `mjx.Data`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np

from joda.errors import JodaError
from joda.model import find_joint
from joda.profile import CHANNELS, Profile
from joda.scene import DAMPING_ROW

try:
    import jax
    import jax.numpy as jnp
    from mujoco import mjx

    from joda.field import jaxfield
except ImportError as error:
    raise JodaError(
        f'joda.mjx needs JAX and MJX (no module {error.name}); run: pip install ".[mjx]"'
    ) from None

SUPPORTED = "3.17"
"""Of mujoco-mjx: other versions may have other internals than `_pipeline` is composed of."""

if not f"{version('mujoco-mjx')}.".startswith(f"{SUPPORTED}."):
    raise JodaError(
        f"joda.mjx works with mujoco-mjx {SUPPORTED} and found {version('mujoco-mjx')}; "
        f"run: pip install 'mujoco-mjx=={SUPPORTED}.*'"
    )

from mujoco.mjx._src import forward, sensor, solver  # noqa: E402

Array = jax.Array

EXPLICIT_STIFFNESS = 1.0
"""As kExplicitStiffness in cpp/joint_dynamics.cc, and so on."""
STRIDE = 0.25
STIFF_ROW = 1e4
IDLE_ROW = 1e-12


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
    """

    joint: int
    dof: int
    qpos: int
    friction_row: int
    damping_row: int
    equality: int


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("conservative", "friction", "damping", "range"),
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
        place: where the joint is in the model; not a number to differentiate by.
    """

    conservative: jaxfield.Channel
    friction: jaxfield.Channel
    damping: jaxfield.Channel
    range: Array
    place: Place

    def replace(self, **changes: Any) -> "Field":
        """The same with other channels or range."""
        return replace(self, **changes)


Fields = dict[str, Field]
"""Joint name to field: what `step` takes. A pytree; all its leaves are floating-point arrays."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("conservative", "friction", "damping", "range"),
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
        places: by joint.
        orders: for each channel, where in its stacks the joints are.
    """

    conservative: tuple[jaxfield.Cubics, ...]
    friction: tuple[jaxfield.Cubics, ...]
    damping: tuple[jaxfield.Cubics, ...]
    range: Array
    places: tuple[Place, ...]
    orders: tuple[tuple[int, ...], ...]


def put_fields(
    model: mujoco.MjModel,
    profiles: Mapping[str, Profile],
    *,
    components: int = 0,
    knots: int = 0,
    dtype: Any = None,
) -> Fields:
    """The fields of profiles that a scene carries.

    Args:
        model: the scene that `joda attach` wrote, compiled; for `mjx.put_model`.
        profiles: joint name to profile, as of `joda.read_profiles`.
        components: at least so many places for components in each channel, so that profiles of
            different sizes can be stacked.
        knots: at least so many places for control points in each component.
        dtype: of the arrays; by default JAX's own.

    Returns:
        joint name to field. All channels have the same shape.

    Raises:
        JodaError: a joint does not exist, has no friction row although its profile has friction,
            or the scene's options are none that MJX and the plugin share.
    """
    _check_options(model)
    channels = [getattr(p.channels, name) for p in profiles.values() for name in CHANNELS]
    components = max([components, *(len(channel.components) for channel in channels)])
    knots = max([knots, *(len(part.x) for channel in channels for part in channel.components)])
    fields = {}
    for name, profile in profiles.items():
        place = _place(model, find_joint(model, name))
        enabled = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS
        if place.friction_row < 0 and enabled and profile.channels.friction.components:
            raise JodaError(
                f"joint '{name}' has friction in its profile and no friction row; "
                'add frictionloss="1e-12" to the joint.'
            )
        parts = {
            key: jaxfield.from_channel(getattr(profile.channels, key), components, knots, dtype)
            for key in CHANNELS
        }
        limits = jnp.asarray(profile.joint.range, dtype)
        fields[name] = Field(**parts, range=limits, place=place)
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
    return Prepared(**stacks, range=limits, places=places, orders=tuple(orders))


def step(m: mjx.Model, d: mjx.Data, fields: Fields | Prepared) -> mjx.Data:
    """One step of the simulation with the profiles acting.

    Args:
        m: of `mjx.put_model`.
        d: the state.
        fields: of `put_fields` (or what `prepare` makes of them).

    Returns:
        the state after the step, as of `mjx.step`.

    Raises:
        JodaError: the integrator is RK4.
    """
    if m.opt.integrator not in (mjx.IntegratorType.EULER, mjx.IntegratorType.IMPLICITFAST):
        raise JodaError(
            f"joda.mjx steps with the integrators Euler and implicitfast, not "
            f"{m.opt.integrator.name}; set option/integrator."
        )
    prepared = fields if isinstance(fields, Prepared) else prepare(fields)
    return _pipeline(m, d, partial(_act, prepared=prepared) if prepared.places else None)


def rollout(
    m: mjx.Model,
    d: mjx.Data,
    fields: Fields | Prepared,
    inputs: Any,
    *,
    apply: Callable[[mjx.Data, Any], mjx.Data] = lambda d, x: d.replace(qfrc_applied=x),
    read: Callable[[mjx.Data], Any] = lambda d: (d.qpos, d.qvel),
) -> tuple[mjx.Data, Any]:
    """Steps through inputs, with `jax.lax.scan`.

    Args:
        m: of `mjx.put_model`.
        d: the state at the start.
        fields: of `put_fields`.
        inputs: arrays with one entry per step; by default forces on the joints, shape (steps, nv).
        apply: puts one entry into the state before the step.
        read: what to keep of the state after each step.

    Returns:
        the state at the end, and what was kept, stacked.
    """
    prepared = fields if isinstance(fields, Prepared) else prepare(fields)

    def once(d: mjx.Data, x: Any) -> tuple[mjx.Data, Any]:
        d = step(m, apply(d, x), prepared)
        return d, read(d)

    return jax.lax.scan(once, d, inputs)


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
        for k in np.flatnonzero(joints):
            own = model.eq_obj1id[k] == joint and model.eq_obj2id[k] < 0
            if own and DAMPING_ROW.rstrip("_") in model.equality(int(k)).name:
                equality, damping_row = int(k), int(before + joints[:k].sum())
                break
    dof = int(model.jnt_dofadr[joint])
    if model.dof_frictionloss[dof] > 0 and not (none or off & bit.mjDSBL_FRICTIONLOSS):
        rows = 0 if off & bit.mjDSBL_EQUALITY else int(sizes.sum())
        friction_row = rows + int((model.dof_frictionloss[:dof] > 0).sum())
    return Place(joint, dof, int(model.jnt_qposadr[joint]), friction_row, damping_row, equality)


def _stack(items: list[Any]) -> Any:
    try:
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *items)
    except (ValueError, TypeError):
        raise JodaError(
            "the fields of the joints have different shapes; make them with one put_fields, or "
            "give it components= and knots=."
        ) from None


def _each(
    stacks: tuple[jaxfield.Cubics, ...], order: tuple[int, ...], of: Any, *args: Array
) -> Any:
    """Applies `of(cubics, ...)` to each joint; arguments and results in the joints' order."""
    back = np.argsort(np.array(order, int))
    parts, first = [], 0
    for stack in stacks:
        members = back[first : first + len(stack.a)]
        parts.append(jax.vmap(of)(stack, *(arg[members] for arg in args)))
        first += len(members)
    return jax.tree.map(lambda *p: jnp.concatenate(p)[np.array(order, int)], *parts)


def _act(m: mjx.Model, d: mjx.Data, psi: Array, prepared: Prepared) -> mjx.Data:
    """The plugin's compute: forces and rows of all joints, from the state before the step.

    Args:
        m: model.
        d: the state, with its rows and passive forces made.
        psi: the forces of all rows in the step before.
        prepared: the fields.
    """
    off, bit = m.opt.disableflags, mjx.DisableBit
    spring, damper = not off & bit.SPRING, not off & bit.DAMPER
    if not (spring or damper):  # MuJoCo skips all passive forces then
        return d
    index = {
        key: np.array([getattr(place, key) for place in prepared.places])
        for key in ("dof", "qpos", "friction_row", "damping_row", "equality")
    }
    dof, h = index["dof"], m.opt.timestep
    inertia, v = 1 / m.dof_invweight0[dof], d.qvel[dof]
    lo, hi = prepared.range[:, 0], prepared.range[:, 1]
    per_range = 1 / (hi - lo)
    s = (d.qpos[index["qpos"]] - lo) * per_range
    order = dict(zip(CHANNELS, prepared.orders, strict=True))

    force = stiffness = drag = friction = jnp.zeros_like(v)
    if spring:
        stacks = prepared.conservative
        force, _ = _each(stacks, order["conservative"], jaxfield.evaluate, s)
        soft = EXPLICIT_STIFFNESS * inertia / h**2
        reach = h * (jnp.abs(v) + h / inertia * jnp.abs(force)) * per_range
        descent = jaxfield.max_descent
        steepest = _each(stacks, order["conservative"], descent, s - reach, s + reach)
        stride = jnp.abs(force) * per_range / STRIDE
        stiffness = jnp.maximum(0, jnp.maximum(stride, steepest * per_range) - soft)
        drag = h * stiffness
    if damper:
        drag = drag + _each(prepared.damping, order["damping"], jaxfield.evaluate, s)[0]
    if not off & bit.FRICTIONLOSS:
        friction, _ = _each(prepared.friction, order["friction"], jaxfield.evaluate, s)

    rows, at = _Rows(d), np.flatnonzero(index["friction_row"] >= 0)
    row = index["friction_row"][at]
    bound = friction[at] + m.dof_frictionloss[dof[at]]
    rows.set(row, STIFF_ROW * inertia[at], bound, jnp.clip(psi[row], -bound, bound), v[at] / h)
    friction = friction.at[at].set(0)

    at = np.flatnonzero(index["damping_row"] >= 0)
    row, on = index["damping_row"][at], d.eq_active[index["equality"][at]] != 0
    resistance = jnp.maximum(h * drag[at], IDLE_ROW * inertia[at])
    rows.set(row, resistance, 0, 0, v[at] / h)
    held = jnp.zeros(len(dof), bool).at[at].set(on)
    force = jnp.where(held, force, force / (1 + h * h * stiffness / inertia))
    drag = jnp.where(held, 0, drag)

    # what has no row becomes a force that at most stops the joint within the step
    stop = inertia * jnp.abs(v) / h
    limited = jnp.minimum(friction + drag * jnp.abs(v) / (1 + h * drag / inertia), stop)
    force = force - jnp.sign(v) * limited
    d = rows.write(d)
    return d.replace(qfrc_passive=d.qfrc_passive.at[dof].add(force))


# --- the internals of MJX, all of them here


class _Rows:
    """Rows that resist the velocity at the end of the step."""

    def __init__(self, d: mjx.Data) -> None:
        self.D, self.aref = d._impl.efc_D, d._impl.efc_aref
        self.frictionloss = d._impl.efc_frictionloss

    def set(self, row: Any, D: Any, bound: Any, offset: Any, rate: Any) -> None:
        """Makes the force offset - D (a + rate), within +-bound; rate is velocity / timestep."""
        self.D = self.D.at[row].set(D)
        self.aref = self.aref.at[row].set(offset / D - rate)
        self.frictionloss = self.frictionloss.at[row].set(bound)

    def write(self, d: mjx.Data) -> mjx.Data:
        return d.tree_replace(
            {
                "_impl.efc_D": self.D,
                "_impl.efc_aref": self.aref,
                "_impl.efc_frictionloss": self.frictionloss,
            }
        )


def _pipeline(m: mjx.Model, d: mjx.Data, act: Callable[..., mjx.Data] | None) -> mjx.Data:
    """`mjx.step`, with `act` where MuJoCo calls a plugin's compute."""
    psi = d._impl.efc_force
    d = forward.fwd_position(m, d)
    d = sensor.sensor_pos(m, d)
    d = forward.fwd_velocity(m, d)
    if act is not None:
        d = act(m, d, psi)
    d = sensor.sensor_vel(m, d)
    d = forward.fwd_actuation(m, d)
    d = forward.fwd_acceleration(m, d)
    if d._impl.efc_J.size == 0:
        d = d.replace(qacc=d.qacc_smooth)
    else:
        qacc, qfrc_constraint, efc_force = _solve(m, d)
        d = d.replace(qacc=qacc, qfrc_constraint=qfrc_constraint)
        d = d.tree_replace({"_impl.efc_force": efc_force})
        d = sensor.sensor_acc(m, d)
    if m.opt.integrator == mjx.IntegratorType.EULER:
        return forward.euler(m, d)
    return forward.implicit(m, d)


@jax.custom_jvp
def _solve(m: mjx.Model, d: mjx.Data) -> tuple[Array, Array, Array]:
    """The solver's qacc, qfrc_constraint and efc_force."""
    out = solver.solve(m, d)
    return out.qacc, out.qfrc_constraint, out._impl.efc_force


@_solve.defjvp
def _solve_jvp(primals: Any, tangents: Any) -> Any:
    """By the implicit function theorem: the solution makes M qacc - qfrc_smooth - J' f zero.

    The derivative of the solver's own loop would be that of its last iteration, and none at all
    where the last step's solution is good enough for this one.
    """
    m, d = primals
    out = _solve(m, d)

    def balance(m: mjx.Model, d: mjx.Data, qacc: Array) -> Any:
        context = solver.Context.create(m, d.replace(qacc=qacc), grad=False)
        residual = context.Ma - d.qfrc_smooth - context.qfrc_constraint
        return residual, (context.qfrc_constraint, context.efc_force)

    hessian = jax.jacfwd(lambda qacc: balance(m, d, qacc)[0])(out[0])
    _, change = jax.jvp(lambda m, d: balance(m, d, out[0])[0], primals, tangents)
    factor = jax.scipy.linalg.cho_factor(0.5 * (hessian + hessian.T))
    moved = -jax.scipy.linalg.cho_solve(factor, change)
    _, (_, forces) = jax.jvp(balance, (m, d, out[0]), (*tangents, moved))
    return out, (moved, *forces)
