"""A log of several joints replayed as a whole: the scene as it is, under the logged commands."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from joda.measured import smoothing
from joda.measured.driven import joints_in
from joda.measured.misfit import rms
from joda.measured.scene_log import read_scene_run, unknown_command
from joda.scenes.motion import unheard

Array = NDArray[np.float64]

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
INPUTS = int(mujoco.mjtState.mjSTATE_CTRL) | int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)


@dataclass(frozen=True)
class Together:
    """A log against its replay in the scene.

    Attributes:
        file: its name.
        rmse: of each joint's position, by name, rad or m; None where the scene is unstable.
    """

    file: str
    rmse: dict[str, float | None]


@dataclass(frozen=True)
class Course:
    """What a log measured and what its replay in the scene makes of it.

    Attributes:
        file: the log's name.
        time: s, shape (n,).
        measured, replayed: positions of each joint by name, rad or m, shape (n,).
        stable: whether the scene was.
    """

    file: str
    time: Array
    measured: dict[str, Array]
    replayed: dict[str, Array]
    stable: bool


def replayed_together(model: mujoco.MjModel, paths: Sequence[Path]) -> tuple[Together, ...]:
    """Replays logs open loop from their first positions, all joints at once, contacts included.

    Args:
        model: compiled, with its actuators.
        paths: logs with `position:JOINT`, `ctrl:ACTUATOR` of all that drives these joints, and
            perhaps `force:JOINT`.

    Returns:
        none where a command or a force is not known.

    Raises:
        JodaError: a file cannot be read.
    """
    found = [course_of(model, path) for path in paths]
    return tuple(_errors_of(one) for one in found if one) if all(found) else ()


def _errors_of(course: Course) -> Together:
    """How far a replay is off."""
    errors: dict[str, float | None] = {}
    for name, own in course.replayed.items():
        error = rms(own - course.measured[name])
        errors[name] = error if course.stable and np.isfinite(error) else None
    return Together(course.file, errors)


def course_of(model: mujoco.MjModel, path: Path) -> Course | None:
    """A log replayed, see `replayed_together`; None where a command or a force is not known."""
    ids = [int(model.joint(name).id) for name in joints_in(model, path)]
    if unknown_command(model, path, ids):
        return None
    run = read_scene_run(model, path)
    if np.isnan(run.force).any():
        return None
    time = run.time - run.time[0]
    steps = int(np.ceil(time[-1] / model.opt.timestep))
    edges = model.opt.timestep * np.arange(steps + 1)
    inputs = run.inputs(run.time[0] + edges)
    data = mujoco.MjData(model)
    for k, own in zip(ids, run.positions.T, strict=True):
        sigma = max(smoothing.noise(run.time, own), 1e-12)
        data.qpos[model.jnt_qposadr[k]] = own[0]
        if not smoothing.begins_at_rest(run.time, own, sigma):
            begun = smoothing.smooth(run.time, own, run.time[:1], sigma)
            data.qvel[model.jnt_dofadr[k]] = begun.velocity[0]
    state = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, state, FULL)
    with unheard():
        states, _ = rollout.rollout(model, data, state[None], inputs[None], control_spec=INPUTS)
    course = np.vstack([state, states[0]])
    stable = bool(np.all(np.diff(course[:, 0]) > 0))  # else MuJoCo has begun anew
    paths = course[:, 1 : 1 + model.nq]
    names = [model.joint(k).name for k in ids]
    replayed = {
        name: np.interp(time, edges, paths[:, model.jnt_qposadr[k]])
        for k, name in zip(ids, names, strict=True)
    }
    measured = dict(zip(names, run.positions.T, strict=True))
    return Course(run.name, time, measured, replayed, stable)
