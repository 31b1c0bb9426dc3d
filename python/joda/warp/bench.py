"""What profiles cost per step of MuJoCo Warp, from one world to thousands."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp as wp

from joda.errors import JodaError
from joda.profile import Profile
from joda.scenes.hinges import hinges, hinges_text, without_plugin
from joda.scenes.scene import read_profiles
from joda.warp.fields import attach, put_fields
from joda.warp.scene import open_scene, take_profiles

WORLDS = (1, 8, 64, 512, 4096, 8192)
HINGES = 10
ROUNDS = 7
SECONDS = 0.1
"""About the length of one measurement."""


@dataclass(frozen=True)
class WarpRow:
    """One line of the table.

    Attributes:
        worlds: how many are stepped at once.
        per_second: steps of a world per second: with profiles, with native constants of the same
            mean strength, with neither.
        native_ratio: time with profiles over time with native constants, median over the rounds.
        plain_ratio: over time with neither.
        launches: kernels of a step with profiles, native constants, neither.
        device: of Warp.
    """

    worlds: int
    per_second: tuple[float, float, float]
    native_ratio: float
    plain_ratio: float
    launches: tuple[int, int, int]
    device: str


def bench(
    scene: str | Path | None = None,
    *,
    worlds: Sequence[int] = WORLDS,
    progress: Callable[[str], None] = lambda what: None,
) -> list[WarpRow]:
    """Measures what profiles cost in MuJoCo Warp, on Warp's current device.

    Steps are captured in a graph where the device is a GPU, as whoever trains there does.

    Args:
        scene: a scene that carries profiles; without one, a row of ten hinges.
        worlds: numbers of worlds.
        progress: told what is being measured.

    Returns:
        the table's rows.

    Raises:
        JodaError: the scene cannot be loaded, carries no profile or has options that `attach` or
            MuJoCo Warp refuses, or there are more worlds than fit.
    """
    models, profiles = _models(scene)
    rows = []
    for count in worlds:
        progress(f"{count} worlds")
        runs = [_Run(model, count, p) for model, p in zip(models, (profiles, {}, {}), strict=True)]
        times = np.array([[run.seconds() for run in runs] for _ in range(ROUNDS)])
        ours, native, plain = times.T
        rows.append(
            WarpRow(
                count,
                tuple((count / np.median(times, axis=0)).tolist()),
                float(np.median(ours / native)),
                float(np.median(ours / plain)),
                tuple(run.launches for run in runs),  # type: ignore[arg-type]
                str(wp.get_device()),
            )
        )
    return rows


def _models(scene: str | Path | None) -> tuple[list[mujoco.MjModel], dict[str, Profile]]:
    """With the rows of profiles, with native constants, with neither; and the profiles."""
    if scene is not None:
        model, profiles = open_scene(scene)
        told = read_profiles(scene)
        return [model, *(without_plugin(Path(scene), told, kind) for kind in (True, False))], told
    spec = mujoco.MjSpec.from_string(hinges_text(HINGES, "joda"))
    profiles = take_profiles(spec)
    return [spec.compile(), hinges(HINGES, "native"), hinges(HINGES, "plain")], profiles


class _Run:
    """A model in so many worlds, swinging from the middle of its joints' ranges."""

    def __init__(self, model: mujoco.MjModel, worlds: int, profiles: dict[str, Profile]) -> None:
        try:
            self.m = mujoco_warp.put_model(model)
            self.d = mujoco_warp.make_data(model, nworld=worlds)
        except (MemoryError, RuntimeError, ValueError) as error:  # what it lacks is a RuntimeError
            told = str(error).rstrip(".")
            raise JodaError(f"MuJoCo Warp refuses the scene (worlds: {worlds}): {told}.") from None
        if profiles:
            attach(self.m, self.d, put_fields(model, profiles, worlds))
        start = model.qpos0.copy()
        limited = np.asarray(model.jnt_limited, bool) & (np.asarray(model.jnt_type) >= 2)
        start[model.jnt_qposadr[limited]] = model.jnt_range[limited].mean(axis=1)
        self.start = np.tile(start, (worlds, 1))
        mujoco_warp.step(self.m, self.d)  # compiles
        with _counted() as launches:
            mujoco_warp.step(self.m, self.d)
        self.launches = len(launches)
        self.graph: Any = None
        if wp.get_device().is_cuda:
            with wp.ScopedCapture() as capture:
                mujoco_warp.step(self.m, self.d)
            self.graph = capture.graph
        self.steps = 1
        self.steps = max(2, int(SECONDS / self.seconds()))

    def seconds(self) -> float:
        """Of one step of all worlds."""
        self.d.qpos.assign(self.start)
        self.d.qvel.fill_(0.5)
        wp.synchronize()
        begin = time.perf_counter()
        for _ in range(self.steps):
            if self.graph is None:
                mujoco_warp.step(self.m, self.d)
            else:
                wp.capture_launch(self.graph)
        wp.synchronize()
        return (time.perf_counter() - begin) / self.steps


@contextmanager
def _counted() -> Iterator[list[str]]:
    """The kernels that are launched meanwhile."""
    names: list[str] = []
    launches = {name: getattr(wp, name) for name in ("launch", "launch_tiled")}

    def counting(launch: Callable[..., Any]) -> Callable[..., Any]:
        def counted(kernel: Any, *args: Any, **named: Any) -> Any:
            names.append(kernel.key)
            return launch(kernel, *args, **named)

        return counted

    for name, launch in launches.items():
        setattr(wp, name, counting(launch))
    try:
        yield names
    finally:
        for name, launch in launches.items():
            setattr(wp, name, launch)
