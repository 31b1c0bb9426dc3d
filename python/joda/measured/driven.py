"""Runs of a joint that an actuator acts on, and columns of logs that are not read yet."""

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from joda.errors import JodaError
from joda.measured.runs import QuasiStatic, Run, evened, read_measurement
from joda.measured.table import header
from joda.scenes.actuators import actuators_on
from joda.scenes.model import joint_name

OF_JOINTS = ("position", "velocity", "force")


def read_logs(
    model: mujoco.MjModel, joint: int, paths: Sequence[str | Path], passive: bool
) -> tuple[list[Run | QuasiStatic], list[str]]:
    """Reads measurements of a joint, and notes which of their columns are not used.

    Args:
        model: compiled.
        joint: its id.
        paths: CSV files, as `joda.measured.runs.read_measurement` reads them.
        passive: whether the actuators on the joint were off while it was measured.

    Raises:
        JodaError: a file cannot be read; or an actuator acts on the joint, and what it did is in
            a column that is not supported yet, or in none.
    """
    acting = actuators_on(model, joint)
    read: list[Run | QuasiStatic] = []
    notes: list[str] = []
    for path in map(Path, paths):
        notes += _unused(model, joint, path, acting, passive)
        one = read_measurement(path)
        if isinstance(one, Run):
            one, note = evened(one)
            notes += [note] if note else []
        if acting and not passive and isinstance(one, Run) and not one.forced:
            raise JodaError(
                f"{path}: {_driven(model, joint, acting)}, and the run has no column 'force'; "
                "record the force on the joint, or say with --passive that the actuator was off."
            )
        if first := next((other for other in read if _copies(one, other)), None):
            notes.append(
                f"{path.name}: holds the same as {first.name}, and is left out: a copy is no "
                "further measurement."
            )
            continue
        read.append(one)
    return read, notes


def _copies(one: Run | QuasiStatic, other: Run | QuasiStatic) -> bool:
    """Whether two measurements are the same, number by number."""
    if isinstance(one, Run) and isinstance(other, Run) and not np.array_equal(one.time, other.time):
        return False
    return (
        type(one) is type(other)
        and np.array_equal(one.position, other.position)
        and np.array_equal(one.force, other.force, equal_nan=True)
    )


def _unused(
    model: mujoco.MjModel, joint: int, path: Path, acting: Sequence[str], passive: bool
) -> list[str]:
    """Notes on columns that belong to logs of driven or several joints; raises JodaError."""
    names = header(path)
    pairs = [name.split(":", 1) for name in names if ":" in name]
    kinds = [(kind.strip().lower(), of.strip()) for kind, of in pairs]
    commands = [f"ctrl:{of}" for kind, of in kinds if kind == "ctrl"]
    others = [f"{kind}:{of}" for kind, of in kinds if kind in OF_JOINTS]
    for column in commands:
        if column.removeprefix("ctrl:") in acting and not passive:
            raise JodaError(
                f"{path}: column '{column}' is the command of an actuator on joint "
                f"'{joint_name(model, joint)}', and logs of driven joints are not supported yet; "
                "record the whole force on the joint as 'force' and leave the column out, or say "
                "with --passive that the actuator was off."
            )
    if others and "position" not in {name.lower() for name in names}:
        raise JodaError(
            f"{path}: logs of several joints are not supported yet ({_listed(others)}); give "
            f"joint '{joint_name(model, joint)}' a file of its own, with the columns time, "
            "position and perhaps velocity and force."
        )
    if not commands + others:
        return []
    return [
        f"{path.name}: not used: {_listed([*commands, *others])}; logs of driven joints and of "
        "several joints are not supported yet."
    ]


def _driven(model: mujoco.MjModel, joint: int, acting: Sequence[str]) -> str:
    which = "actuator" if len(acting) == 1 else "the actuators"
    names = ", ".join(f"'{name}'" for name in acting)
    verb = "acts" if len(acting) == 1 else "act"
    return f"{which} {names} {verb} on joint '{joint_name(model, joint)}'"


def _listed(columns: Sequence[str]) -> str:
    return ", ".join(f"'{column}'" for column in columns)
