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
from joda.measured.misfit import rms
from joda.measured.runs import held, read_signals, read_together
from joda.measured.table import header, read_table
from joda.scenes.actuators import acting_on, actuators_on
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
    return tuple(_told(one) for one in found if one) if all(found) else ()


def _told(course: Course) -> Together:
    """How far a replay is off."""
    errors: dict[str, float | None] = {}
    for name, own in course.replayed.items():
        error = rms(own - course.measured[name])
        errors[name] = error if course.stable and np.isfinite(error) else None
    return Together(course.file, errors)


def course_of(model: mujoco.MjModel, path: Path) -> Course | None:
    """A log replayed, see `replayed_together`; None where a command or a force is not known."""
    joints = joints_in(model, path)
    if not joints:
        raise JodaError(f"{path}: no column 'position:JOINT' of a hinge or slide of the model.")
    ids = [int(model.joint(name).id) for name in joints]
    acting = {
        f"ctrl:{name}": number
        for k in ids
        for number, name in zip(acting_on(model, k), actuators_on(model, k), strict=True)
    }
    names = {name.lower() for name in header(path)}
    if any(column.lower() not in names for column in acting):
        return None
    pushed = {
        f"force:{name}": int(model.jnt_dofadr[k])
        for k, name in zip(ids, joints, strict=True)
        if f"force:{name}".lower() in names
    }
    forces = read_table(path, [*pushed], "forces").columns if pushed else {}
    if any(np.isnan(force).any() for force in forces.values()):
        return None
    run, positions = read_together(path, joints[0], joints[1:])
    time = run.time - run.time[0]
    steps = int(np.ceil(time[-1] / model.opt.timestep))
    edges = model.opt.timestep * np.arange(steps + 1)
    inputs = np.zeros((steps, model.nu + model.nv))
    if acting:
        signals = read_signals(path, [*acting])
        for number, signal in zip(acting.values(), signals.T, strict=True):
            inputs[:, number] = held(time, signal, edges)
    for name, force in forces.items():
        inputs[:, model.nu + pushed[name]] = np.interp(edges[:-1], time, force)
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
    with unheard():
        states, _ = rollout.rollout(model, data, state[None], inputs[None], control_spec=INPUTS)
    course = np.vstack([state, states[0]])
    stable = bool(np.all(np.diff(course[:, 0]) > 0))  # else MuJoCo has begun anew
    paths = course[:, 1 : 1 + model.nq]
    replayed = {
        name: np.interp(time, edges, paths[:, model.jnt_qposadr[k]])
        for k, name in zip(ids, joints, strict=True)
    }
    measured = {name: positions[name] for name in joints}
    return Course(run.name, time, measured, replayed, stable)
