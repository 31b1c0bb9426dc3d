"""Whether a joint is refined by itself, or in its scene: where other joints or contacts move it."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.measured import smoothing
from joda.measured.contact_samples import touching
from joda.measured.coupling import coupling_force
from joda.measured.driven import Logs, joints_in
from joda.measured.misfit import rms
from joda.measured.scene_log import SceneRun, read_scene_run
from joda.refining.engine import JointEngine
from joda.scenes.model import joint_name, joint_type
from joda.scenes.scene import profiles_of

if TYPE_CHECKING:
    from joda.mjx.shooting import Scene
    from joda.refining.scene import SceneEngine

Array = NDArray[np.float64]

SEGMENT_LENGTH = 0.4
"""Time over which it counts how far others move the joint, s."""
CLEARLY = 3.0
"""By how much they must, in noises of its position."""


@dataclass(frozen=True)
class Together:
    """Logs of a scene that is refined as a whole.

    Attributes:
        scene: in MJX.
        runs: by file.
    """

    scene: "Scene"
    runs: dict[Path, SceneRun]

    def logs(self, model: mujoco.MjModel, paths: Sequence[str | Path]) -> Logs:
        """Some of the runs, with what the other joints do as a force on the fitted one, as MuJoCo's
        inverse dynamics has it; but not what contacts do."""
        read = tuple(_alone(model, self.runs[Path(path)]) for path in paths)
        return Logs(read, None, ())

    def engine(self, own: JointEngine, joint: int) -> "SceneEngine":
        """The scene with the runs of an engine of the joint by itself."""
        from joda.refining.scene import SceneEngine

        runs = cast(Sequence[SceneRun], own.runs)
        return SceneEngine(self.scene, joint, own.range, runs, own.sigma, own.inertia)


def together(
    model: mujoco.MjModel,
    joint: int,
    fitted: Sequence[str | Path],
    held_out: Sequence[str | Path],
    passive: bool,
    scene: bool | None,
) -> tuple[Together | None, list[str]]:
    """The logs, if the scene is to be refined as a whole; and notes.

    Args:
        model: compiled.
        joint: id of the fitted joint.
        fitted, held_out: CSV files.
        passive: whether the actuators were off.
        scene: whether the user wants it; None: where other joints or contacts move the joint.

    Raises:
        JodaError: the user wants it, and a file cannot be read, does not tell what moves the
            scene, or has other joints than the first; or JAX is missing.
    """
    paths = [*map(Path, fitted), *map(Path, held_out)]
    if scene is False or (scene is None and any(len(joints_in(model, p)) < 2 for p in paths)):
        return None, []
    why = "as asked for"
    try:
        runs = [read_scene_run(model, path, joint, passive) for path in paths]
        for run, path in zip(runs, paths, strict=True):
            if set(run.joints) != set(runs[0].joints):
                other = min({*run.joints} ^ {*runs[0].joints})
                raise JodaError(
                    f"{path}: the logs must be of the same joints, and not all have "
                    f"'position:{joint_name(model, other)}'."
                )
        if scene is None:
            found = _dependence(model, joint, runs)
            if not found:
                return None, []
            why = found
        from joda.mjx.shooting import Scene

        if passive:
            model = copy(model)
            model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
        made = Scene(model, profiles_of(model), runs[0].joints, ("gravity_offset",))
    except JodaError as error:
        if scene:
            raise
        return None, [f"The joint is fitted by itself, not in its scene: {error}"]
    note = (
        f"Fitted in the whole scene, simulated in MJX, {why}; --no-scene fits the joint by itself."
    )
    return Together(made, dict(zip(paths, runs, strict=True))), [note]


def _dependence(model: mujoco.MjModel, joint: int, runs: Sequence[SceneRun]) -> str | None:
    """Why a joint's motion in runs is not its own, as a clause; None if it is."""
    inertia = float(model.dof_M0[model.jnt_dofadr[joint]])
    for run in runs:
        positions = dict(zip(run.joints, run.positions.T, strict=True))
        inside, pairs = touching(model, joint, positions)
        if inside.any():
            first, second = max(pairs, key=lambda pair: pairs[pair])
            return f"as '{first}' touches '{second}' in {run.name}, or may"
        force = coupling_force(model, joint, run.time, positions)
        moved = rms(force) / inertia * SEGMENT_LENGTH**2 / 2
        if moved > CLEARLY * smoothing.noise(run.time, run.position):
            unit = "N·m" if joint_type(model, joint) == "hinge" else "N"
            return (
                f"as other joints push this one with up to {np.abs(force).max():.2g} {unit} in "
                f"{run.name}"
            )
    return None


def _alone(model: mujoco.MjModel, run: SceneRun) -> SceneRun:
    if len(run.joints) == 1:
        return replace(run, among=True)
    positions = dict(zip(run.joints, run.positions.T, strict=True))
    force = coupling_force(model, run.joints[0], run.time, positions)
    return replace(run, force=run.force + force, forced=True, among=True)
