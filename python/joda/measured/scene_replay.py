"""A log of several joints replayed as a whole: the scene as it is, under the logged commands."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.measured import smoothing
from joda.measured.driven import joints_in
from joda.measured.runs import held, read_together
from joda.measured.table import header, read_table
from joda.scenes.actuators import actuators_on

Array = NDArray[np.float64]

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
INPUTS = int(mujoco.mjtState.mjSTATE_CTRL) | int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)


@dataclass(frozen=True)
class Together:
    """A log against its replay in the scene.

    Attributes:
        file: its name.
        rmse: of each joint's position, by name, rad or m; NaN where the scene is unstable.
    """

    file: str
    rmse: dict[str, float]


def replayed_together(model: mujoco.MjModel, paths: Sequence[Path]) -> tuple[Together, ...]:
    """Replays logs open loop from their first positions, all joints at once, contacts included.

    Args:
        model: compiled, with its actuators.
        paths: logs with `position:JOINT`, and `ctrl:ACTUATOR` of all that drives these joints.

    Returns:
        none where a command is missing.

    Raises:
        JodaError: a file cannot be read.
    """
    found = [_replayed(model, path) for path in paths]
    return tuple(one for one in found if one) if all(found) else ()


def _replayed(model: mujoco.MjModel, path: Path) -> Together | None:
    joints = joints_in(model, path)
    if not joints:
        raise JodaError(f"{path}: no column 'position:JOINT' of a hinge or slide of the model.")
    ids = [int(model.joint(name).id) for name in joints]
    acting = sorted({name for k in ids for name in actuators_on(model, k)})
    names = {name.lower() for name in header(path)}
    columns = [f"ctrl:{name}" for name in acting]
    if any(column.lower() not in names for column in columns):
        return None
    run, positions = read_together(path, joints[0], joints[1:])
    time = run.time - run.time[0]
    steps = int(np.ceil(time[-1] / model.opt.timestep))
    edges = model.opt.timestep * np.arange(steps + 1)
    inputs = np.zeros((steps, model.nu + model.nv))
    if columns:
        table = read_table(path, columns, "signals")
        for name, column in zip(acting, columns, strict=True):
            inputs[:, model.actuator(name).id] = held(time, table.columns[column], edges)
    data = mujoco.MjData(model)
    for k, name in zip(ids, joints, strict=True):
        own = positions[name]
        sigma = max(smoothing.noise(run.time, own), 1e-12)
        data.qpos[model.jnt_qposadr[k]] = own[0]
        if not smoothing.begins_at_rest(run.time, own, sigma):
            begun = smoothing.smooth(run.time, own, run.time[:1], sigma)
            data.qvel[model.jnt_dofadr[k]] = begun.velocity[0]
    state = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, state, FULL)
    states, _ = rollout.rollout(model, data, state[None], inputs[None], control_spec=INPUTS)
    paths = np.vstack([state, states[0]])[:, 1 : 1 + model.nq]
    errors = {}
    for k, name in zip(ids, joints, strict=True):
        path_of = np.interp(time, edges, paths[:, model.jnt_qposadr[k]])
        errors[name] = float(np.sqrt(np.mean((path_of - positions[name]) ** 2)))
    return Together(run.name, errors)
