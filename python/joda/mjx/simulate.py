"""Stepping with profiles."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
from mujoco import mjx

from joda.errors import JodaError
from joda.mjx.fields import Fields, Prepared, prepare
from joda.mjx.internals import pipeline
from joda.mjx.law import act
from joda.mjx.state import check_state


def step(m: mjx.Model, d: mjx.Data, fields: Fields | Prepared) -> mjx.Data:
    """One step of the simulation with the profiles acting.

    Args:
        m: of `mjx.put_model`.
        d: the state.
        fields: of `put_fields` (or what `prepare` makes of them).

    Returns:
        the state after the step, as of `mjx.step`.

    Raises:
        JodaError: the integrator is RK4, or a joint has backlash or a learned force and `put_state`
            was not called.
    """
    if m.opt.integrator not in (mjx.IntegratorType.EULER, mjx.IntegratorType.IMPLICITFAST):
        raise JodaError(
            f"joda.mjx steps with the integrators Euler and implicitfast, not "
            f"{m.opt.integrator.name}; set option/integrator."
        )
    check_state(m, d, fields)
    prepared = fields if isinstance(fields, Prepared) else prepare(fields)
    return pipeline(m, d, partial(act, prepared=prepared) if prepared.places else None)


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
