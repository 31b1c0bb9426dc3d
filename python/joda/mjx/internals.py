"""The internals of MJX, all of them here: its rows, its step, its solver."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from mujoco import mjx
from mujoco.mjx._src import forward, sensor, solver

Array = jax.Array


class Rows:
    """The constraints' rows of a step."""

    def __init__(self, d: mjx.Data) -> None:
        """Takes the rows that MJX has made."""
        self.D, self.aref = d._impl.efc_D, d._impl.efc_aref
        self.frictionloss = d._impl.efc_frictionloss
        self.J, self.pos = d._impl.efc_J, d._impl.efc_pos - d._impl.efc_margin

    def set(self, row: Any, D: Any, bound: Any, offset: Any, rate: Any) -> None:
        """Makes a row resist the velocity at the end of the step.

        Its force is offset - D (a + rate), within +-bound; rate is velocity / timestep.
        """
        self.D = self.D.at[row].set(D)
        self.aref = self.aref.at[row].set(offset / D - rate)
        self.frictionloss = self.frictionloss.at[row].set(bound)

    def limit(self, row: Any, on: Any, D: Any, aref: Any) -> None:
        """Makes limits push with D (aref - a), where `on`."""
        self.D = self.D.at[row].set(jnp.where(on, D, self.D[row]))
        self.aref = self.aref.at[row].set(jnp.where(on, aref, self.aref[row]))

    def write(self, d: mjx.Data) -> mjx.Data:
        """The state with these rows."""
        return d.tree_replace(
            {
                "_impl.efc_D": self.D,
                "_impl.efc_aref": self.aref,
                "_impl.efc_frictionloss": self.frictionloss,
            }
        )


class Last:
    """The forces of the step before."""

    def __init__(self, d: mjx.Data) -> None:
        """Takes them from the state that it left behind."""
        self.force, self._J = d._impl.efc_force, d._impl.efc_J
        self._constraint, self._actuator = d.qfrc_constraint, d.qfrc_actuator

    def unknown_load(self, dof: Any, own: Any) -> Array:
        """Of the loads on joints, what is not known before a step, N·m or N.

        Args:
            dof: of the joints, shape (joints,).
            own: rows that are not load but the joints' own, -1 for none, shape (rows, joints).
        """
        forces = jnp.where(own < 0, 0, self._J[own, dof] * self.force[own]).sum(0)
        load: Array = self._constraint[dof] - forces - self._actuator[dof]
        return load


Settle = Callable[[mjx.Data], mjx.Data]


def pipeline(
    m: mjx.Model, d: mjx.Data, act: Callable[..., tuple[mjx.Data, Settle]] | None
) -> mjx.Data:
    """`mjx.step`, with `act` where MuJoCo calls a plugin's compute.

    What that returns besides the state is done where MuJoCo calls a plugin's advance.
    """
    last = Last(d)
    d = forward.fwd_position(m, d)
    d = sensor.sensor_pos(m, d)
    d = forward.fwd_velocity(m, d)
    settle: Settle | None = None
    if act is not None:
        d, settle = act(m, d, last)
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
        d = forward.euler(m, d)
    else:
        d = forward.implicit(m, d)
    return settle(d) if settle else d


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
