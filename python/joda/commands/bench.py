"""What a profile costs per step: ratios between models that are stepped in turns, in one run.

The machine's speed cancels out of a ratio: every round steps each model for a while, and the
median over the rounds of the ratio within a round is reported. Of the swings of a round the fastest
counts, as what else the machine does only adds to the others.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from joda.profile import CHANNELS
from joda.scenes.hinges import LEARNED, hinges, three_channels, without_plugin
from joda.scenes.scene import open_scene

ROUNDS = 31
SWING = 100  # steps of one joint's swing; it moves all the while
LEAST_SWING = 20  # steps of many joints', so short that a busy machine seldom breaks in
FINE = time.get_clock_info("thread_time").resolution < 1e-6
CLOCK = time.thread_time if FINE else time.perf_counter
"""Where the system counts it finely, the time of this thread alone."""
FULL = mujoco.mjtState.mjSTATE_INTEGRATION


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        what: what is compared with what.
        ratio: the ratio, median over the rounds.
        spread: half the distance between its quartiles.
        bar: the project's own requirement, as text; empty if there is none.
        microseconds: time per step of the two models, on this machine.
    """

    what: str
    ratio: float
    spread: float
    bar: str
    microseconds: tuple[float, float]


def bench(
    scene: str | Path | None = None, *, progress: Callable[[str], None] = lambda what: None
) -> list[Row]:
    """Measures the cost of profiles.

    Args:
        scene: a scene that carries profiles; without one, a hinge and rows of 10 and 200 hinges.
        progress: told what is being measured.

    Returns:
        the table's rows.

    Raises:
        JodaError: the scene cannot be loaded or carries no profile.
    """
    if scene is not None:
        return _bench_scene(Path(scene), progress)
    rows = []
    progress("one hinge")
    plain, native, ours, full = (hinges(1, kind) for kind in ("plain", "native", "joda", "effects"))
    learned = hinges(1, "joda", three_channels().with_effect(LEARNED))
    models = (plain, native, ours, full)
    each = [*((model, None) for model in models), (plain, _callback(ours)), (learned, None)]
    times = _measure(each)
    rows.append(_row("hinge, three channels / native elements", times[2], times[1], "<= 1.10"))
    what = "addition of a Python callback / of the plugin"
    rows.append(_row(what, times[4] - times[0], times[2] - times[0], ">= 10"))
    rows.append(_row("hinge, all effects / three channels", times[3], times[2], "<= 1.25"))
    rows.append(_row("hinge, a learned force besides / three channels", times[5], times[2], ""))
    progress("10 and 200 hinges")
    few, many = hinges(10, "joda"), hinges(200, "joda")
    few_native, many_native = hinges(10, "native"), hinges(200, "native")
    times = _measure([(few, None), (many, None), (few_native, None), (many_native, None)])
    rows.append(
        _row("step per joint, 200 joints / 10 joints", times[1] / 200, times[0] / 10, "<= 1.2")
    )
    rows.append(_row("10 hinges, three channels / native elements", times[0], times[2], ""))
    rows.append(_row("200 hinges, three channels / native elements", times[1], times[3], ""))
    return rows


def _callback(model: mujoco.MjModel) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """The same three channels for the hinge of `model` in Python, with SciPy's PCHIP."""
    from scipy.interpolate import PchipInterpolator

    lo, hi = model.jnt_range[0]
    channels = [
        [(c.interval, PchipInterpolator(c.x, c.y)) for c in channel.components]
        for channel in (getattr(three_channels().channels, name) for name in CHANNELS)
    ]

    def total(parts: list[Any], s: float) -> float:
        return sum(float(f((s - a) / (b - a))) for (a, b), f in parts if a <= s <= b)

    def passive(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        s, v = (data.qpos[0] - lo) / (hi - lo), data.qvel[0]
        force, friction, damping = (total(parts, s) for parts in channels)
        data.qfrc_passive[0] += force - friction * np.tanh(v / 1e-3) - damping * v

    return passive


def _bench_scene(path: Path, progress: Callable[[str], None]) -> list[Row]:
    ours, profiles = open_scene(path)
    what = f"{path.name}, {len(profiles)} profiles"
    progress(what)
    native, plain = (without_plugin(path, profiles, kind) for kind in (True, False))
    times = _measure([(plain, None), (native, None), (ours, None)])
    return [
        _row(f"{what} / native elements", times[2], times[1], "<= 1.05 for the kitchen"),
        _row(f"{what} / none", times[2], times[0], ""),
    ]


def _measure(models: list[tuple[mujoco.MjModel, Any]]) -> np.ndarray:
    """Seconds per step, shape (models, rounds): free swings from the middle of the range."""
    repeats = [_repeats(model, callback) for model, callback in models]
    times = np.empty((len(models), ROUNDS))
    for k in range(ROUNDS):
        for i, (model, callback) in enumerate(models):
            times[i, k] = seconds(model, callback, repeats[i])
    return times


def _repeats(model: mujoco.MjModel, callback: Any) -> int:
    """How many swings take about 20 ms."""
    return max(1, int(0.02 / (_steps(model) * seconds(model, callback, 1))))


def _steps(model: mujoco.MjModel) -> int:
    """Of a swing."""
    return max(LEAST_SWING, SWING // int(model.nv))


def seconds(model: mujoco.MjModel, callback: Any = None, repeats: int = 1) -> float:
    """Seconds per step of the fastest of short swings through the middle of the joints' ranges."""
    data = mujoco.MjData(model)
    limited = np.asarray(model.jnt_limited, bool) & (np.asarray(model.jnt_type) >= 2)
    data.qpos[model.jnt_qposadr[limited]] = model.jnt_range[limited].mean(axis=1)
    data.qvel[:] = 0.5
    start = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, start, FULL)
    mujoco.set_mjcb_passive(callback)
    steps, fastest = _steps(model), np.inf
    try:
        for _ in range(repeats):
            mujoco.mj_setState(model, data, start, FULL)
            begin = CLOCK()
            mujoco.mj_step(model, data, steps)
            fastest = min(fastest, CLOCK() - begin)
    finally:
        mujoco.set_mjcb_passive(None)
    return fastest / steps


def _row(what: str, ours: np.ndarray, other: np.ndarray, bar: str) -> Row:
    ratios = ours / other
    low, middle, high = np.percentile(ratios, (25, 50, 75))
    times = (1e6 * float(np.median(ours)), 1e6 * float(np.median(other)))
    return Row(what, float(middle), float(high - low) / 2, bar, times)
