"""Logs of a joint, of joints that an actuator drives, and of several joints at once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.measured.contact_samples import touching
from joda.measured.coupling import SHORTER, SMOOTHED, coupling_force, coupling_force_std
from joda.measured.run_files import read_measurement, read_together
from joda.measured.runs import MIN_SAMPLES, QuasiStatic, Run, evened
from joda.measured.sensing import RIGHT, Sensing
from joda.measured.table import header
from joda.scenes.actuators import Drive, Servo, actuators_on, drive_of
from joda.scenes.model import joint_name, load_model

Array = NDArray[np.float64]

OF_JOINTS = ("position", "velocity", "force")
SHOWN = 6
"""Most joints that a note names."""


ALL = "all"
"""In the place of a joint's name: every joint that the logs have."""


@dataclass(frozen=True)
class Logs:
    """Measurements of a joint as they were read.

    Attributes:
        read: timed runs and quasi-static curves.
        servo: what the joint's actuators made of the runs' commands; None where none acted.
        notes: which columns are not used, a sentence each.
    """

    read: tuple[Run | QuasiStatic, ...]
    servo: Servo | None
    notes: tuple[str, ...]


def read_logs(
    model: mujoco.MjModel,
    joint: int,
    paths: Sequence[str | Path],
    passive: bool,
    sensing: Sensing = RIGHT,
) -> Logs:
    """Reads measurements of a joint, and notes which of their columns are not used.

    Args:
        model: compiled.
        joint: its id.
        paths: CSV files, as `joda.measured.run_files.read_measurement` reads them.
        passive: whether the actuators on the joint were off while it was measured.
        sensing: what is wrong with them.

    Raises:
        JodaError: a file cannot be read; or an actuator acts on the joint, and what it did is not
            known, in none of the files or only in some.
    """
    acting = () if passive else actuators_on(model, joint)
    files = [Path(path) for path in paths]
    told = [_commands(path, acting) for path in files]
    drive = drive_of(model, joint) if any(told) else None
    read: list[Run | QuasiStatic] = []
    notes: list[str] = []
    for path, commanded in zip(files, told, strict=True):
        own = drive if commanded else None
        one, positions, more = _read(model, joint, path, own)
        notes += more
        if isinstance(one, Run):
            one, note = evened(one)
            notes += [note] if note else []
            one = sensing.of(one, whole=bool(positions))
            if drive and not commanded:
                raise JodaError(
                    f"{path}: no column '{drive.columns[0]}', which other runs have; give runs in "
                    "which the actuator acted apart from those in which it was off."
                )
        if acting and not commanded and isinstance(one, Run) and not one.forced:
            raise JodaError(
                f"{path}: {_driven(model, joint, acting)}, and the run has neither a column "
                f"'ctrl:{acting[0]}' nor 'force'; record its signal or the whole force on the "
                "joint, or say with --passive that the actuator was off."
            )
        if not isinstance(one, Run):
            one = sensing.of_curve(one)
        elif positions:
            one, more = _with_coupling(model, joint, one, positions)
            notes += more
        if first := next((other for other in read if _copies(one, other)), None):
            notes.append(
                f"{path.name}: holds the same as {first.name}, and is left out: a copy is no "
                "further measurement."
            )
            continue
        read.append(one)
    servo = sensing.driving(drive.servo) if drive else None
    return Logs(tuple(read), servo, tuple(notes))


def joints_in(model: mujoco.MjModel, path: Path) -> list[str]:
    """The model's joints that a log of several has, in the model's order; none if it is of one."""
    names = {name.lower() for name in header(path)}
    if "position" in names:
        return []
    slide, hinge = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
    joint_model = [k for k in range(model.njnt) if model.jnt_type[k] in (slide, hinge)]
    every = [model.joint(k).name for k in joint_model]
    return [name for name in every if name and f"position:{name}".lower() in names]


def _read(
    model: mujoco.MjModel, joint: int, path: Path, drive: Drive | None
) -> tuple[Run | QuasiStatic, dict[int, Array], list[str]]:
    """A measurement of a joint; of a log of several all positions by joint; and notes."""
    name, there = joint_name(model, joint), joints_in(model, path)
    if name not in there:
        unused = _unused(model, joint, path, drive.names if drive else ())
        return read_measurement(path, drive), {}, unused
    run, positions = read_together(path, name, [one for one in there if one != name], drive)
    by_id = {model.joint(one).id: position for one, position in positions.items()}
    away = [model.joint(k).name or f"#{k}" for k in range(model.njnt) if k not in by_id]
    notes = []
    if away:
        notes.append(
            f"{path.name}: has no positions of {_listed(away[:SHOWN])}"
            f"{' and others' if len(away) > SHOWN else ''}: held at the model's reference."
        )
    return run, by_id, notes


