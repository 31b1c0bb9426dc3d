"""Which actuators act on a joint: directly, by a tendon, a site or a slider-crank."""

import mujoco
import numpy as np

PLACES = 5
"""At how many places of the range moment arms are looked at: a crank has none at its dead point."""
LEAST = 1e-9
"""Moment arms below this are rounding."""


def acting_on(model: mujoco.MjModel, joint: int) -> list[int]:
    """The actuators, by id, that have a moment arm on a joint somewhere in its range.

    All other joints are at their reference. Actuators that are disabled do not act, nor does
    adhesion, which only holds what it touches.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
    """
    if not model.nu or model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION:
        return []
    data, dof = mujoco.MjData(model), int(model.jnt_dofadr[joint])
    lo, hi = map(float, model.jnt_range[joint])
    acts = np.zeros(model.nu, bool)
    for position in np.linspace(lo, hi, PLACES):
        data.qpos[model.jnt_qposadr[joint]] = position
        mujoco.mj_fwdPosition(model, data)
        for k in range(model.nu):
            own = slice(data.moment_rowadr[k], data.moment_rowadr[k] + data.moment_rownnz[k])
            arms = data.actuator_moment[own][data.moment_colind[own] == dof]
            acts[k] |= bool(np.any(np.abs(arms) > LEAST))
    acts &= model.actuator_trntype != mujoco.mjtTrn.mjTRN_BODY
    group = np.clip(model.actuator_group, 0, 31)
    acts &= (model.opt.disableactuator >> group) & 1 == 0
    return [int(k) for k in np.flatnonzero(acts)]


def actuators_on(model: mujoco.MjModel, joint: int) -> tuple[str, ...]:
    """The same by name, or "actuator 3" where it has none."""
    return tuple(model.actuator(k).name or f"actuator {k}" for k in acting_on(model, joint))
