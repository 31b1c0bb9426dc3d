"""Compares a model with measured runs and curves: numbers, sentences, a picture, a page."""

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
from joda.curves import curve_error, failing_force
from joda.draw import COLOURS, house_style, png
from joda.files import check_target, write_bytes, write_text
from joda.gauge import Gauged, static_force
from joda.page import page, paragraph, table
from joda.page import picture as embedded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

Array = NDArray[np.float64]

UNCLEAR = 5.0
"""A force is not drawn if its standard deviation is so many times the median one."""
SHOWN = 4
"""How many runs, and how many curves, the picture shows."""
DOTS = 800.0
"""Size of a curve's dots times their number, points; within limits."""


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
    """Replays measured runs in MuJoCo, and tells where the model fails; quasi-static curves too.

    Args:
        model: MJCF or URDF, with or without a profile on the joint.
        joint: its name or address, see `joda.model.find_joint`.
        runs: CSV files with time, position and perhaps force; without time, position and the force
            that slowly moves the joint there, in the order measured.
        json, report, picture: files to write: all numbers, an HTML page that needs nothing else,
            a PNG.
        force: overwrite them.
        progress: told what is being done.

    Returns:
        errors against the noise floor, by run and by place.

    Raises:
        JodaError: a file cannot be read, or what it holds cannot be of this joint as it stands.
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
    described = measured.profile.joint
    comparison = Comparison(
        joint=described.name,
        unit=described.unit,
        runs=tuple(rows),
        rmse=rms(np.concatenate(wholes)) if rows else None,
        rmse_window=rms(np.concatenate(windows)) if rows else None,
        noise_floor=rms(np.array(measured.sigma)) if rows else None,
        failing=tuple(failing(short)),
        curves=tuple(curve_error(curve, described) for curve in measured.curves),
        failing_force=tuple(failing_force(measured.curves, described)),
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
    runs = [
        (run.file, *(f"{x:.3g} {unit}" for x in (run.rmse, run.rmse_window, run.noise_floor)))
        for run in comparison.runs
    ]
    curves = [
        (one.file, *(f"{x:.3g} {one.unit}" for x in (one.rmse_force, one.noise_floor_force)))
        for one in comparison.curves
    ]
    shown = {
        "measured and replayed runs, and the force the model has too much": runs,
        "measured and modelled quasi-static force": curves,
    }
    tables = []
    if runs:
        tables.append(table(("run", "whole run, RMS", "windows of 0.4 s, RMS", "noise"), runs))
    if curves:
        tables.append(table(("curve", "force, RMS", "noise"), curves))
    return page(
        f"{comparison.joint}: model against measurement",
        *map(paragraph, (*sentences(comparison), *comparison.notes)),
        embedded(drawn, "; ".join(what for what, rows in shown.items() if rows)),
        *tables,
    )


def _picture(measured: Measured, paths: Sequence[Array], rows: Array) -> "Figure":
    """The runs above, the curves below."""
    from matplotlib.figure import Figure

    curves = measured.curves[:SHOWN]
    lines = (len(curves) + 1) // 2
    heights = [7.0] * bool(paths) + [3.7 * lines + 0.4] * bool(curves)
    with house_style():
        figure = Figure(figsize=(12, sum(heights)), dpi=110, layout="constrained")
        above: Figure | SubFigure = figure
        below: Figure | SubFigure = figure
        if paths and curves:
            above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights)[:, 0]
        if paths:
            _runs(above, measured, paths, rows)
        if curves:
            _curves(below, measured, curves)
    return figure


def _runs(
    part: "Figure | SubFigure", measured: Measured, paths: Sequence[Array], rows: Array
) -> None:
    """Measured and replayed runs; the force that the model has too much by place and speed."""
    unit = measured.profile.joint.unit
    force = "N·m" if unit == "rad" else "N"
    shown = list(zip(measured.runs, paths, strict=True))[:SHOWN]
    left, right = part.subfigures(1, 2, squeeze=False)[0]
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
    for axes, label in zip(panels, ("normalised position s", f"velocity ({unit}/s)"), strict=True):
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


def _curves(part: "Figure | SubFigure", measured: Measured, curves: Sequence[Gauged]) -> None:
    """Measured quasi-static force over position, and the model's in both directions."""
    shape = (len(curves) + 1) // 2, min(len(curves), 2)
    plots = part.subplots(*shape, squeeze=False, sharey=True).ravel()
    for axes, curve in zip(plots, curves, strict=False):
        _curve(axes, measured, curve)
    for axes in plots[len(curves) :]:
        axes.set_visible(False)
    pairs = (zip(*axes.get_legend_handles_labels(), strict=True) for axes in plots)
    named = {label: handle for pair in pairs for handle, label in pair}
    part.legend(
        named.values(), named, loc="upper right", frameon=False, fontsize=8, ncols=len(named)
    )
    part.suptitle("quasi-static force that moves the joint", x=0.01, ha="left")


def _curve(axes: "Axes", measured: Measured, curve: Gauged) -> None:
    joint = measured.profile.joint
    lo, hi = joint.range
    grid, s = np.linspace(lo, hi, 501), (curve.curve.position - lo) / (hi - lo)
    size = float(np.clip(DOTS / len(s), 2.5, 6))
    unclear = curve.direction == 0
    if unclear.any():
        dots = "turning"
        axes.plot(s[unclear], curve.curve.force[unclear], ".", color="#bbbbbb", ms=size, label=dots)
    for way, name, sign in ((1, "friction", "+"), (-1, "damping", "\N{MINUS SIGN}")):
        there = curve.direction == way
        dots, line = (f"{what} towards {sign}q" for what in ("measured", "model"))
        axes.plot(s[there], curve.curve.force[there], ".", color=COLOURS[name], ms=size, label=dots)
        force = static_force(measured.profile, measured.context, grid, way)
        axes.plot(np.linspace(0, 1, 501), force, color=COLOURS[name], lw=1.6, label=line)
    axes.axhline(0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.set_title(curve.curve.name, loc="left", fontsize=9, parse_math=False)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("normalised position s")
    axes.set_ylabel(f"force ({'N·m' if joint.type == 'hinge' else 'N'})")
    axes.spines[["top", "right"]].set_visible(False)
