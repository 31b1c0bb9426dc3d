"""A joint in motion, and what gravity does to it, in MuJoCo."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SET_OUT = 0.3
"""Time constant (s) with which a hand reaches its speed."""

FIRMEST = 0.05
"""Largest stiffness of a hand, in units of inertia per timestep squared: it acts explicitly."""


@dataclass(frozen=True)
class Motion:
    """A joint's motion: arrays of one length.

    Attributes:
        time: s.
        position: rad or m.
        velocity: rad/s or m/s.
        force: that acted on the joint from outside, N·m or N.
    """

    time: Array
    position: Array
    velocity: Array
    force: Array


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
    out = np.zeros((steps + 1, 4))
    for k in range(steps + 1):
        out[k, :3] = data.time, data.qpos[qpos], data.qvel[dof]
        if k < steps:
            mujoco.mj_step(model, data)
    return Motion(*out.T)


def pull(
    model: mujoco.MjModel,
    joint: int,
    start: float,
    end: float,
    strength: float,
    stiffness: float,
    duration: float = 3.0,
) -> Motion:
    """A hand moves the joint slowly from rest at `start` to `end`, others at their reference.

    The hand is a spring and a damper to a target that sets out gently and then moves at a constant
    speed; its force is bounded. Where a latch lets go, the joint runs ahead of the hand as far as
    its softness allows.

    Args:
        model: the compiled scene.
        joint: its id.
        start, end: rad or m.
        strength: the hand's largest force, N·m or N.
        stiffness: of the hand, N·m/rad or N/m; at most what the timestep allows is used.
        duration: in which the target goes from start to end, s. It then goes on until the hand's
            force is exhausted or the joint has arrived.

    Returns:
        the motion until the joint has arrived, or the hand has pulled with all its strength for
        half a second.
    """
    data = mujoco.MjData(model)
    qpos, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    data.qpos[qpos] = start
    mujoco.mj_forward(model, data)
    mass = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    inertia, step = float(mass[dof, dof]), model.opt.timestep
    span, sign = abs(end - start), float(np.sign(end - start))
    stiffness = min(stiffness, FIRMEST * inertia / step**2)
    damping = 2 * np.sqrt(stiffness * inertia)
    out, spent = [], 0.0
    while True:
        speed = (end - start) / duration * (1 - np.exp(-data.time / SET_OUT))
        target = start + (end - start) / duration * data.time - SET_OUT * speed
        wanted = stiffness * (target - data.qpos[qpos]) + damping * (speed - data.qvel[dof])
        force = float(np.clip(wanted, -strength, strength))
        out.append((data.time, data.qpos[qpos], data.qvel[dof], force))
        arrived = sign * (end - data.qpos[qpos]) <= 0.005 * span
        spent = spent + step if sign * force >= strength else 0.0
        if arrived or spent >= 0.5:
            return Motion(*np.array(out).T)
        data.qfrc_applied[dof] = force
        mujoco.mj_step(model, data)


def settle(model: mujoco.MjModel, joint: int, position: float, patience: float) -> Motion:
    """As `release`, until the joint has come to rest or `patience` (s) has passed.

    At rest: within a quarter of a second it has moved less than 1e-4 of its range.
    """
    data = mujoco.MjData(model)
    qpos, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    span = float(np.ptp(model.jnt_range[joint]))
    data.qpos[qpos] = position
    out = [(0.0, position, 0.0, 0.0)]
    pause = max(round(0.25 / model.opt.timestep), 1)
    stride = max(pause // 25, 1)
    while data.time < patience:
        mujoco.mj_step(model, data, stride)
        out.append((data.time, data.qpos[qpos], data.qvel[dof], 0.0))
        recent = [row[1] for row in out[-(pause // stride + 1) :]]
        if len(recent) > pause // stride and max(recent) - min(recent) < 1e-4 * span:
            break
    return Motion(*np.array(out).T)


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
        mujoco.mj_passive(model, data)
        out[k] = (data.qfrc_gravcomp - bias)[model.jnt_dofadr[joint]]
    return out
