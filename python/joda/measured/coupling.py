"""Coupling: the force of other joints of a log on a joint, by MuJoCo along the measured motion."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMOOTHED, ORDER = 0.3, 5
"""Time over which a motion is smoothed, s, and by polynomials of which order."""
SHORTER = 0.2
"""Another time, with which its error is told, s."""
GRID = 401
"""Positions at which what a joint needs by itself is asked for."""
MIN_SAMPLES = 9
"""Samples over which it is smoothed at least."""


@dataclass(frozen=True)
class Motion:
    """Smoothed positions of a joint, with speeds and accelerations; shape (n,) each."""

    position: Array
    velocity: Array
    acceleration: Array


def motion(time: Array, position: Array, over: float = SMOOTHED) -> Motion:
    """A motion smoothed over a time, s (Savitzky and Golay, Anal. Chem. 36 (1964) 1627)."""
    from scipy.signal import savgol_filter  # loading it takes longer than a short command

    count = len(time)
    grid = np.linspace(time[0], time[-1], count)
    gap = float(grid[1] - grid[0])
    wide = min(max(round(over / gap), MIN_SAMPLES) | 1, count - 1 + count % 2)
    even = np.interp(grid, time, position)
    found = [
        np.interp(time, grid, savgol_filter(even, wide, min(ORDER, wide - 1), deriv=k, delta=gap))
        for k in range(3)
    ]
    return Motion(*found)


def coupling_force(
    model: mujoco.MjModel,
    joint: int,
    time: Array,
    positions: Mapping[int, Array],
    over: float = SMOOTHED,
) -> Array:
    """The force on a joint of what else of the mechanism moves, or stands elsewhere.

    It is the joint's inverse dynamics with all other joints at their reference, minus that along
    the measured motion: with this force the joint by itself, all others held there, moves as it
    does among them. Friction, damping and springs have no part in it.

    Args:
        model: compiled.
        joint: its id.
        time: s, shape (n,).
        positions: measured, of the joint and others, by their ids; rad or m, shape (n,) each.
        over: time over which the motion is smoothed, s.

    Returns:
        N·m or N, shape (n,).
    """
    dof = int(model.jnt_dofadr[joint])
    motions = {k: motion(time, own, over) for k, own in positions.items()}
    own = motions[joint]
    grid = np.linspace(own.position.min(), own.position.max(), GRID)
    still = Motion(grid, np.zeros(GRID), np.zeros(GRID))
    pushed = Motion(grid, np.zeros(GRID), np.ones(GRID))
    held, more = (_needed(model, {joint: one})[:, dof] for one in (still, pushed))
    alone = np.interp(own.position, grid, held)
    alone += np.interp(own.position, grid, more - held) * own.acceleration
    return np.asarray(alone - _needed(model, motions)[:, dof])


def _needed(model: mujoco.MjModel, motions: Mapping[int, Motion]) -> Array:
    """The inverse dynamics along motions of some joints, all others at their reference; N·m or N,
    shape (n, nv)."""
    data, count = mujoco.MjData(model), len(next(iter(motions.values())).position)
    q = np.tile(model.qpos0, (count, 1))
    v, a, out = (np.zeros((count, model.nv)) for _ in range(3))
    for number, own in motions.items():
        at = model.jnt_dofadr[number]
        q[:, model.jnt_qposadr[number]] = own.position
        v[:, at], a[:, at] = own.velocity, own.acceleration
    qpos, qvel, qacc = data.qpos, data.qvel, data.qacc
    for k in range(count):
        qpos[:], qvel[:], qacc[:] = q[k], v[k], a[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, out[k])
    return out


def coupling_force_std(time: Array, force: Array, shorter: Array) -> Array:
    """Standard deviation of that force, as white noise from sample to sample, shape (n,).

    What another smoothing makes of it tells its error; that is the same over the time smoothed, so
    that it counts as so many times more of white noise.

    Args:
        time: s, shape (n,).
        force: smoothed over `SMOOTHED`.
        shorter: over `SHORTER`.
    """
    count = max(round(SMOOTHED * (len(time) - 1) / float(np.ptp(time))), 1)
    square = np.convolve((force - shorter) ** 2, np.full(count, 1 / count), mode="same")
    return np.asarray(np.sqrt(count * square))