def _with_coupling(
    model: mujoco.MjModel, joint: int, run: Run, positions: Mapping[int, Array]
) -> tuple[Run, list[str]]:
    """The run with what the other joints of its log do to the joint as a force on it, which is not
    known where something of the scene touches; and notes."""
    found, other = (
        coupling_force(model, joint, run.time, positions, over) for over in (SMOOTHED, SHORTER)
    )
    force_std = coupling_force_std(run.time, found, other)
    inside, pairs = touching(model, joint, positions)
    force = np.where(inside, np.nan, run.force + found)
    run = replace(run, force=force, forced=True, force_std=force_std, among=True)
    notes = []
    if inside.any():
        pair = max(pairs, key=lambda one: pairs[one])
        more = f" and {len(pairs) - 1} pairs more" if len(pairs) > 1 else ""
        notes.append(
            f"{run.name}: {inside.sum()} of {len(inside)} samples are left out, as something of "
            f"the scene touches what joint '{joint_name(model, joint)}' moves, or may: "
            f"'{pair[0]}' '{pair[1]}'{more}."
        )
    inner = np.abs(run.time - (run.time[0] + run.time[-1]) / 2) <= (np.ptp(run.time) - SMOOTHED) / 2
    if inner.sum() < MIN_SAMPLES or len(positions) == 1:
        return run, notes
    return run.part(np.flatnonzero(inner)), notes  # the ends are smoothed from one side only


def _commands(path: Path, acting: Sequence[str]) -> bool:
    """Whether a file has the signals of all that acts on the joint; raises JodaError if of some."""
    names = {name.lower() for name in header(path)}
    missing = [name for name in acting if f"ctrl:{name}".lower() not in names]
    if missing and len(missing) < len(acting):
        raise JodaError(
            f"{path}: no column 'ctrl:{missing[0]}', and the actuators on the joint act together; "
            "give all of their signals, held at what they were."
        )
    return bool(acting) and not missing


def _copies(one: Run | QuasiStatic, other: Run | QuasiStatic) -> bool:
    """Whether two measurements are the same, number by number."""
    if isinstance(one, Run) and isinstance(other, Run) and not np.array_equal(one.time, other.time):
        return False
    return (
        type(one) is type(other)
        and np.array_equal(one.position, other.position)
        and np.array_equal(one.force, other.force, equal_nan=True)
        and _commanded_alike(one, other)
    )


def _commanded_alike(one: Run | QuasiStatic, other: Run | QuasiStatic) -> bool:
    """Whether the actuators got the same commands, or none."""
    first, second = (getattr(run, "command", None) for run in (one, other))
    return first is second or (
        first is not None and second is not None and np.array_equal(first, second)
    )


def _unused(model: mujoco.MjModel, joint: int, path: Path, commanded: Sequence[str]) -> list[str]:
    """Notes on columns of other actuators and joints; raises JodaError."""
    names = header(path)
    pairs = [name.split(":", 1) for name in names if ":" in name]
    kinds = [(kind.strip().lower(), of.strip()) for kind, of in pairs]
    read = {name.lower() for name in commanded}
    commands = [f"ctrl:{of}" for kind, of in kinds if kind == "ctrl" and of.lower() not in read]
    others = [f"{kind}:{of}" for kind, of in kinds if kind in OF_JOINTS]
    if others and "position" not in {name.lower() for name in names}:
        raise JodaError(
            f"{path}: no column 'position:{joint_name(model, joint)}'; it has {_listed(others)}. "
            "Give the positions of this joint, or name one that the log has with --joint."
        )
    if not commands + others:
        return []
    return [
        f"{path.name}: not used: {_listed([*commands, *others])}, which are of other actuators "
        "and joints, or of actuators that were off."
    ]


def _driven(model: mujoco.MjModel, joint: int, acting: Sequence[str]) -> str:
    which = "actuator" if len(acting) == 1 else "the actuators"
    names = ", ".join(f"'{name}'" for name in acting)
    verb = "acts" if len(acting) == 1 else "act"
    return f"{which} {names} {verb} on joint '{joint_name(model, joint)}'"


def _listed(columns: Sequence[str]) -> str:
    return ", ".join(f"'{column}'" for column in columns)


def named_joints(model: str | Path, runs: Sequence[str | Path], joints: Sequence[str]) -> list[str]:
    """The joints that are meant; raises JodaError if there is none."""
    if not runs:
        raise JodaError("no runs; give at least one CSV file with time and position.")
    if list(joints) not in ([], [ALL]):
        return list(dict.fromkeys(joints))
    there = joints_in(load_model(Path(model)), Path(runs[0]))
    if not there:
        raise JodaError(
            f"{runs[0]}: has no columns 'position:JOINT' of the model's joints; name the joint of "
            "its 'position' with --joint."
        )
    return there
