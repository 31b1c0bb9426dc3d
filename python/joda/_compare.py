"""Compares a model with measured runs: numbers, sentences, a picture, a page."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from joda.comparison import (
    FORCE,
    Comparison,
    Measured,
    RunError,
    failing,
    joined,
    read_measured,
    rms,
    sentences,
    window_rows,
)
from joda.draw import COLOURS, house_style, png
from joda.files import check_target, write_bytes, write_text
from joda.page import page, paragraph, table
from joda.page import picture as embedded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

UNCLEAR = 5.0
"""A force is not drawn if its standard deviation is so many times the median one."""
SHOWN = 4
"""How many runs the picture shows."""


def compare(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    *,
    json: str | Path | None = None,
    report: str | Path | None = None,
    picture: str | Path | None = None,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Comparison:
    """Replays measured runs in MuJoCo and tells where the model fails.

    Args:
        model: MJCF or URDF, with or without a profile on the joint.
        joint: its name or address, see `joda.model.find_joint`.
        runs: CSV files with time, position and perhaps force.
        json, report, picture: files to write: all numbers, an HTML page that needs nothing else,
            a PNG.
        force: overwrite them.
        progress: told what is being done.

    Returns:
        errors against the noise floor, by run and by place.

    Raises:
        JodaError: a file cannot be read, or a run cannot be of this joint as it stands.
    """
    targets = [Path(path) for path in (json, report, picture) if path]
    for path in targets:
        check_target(path, force)
    measured = read_measured(model, joint, runs)
    rows, wholes, windows, paths = [], [], [], []
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        progress(run.name)
        paths.append(measured.replayer.whole(run, sigma))
        whole = paths[-1] - run.position
        whole = whole[~np.isnan(whole)]
        left = joined(measured.replayer.windows(run, sigma))
        rows.append(RunError(run.name, rms(whole), rms(left), sigma))
        wholes.append(whole)
        windows.append(left)
    short = window_rows(measured)
    floor = float(np.sqrt(np.mean(np.square(measured.sigma))))
    comparison = Comparison(
        joint=measured.profile.joint.name,
        unit=measured.profile.joint.unit,
        runs=tuple(rows),
        rmse=rms(np.concatenate(wholes)),
        rmse_window=rms(np.concatenate(windows)),
        noise_floor=floor,
        failing=tuple(failing(short)),
        notes=measured.notes,
    )
    if json:
        write_text(Path(json), comparison.to_json())
    if report or picture:
        drawn = png(_picture(measured, paths, short))
        if picture:
            write_bytes(Path(picture), drawn)
        if report:
            write_text(Path(report), _page(comparison, drawn))
    return comparison


def _page(comparison: Comparison, drawn: bytes) -> str:
    unit = comparison.unit
    rows = [
        (run.file, *(f"{x:.3g} {unit}" for x in (run.rmse, run.rmse_window, run.noise_floor)))
        for run in comparison.runs
    ]
    return page(
        f"{comparison.joint}: model against measurement",
        *map(paragraph, (*sentences(comparison), *comparison.notes)),
        embedded(drawn, "measured and replayed runs, and the force the model has too much"),
        table(("run", "whole run, RMS", "windows of 0.4 s, RMS", "noise"), rows),
    )


def _picture(measured: Measured, paths: Sequence[Array], rows: Array) -> "Figure":
    """Measured and replayed runs; the force that the model has too much by place and speed."""
    from matplotlib.figure import Figure

    unit = measured.profile.joint.unit
    force = "N·m" if unit == "rad" else "N"
    shown = list(zip(measured.runs, paths, strict=True))[:SHOWN]
    with house_style():
        figure = Figure(figsize=(12, 7), dpi=110, layout="constrained")
        left, right = figure.subfigures(1, 2, squeeze=False)[0]
        plots = np.atleast_1d(left.subplots(len(shown), 1))
        for axes, (run, path) in zip(plots, shown, strict=True):
            axes.plot(run.time, run.position, ".", color="#444444", ms=2.5, label="measured")
            axes.plot(run.time, path, color=COLOURS["conservative"], lw=1.6, label="model")
            axes.set_ylabel(f"position ({unit})")
            axes.set_title(run.name, loc="left", fontsize=9, parse_math=False)
        plots[0].legend(frameon=False, fontsize=8, ncols=2)
        plots[-1].set_xlabel("time (s)")
        panels = right.subplots(2, 1)
        usual = np.median(rows[:, FORCE + 1]) if len(rows) else 0.0
        for row in rows[rows[:, FORCE + 1] < UNCLEAR * usual]:
            colour = COLOURS["friction" if row[1] > 0 else "damping"]
            for axes, x in zip(panels, row[:2], strict=True):
                force_and_doubt = row[FORCE], 2 * row[FORCE + 1]
                axes.errorbar(x, *force_and_doubt, fmt=".", color=colour, lw=0.7)
        for axes, label in zip(
            panels, ("normalised position s", f"velocity ({unit}/s)"), strict=True
        ):
            axes.axhline(0, color="#bbbbbb", lw=0.8, zorder=0)
            axes.set_xlabel(label)
            axes.set_ylabel(f"force too much ({force})")
        panels[0].plot([], [], ".", color=COLOURS["friction"], label="towards +q")
        panels[0].plot([], [], ".", color=COLOURS["damping"], label="towards \N{MINUS SIGN}q")
        panels[0].legend(frameon=False, fontsize=8, ncols=2)
        for axes in (*plots, *panels):
            axes.spines[["top", "right"]].set_visible(False)
        left.suptitle("measured runs and the model's replay", x=0.02, ha="left")
        right.suptitle(
            "where it fails: windows of 0.1 s, \u00b1 2 standard deviations", x=0.02, ha="left"
        )
    return figure
