"""A robot in the scene that goes through predefined targets, as the paper's manipulator does."""

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.measured.table import check_filled, check_increasing, read_table

Array = NDArray[np.float64]

AFTER = 2.0
"""How long (s) the scene is watched after the robot's last target."""


@dataclass(frozen=True)
class Targets:
    """Where a robot's actuators are sent, linear in between.

    Attributes:
        time: s, increasing, shape (n,).
        actuators: their ids, shape (m,).
        values: of their controls (of a position actuator rad or m), shape (n, m).
    """

    time: Array
    actuators: tuple[int, ...]
    values: Array

    def __call__(self, data: mujoco.MjData) -> bool:
        """Sets the controls, see `joda.scenes.motion.play`; the last targets hold on and on."""
        for actuator, values in zip(self.actuators, self.values.T, strict=True):
            data.ctrl[actuator] = np.interp(data.time, self.time, values)
        return True


def read_targets(path: str | Path, model: mujoco.MjModel) -> Targets:
    """Reads targets: CSV with `time` (s) and a column for each actuator that is driven.

    Args:
        path: the file.
        model: the scene that the actuators are in.

    Raises:
        JodaError: it cannot be read, or names no actuator of the scene.
    """
    path = Path(path)
    names = [model.actuator(k).name for k in range(model.nu)]
    listed = ", ".join(f"'{name}'" for name in names if name) or "none"
    expected = f"time and actuators of the scene ({listed})"
    table = read_table(path, ["time", *filter(None, names)], expected)
    columns = table.columns
    driven = [name for name in columns if name != "time"]
    if "time" not in columns or not driven or not len(table.lines):
        raise JodaError(
            f"{path}: it needs {expected}; of these it has {', '.join(columns) or 'none'}, "
            f"{len(table.lines)} rows."
        )
    check_filled(table, list(columns), "fill it in")
    check_increasing(table)
    return Targets(
        time=columns["time"],
        actuators=tuple(names.index(name) for name in driven),
        values=np.stack([columns[name] for name in driven], axis=1),
    )
