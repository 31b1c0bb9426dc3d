"""A joint put somewhere in its scene, with all that equality constraints couple to it."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.scene import DAMPING_ROW

Array = NDArray[np.float64]

HELD = 1e-6
"""Residual (m or rad) up to which a constraint holds."""
STEPS = 30
"""Most Gauss-Newton steps until constraints hold again."""
SINGULAR = 1e-6
"""Singular values of the constraints' Jacobian below this part of the largest count as zero."""


def put(model: mujoco.MjModel, data: mujoco.MjData, joint: int, position: float) -> bool:
    """Puts a joint somewhere, and moves other joints so that what held still holds.

    Of the equality constraints r(q) = 0 that held before, those that no longer do are solved by
    Gauss-Newton steps dq = -J⁺ r, the joint's own coordinate fixed; where that leads nowhere, other
    joints stay.

    Args:
        model: compiled.
        data: its state; only positions change.
        joint: id of a hinge or slide.
        position: rad or m.

    Returns:
        whether they hold: false where the scene does not let the joint be.
    """
    kept = _holding(model, data)
    data.qpos[model.jnt_qposadr[joint]] = position
    alone = data.qpos.copy()
    for _ in range(STEPS if kept else 0):
        mujoco.mj_fwdPosition(model, data)
        rows = np.flatnonzero(np.isin(_rows(data), kept))
        residual = _residual(data)[rows]
        if np.all(np.abs(residual) <= HELD):
            return True
        slope = _of_others(model, data, joint, rows)
        step = np.linalg.lstsq(slope, -residual, rcond=SINGULAR)[0]
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
    data.qpos[:] = alone
    return not kept


def taut(model: mujoco.MjModel, data: mujoco.MjData, joint: int) -> bool:
    """Whether a tendon is beyond its limits where a joint was put, and no other can slacken it."""
    mujoco.mj_fwdPosition(model, data)
    beyond = (data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON) & (data.efc_pos < -HELD)
    slope = _of_others(model, data, joint, np.flatnonzero(beyond))
    return bool(np.any(np.all(slope == 0, axis=1)))


def at_others_limit(model: mujoco.MjModel, data: mujoco.MjData, joint: int, before: Array) -> bool:
    """Whether a joint that moved along is beyond its own range where this one was put.

    `before`: qpos before that, shape (nq,).
    """
    mujoco.mj_fwdPosition(model, data)
    limits = data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
    beyond = data.efc_id[limits & (data.efc_pos < -HELD)]
    places = model.jnt_qposadr[beyond]
    return bool(np.any((beyond != joint) & (data.qpos[places] != before[places])))


def _holding(model: mujoco.MjModel, data: mujoco.MjData) -> list[int]:
    """The equality constraints, by id, that hold; none of those that carry a joint's damping."""
    others = [k for k in range(model.neq) if DAMPING_ROW not in model.equality(k).name]
    if not others:
        return []
    mujoco.mj_fwdPosition(model, data)
    broken = set(_rows(data)[np.abs(_residual(data)) > HELD].tolist())
    return [k for k in others if k not in broken]


def _rows(data: mujoco.MjData) -> NDArray[np.int32]:
    """Of which equality constraint each of their rows in the solver is; they come first."""
    return np.asarray(data.efc_id[: data.ne])


def _residual(data: mujoco.MjData) -> Array:
    return np.asarray(data.efc_pos[: data.ne])


def _of_others(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int, rows: NDArray[np.intp]
) -> Array:
    """These rows of the constraints' Jacobian, shape (m, nv), zero for the joint itself."""
    out, one = np.empty((len(rows), model.nv)), np.zeros(data.nefc)
    for k, row in enumerate(rows):
        one[row] = 1.0
        mujoco.mj_mulJacTVec(model, data, out[k], one)
        one[row] = 0.0
    out[:, model.jnt_dofadr[joint]] = 0.0
    return out
