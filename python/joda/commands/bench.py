"""What a profile costs per step: ratios between models that are stepped in turns, in one run.

The machine's speed cancels out of a ratio: every round steps each model for a while, and the
median over the rounds of the ratio within a round is reported. Of the swings of a round the fastest
counts, as what else the machine does only adds to the others.
"""

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import mujoco
import numpy as np
import typer

from joda.errors import JodaError
from joda.pictures.cost import draw_growth
from joda.profile import CHANNELS
from joda.scenes.hinges import LEARNED, hinges, three_channels, without_plugin
from joda.scenes.scene import open_scene
from joda.scenes.timing import seconds_per_step, swings_in
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.say import print_json, say

if TYPE_CHECKING:
    from joda.warp.bench import WarpRow

ROUNDS = 31


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
    repeats = [swings_in(0.02, model, callback) for model, callback in models]
    times = np.empty((len(models), ROUNDS))
    for k in range(ROUNDS):
        for i, (model, callback) in enumerate(models):
            times[i, k] = seconds_per_step(model, callback, repeats[i])
    return times


def _row(what: str, ours: np.ndarray, other: np.ndarray, bar: str) -> Row:
    ratios = ours / other
    low, middle, high = np.percentile(ratios, (25, 50, 75))
    times = (1e6 * float(np.median(ours)), 1e6 * float(np.median(other)))
    return Row(what, float(middle), float(high - low) / 2, bar, times)


def command(
    scene: Annotated[
        Path | None, typer.Argument(help="Scene with profiles [default: hinges of our own].")
    ] = None,
    warp: Annotated[
        bool, typer.Option("--warp", help="In MuJoCo Warp, from 1 to 8192 worlds.")
    ] = False,
    worlds: Annotated[
        list[int] | None, typer.Option(min=1, help="With --warp: so many worlds instead.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw how the cost grows with joints and components: a PNG."),
    ] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Measure what profiles cost per step, as ratios.

    Example:

        joda bench scene.xml
    """
    if worlds and not warp:
        raise JodaError("--worlds is of --warp; add --warp.")
    if plot and (warp or scene):
        raise JodaError("--plot draws hinges of our own; leave out the scene and --warp.")
    if plot:
        _bench_plot(plot, force, as_json)
        return
    if warp:
        _bench_warp(scene, worlds or (), as_json)
        return
    with spinner("bench") as progress:
        rows = bench(scene, progress=progress)
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    _say_ratios(rows)


def _bench_plot(plot: Path, force: bool, as_json: bool) -> None:
    """`joda bench --plot`."""
    with spinner("bench") as progress:
        growth = draw_growth(plot, force=force, progress=progress)
    if as_json:
        print_json(asdict(growth))
        return
    say(plot)


def _bench_warp(scene: Path | None, worlds: Sequence[int], as_json: bool) -> None:
    """`joda bench --warp`."""
    from joda.warp import quiet
    from joda.warp.bench import WORLDS
    from joda.warp.bench import bench as run

    quiet()
    with spinner("bench") as progress:
        rows = run(scene, worlds=worlds or WORLDS, progress=progress)
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    _say_worlds(rows)


def _say_ratios(rows: Iterable[Row]) -> None:
    """The table of `joda bench`."""
    from rich.console import Console
    from rich.table import Table

    table = Table("comparison", "ratio", "required", "µs per step", box=None, pad_edge=False)
    for row in rows:
        ours, other = row.microseconds
        table.add_row(
            row.what, f"{row.ratio:.3f} ± {row.spread:.3f}", row.bar, f"{ours:.2f} / {other:.2f}"
        )
    Console(width=None if sys.stdout.isatty() else 110).print(table)


def _say_worlds(rows: "Sequence[WarpRow]") -> None:
    """The table of `joda bench --warp`."""
    from rich.console import Console
    from rich.table import Table

    heads = ("worlds", "steps/s with profiles", "native", "none", "÷ native", "÷ none", "kernels")
    table = Table(*heads, box=None, pad_edge=False)
    for row in rows:
        speeds = (f"{speed:,.0f}" for speed in row.per_second)
        ratios = (f"{row.native_ratio:.2f}", f"{row.plain_ratio:.2f}")
        table.add_row(str(row.worlds), *speeds, *ratios, " / ".join(map(str, row.launches)))
    Console(width=None if sys.stdout.isatty() else 110).print(table)
    say(f"device {rows[0].device}; ÷: time with profiles over that of the other scene")
