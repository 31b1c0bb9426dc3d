"""Runs of a scene: all joints of a log together, with all that is put into it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.measured.driven import joints_in
from joda.measured.run_files import read_measurement, read_signals, read_together
from joda.measured.runs import QuasiStatic, Run, evened, held
from joda.measured.table import header, read_table
from joda.scenes.actuators import acting_on, actuators_on
from joda.scenes.model import joint_name

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SceneRun(Run):
    """A run of one joint, with the other joints of its log.

    Attributes:
        joints: ids of all of them, that one first.
        positions: measured, rad or m, shape (n, joints).
        commands: of all the model's actuators, held from a sample to the next; shape (n, nu).
        forces: applied to all degrees of freedom, linear between samples, N·m or N; shape (n, nv).
    """

    joints: tuple[int, ...]
    positions: Array
    commands: Array
    forces: Array

    def part(self, samples: slice | NDArray[np.intp]) -> Self:
        """See `Run`."""
        return replace(
            super().part(samples),
            positions=self.positions[samples],
            commands=self.commands[samples],
            forces=self.forces[samples],
        )

    def inputs(self, edges: Array) -> Array:
        """Commands and forces between edges (s, shape (steps + 1,)); shape (steps, nu + nv)."""
        commands = [held(self.time, own, edges) for own in self.commands.T]
        forces = [np.interp(edges[:-1], self.time, own) for own in self.forces.T]
        return np.stack([*commands, *forces], axis=1)


def unknown_command(model: mujoco.MjModel, path: Path, joints: Sequence[int]) -> str | None:
    """The first column of an actuator on these joints that a log lacks; None if it has all."""
    names = {name.lower() for name in header(path)}
    return next((one for one in _commands(model, joints) if one.lower() not in names), None)


def _commands(model: mujoco.MjModel, joints: Sequence[int]) -> dict[str, int]:
    """Columns of the actuators on joints, and their ids."""
    pairs = (zip(actuators_on(model, k), acting_on(model, k), strict=True) for k in joints)
    return {f"ctrl:{name}": number for own in pairs for name, number in own}


def read_scene_run(
    model: mujoco.MjModel, path: Path, joint: int | None = None, passive: bool = False
) -> SceneRun:
    """Reads a log of several joints, or a run of one.

    Args:
        model: compiled.
        path: CSV with `time` and `position:JOINT` (or `position`), `ctrl:ACTUATOR` of all that
            drives these joints, and perhaps `force:JOINT` (or `force`).
        joint: id of the joint that comes first; of a run of one joint, whose it is. None: the first
            of the log.
        passive: whether the actuators were off.

    Returns:
        the run; its force is NaN where one of the forces is not known.

    Raises:
        JodaError: it cannot be read, is a curve, lacks the joint's position or a command.
    """
    there = [int(model.joint(name).id) for name in joints_in(model, path)]
    first = there[0] if joint is None and there else joint
    if first is None:
        raise JodaError(f"{path}: no column 'position:JOINT' of a hinge or slide of the model.")
    if there and first not in there:
        others = ", ".join(f"'position:{joint_name(model, k)}'" for k in there)
        raise JodaError(
            f"{path}: no column 'position:{joint_name(model, first)}' beside {others}; a log of a "
            "scene needs the position of the joint that is fitted."
        )
    joints = (first, *(k for k in there if k != first))
    if missing := None if passive else unknown_command(model, path, joints):
        raise JodaError(
            f"{path}: no column '{missing}'; what moves the scene's joints must be known, or say "
            "with --passive that the actuators were off."
        )
    name = joint_name(model, first)
    if there:
        run, by_name = read_together(path, name, [model.joint(k).name for k in joints[1:]])
        positions = np.stack([*by_name.values()], axis=1)
    else:
        one = read_measurement(path)
        if isinstance(one, QuasiStatic):
            raise JodaError(f"{path}: a curve has no time, and a scene cannot be moved along it.")
        run, positions = one, one.position[:, None]
    run, _ = evened(run)
    count = len(run.time)
    commands, forces = np.zeros((count, model.nu)), np.zeros((count, model.nv))
    acting = {} if passive else _commands(model, joints)
    if acting:
        commands[:, [*acting.values()]] = read_signals(path, [*acting])
    columns = {name.lower() for name in header(path)}
    for number in joints:
        column, at = f"force:{model.joint(number).name}", int(model.jnt_dofadr[number])
        if number == first:
            forces[:, at] = run.force
        elif column.lower() in columns:
            forces[:, at] = read_table(path, [column], "forces").columns[column]
    unknown = np.isnan(forces).any(axis=1)
    return SceneRun(
        **{**vars(run), "force": np.where(unknown, np.nan, run.force)},
        joints=joints,
        positions=positions,
        commands=commands,
        forces=forces,
    )
