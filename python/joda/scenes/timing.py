"""Seconds per step of a model, by the clock of this thread where the system counts it finely."""

import time
from typing import Any

import mujoco
import numpy as np

SWING = 100  # steps of one joint's swing; it moves all the while
MIN_SWING = 20  # steps of many joints', so short that a busy machine seldom breaks in
FINE = time.get_clock_info("thread_time").resolution < 1e-6
CLOCK = time.thread_time if FINE else time.perf_counter
"""Where the system counts it finely, the time of this thread alone."""
FULL = mujoco.mjtState.mjSTATE_INTEGRATION


def swings_in(length: float, model: mujoco.MjModel, callback: Any = None) -> int:
    """How many swings take about so long (s), at least one."""
    return max(1, int(length / (_steps(model) * seconds_per_step(model, callback))))


def _steps(model: mujoco.MjModel) -> int:
    """Of a swing."""
    return max(MIN_SWING, SWING // int(model.nv))


def seconds_per_step(model: mujoco.MjModel, callback: Any = None, repeats: int = 1) -> float:
    """Seconds per step of the fastest of short swings through the middle of the joints' ranges."""
    data = mujoco.MjData(model)
    limited = np.asarray(model.jnt_limited, bool) & (np.asarray(model.jnt_type) >= 2)
    data.qpos[model.jnt_qposadr[limited]] = model.jnt_range[limited].mean(axis=1)
    data.qvel[:] = 0.5
    start = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, start, FULL)
    mujoco.set_mjcb_passive(callback)
    steps, fastest = _steps(model), np.inf
    try:
        for _ in range(repeats):
            mujoco.mj_setState(model, data, start, FULL)
            begin = CLOCK()
            mujoco.mj_step(model, data, steps)
            fastest = min(fastest, CLOCK() - begin)
    finally:
        mujoco.set_mjcb_passive(None)
    return fastest / steps
