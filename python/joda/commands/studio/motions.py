"""What a joint does with a profile: let go, taken by a hand, and replayed beside measured runs."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.interaction.script import interaction, perform
from joda.measured.errors import RunError, errors
from joda.measured.measured_joint import Measured
from joda.measured.reading import read_measured
from joda.scenes.context import context
from joda.scenes.model import find_joint, load_model
from joda.scenes.motion import Motion

Array = NDArray[np.float64]
Stale = Callable[[], bool]
"""Whether a newer profile waits, so that this one's simulation can end."""


class Outdated(Exception):
    """A newer profile waits."""


def never() -> bool:
    """Nothing newer waits."""
    return False


def simulated(scene: Path, joint: str, stale: Stale = never, **asked: object) -> Motion:
    """An interaction with a joint, as `joda simulate` makes it.

    Args:
        scene: MJCF or URDF.
        joint: its name or address.
        stale: asked at each step.
        asked: as `joda.simulate` takes it: `release=0.3`, `hand=True`, ...

    Raises:
        JodaError: it cannot be as it is asked for, or is unstable.
        Outdated: a newer profile waits.
    """
    model = load_model(scene)
    number = find_joint(model, joint)
    done = interaction(model, number, context(scene, joint), **asked)

    def watch(data: mujoco.MjData) -> None:
        if stale():
            raise Outdated

    return perform(model, number, done, watch)


@dataclass(frozen=True)
class Replayed:
    """Measured runs beside a model's replay, numbers as those of `joda compare`.

    Attributes:
        measured: the runs.
        paths: the model's positions at their times, rad or m.
        runs: errors by run, rad or m; of windows NaN while they are not known yet.
        rmse, rmse_window, noise_floor: of all runs together; NaN likewise.
        notes: what is suspicious about the data, a sentence each.
    """

    measured: Measured
    paths: tuple[Array, ...]
    runs: tuple[RunError, ...]
    rmse: float
    rmse_window: float
    noise_floor: float
    notes: tuple[str, ...]


def replayed(
    scene: Path,
    joint: str,
    runs: tuple[Path, ...],
    windows: bool,
    passive: bool = False,
    stale: Stale = never,
) -> Replayed:
    """Replays measured runs.

    Args:
        scene: MJCF or URDF.
        joint: its name or address.
        runs: CSV files; quasi-static curves among them are only named in the notes.
        windows: whether the errors of windows are wanted too, which takes longer.
        passive: whether the actuators on the joint were off.
        stale: asked from run to run.

    Raises:
        JodaError: a file cannot be read, or what it holds cannot be of this joint.
        Outdated: a newer profile waits.
    """
    measured = read_measured(scene, joint, runs, passive)

    def begin(name: str) -> None:
        if stale():
            raise Outdated

    found = errors(measured, windows=windows, begin=begin)
    curves = tuple(
        f"{one.curve.name}: a quasi-static curve, which is not replayed; see joda compare."
        for one in measured.curves
    )
    return Replayed(
        measured=measured,
        paths=found.paths,
        runs=found.runs,
        rmse=found.whole,
        rmse_window=found.window,
        noise_floor=found.noise,
        notes=(*measured.notes, *curves),
    )
