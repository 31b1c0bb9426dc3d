"""A joint in motion, and what gravity does to it, in MuJoCo."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """A joint's motion: arrays of one length.

    Attributes:
        time: s.
        position: rad or m.
        velocity: rad/s or m/s.
    """

    time: Array
    position: Array
    velocity: Array


def release(model: mujoco.MjModel, joint: int, position: float, duration: float) -> Motion:
    """Lets the joint go from rest, with all other joints at their reference position.

    Args:
        model: the compiled scene.
        joint: its id.
        position: where it is let go, rad or m.
        duration: s.

    Returns:
        the motion, one sample per timestep, the start included.
    """
    data = mujoco.MjData(model)
    qpos, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    data.qpos[qpos] = position
    steps = round(duration / model.opt.timestep)
    out = np.empty((steps + 1, 3))
    for k in range(steps + 1):
        out[k] = data.time, data.qpos[qpos], data.qvel[dof]
        if k < steps:
            mujoco.mj_step(model, data)
    return Motion(*out.T)


def gravity_force(model: mujoco.MjModel, joint: int, positions: Array) -> Array:
    """Generalised force of gravity on the joint at each position, N·m or N, others at rest.

    Args:
        model: the compiled scene.
        joint: its id.
        positions: shape (n,).

    Returns:
        shape (n,); positive drives the joint towards larger positions.
    """
    data = mujoco.MjData(model)
    out, bias = np.empty(len(positions)), np.empty(model.nv)
    for k, position in enumerate(positions):
        data.qpos[model.jnt_qposadr[joint]] = position
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_rne(model, data, 0, bias)  # at rest, all of it is gravity
        out[k] = -bias[model.jnt_dofadr[joint]]
    return out
