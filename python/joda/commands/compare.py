"""Compares a model with measured runs and curves: numbers, sentences, a picture, a page."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from joda.files import check_targets, write_together
from joda.measured.adequacy import Adequacy, adequacy
from joda.measured.comparison import Comparison, sentences
from joda.measured.curves import curve_error, curves_verdict, failing_force
from joda.measured.errors import Errors, errors, known
from joda.measured.failing_intervals import LENGTHS, Failing, where, window_rows
from joda.measured.maps import SHOWN, Replayed, draw_curves, draw_maps, draw_runs
from joda.measured.measured_joint import Measured
from joda.measured.reading import read_measured
from joda.measured.replay import left_out
from joda.measured.timestep_error import timestep_note
from joda.measured.visited import unvisited
from joda.pictures.page import page, paragraph, table
from joda.pictures.page import picture as embedded
from joda.pictures.style import house_style, png
from joda.threads import one_blas_thread

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

Array = NDArray[np.float64]


@one_blas_thread
def compare(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    *,
    passive: bool = False,
    corrections: str | Path | None = None,
    json: str | Path | None = None,
    report: str | Path | None = None,
    picture: str | Path | None = None,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Comparison:
    """Replays measured runs in MuJoCo, and tells where the model fails; quasi-static curves too.

    Args:
        model: MJCF or URDF, with or without a profile on the joint.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        runs: CSV files with time, position and perhaps force; without time, position and the force
            that slowly moves the joint there, in the order measured.
        passive: whether the actuators on the joint, if there are any, were off.
        corrections: what is wrong with the runs, as `joda.improve` or `joda.add` wrote it beside
            its scene: they are replayed as if that were right.
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
    read = [model, *runs, *([corrections] if corrections else [])]
    check_targets(targets, force, read)
    measured = read_measured(model, joint, runs, passive, corrections)
    found = errors(measured, explained=True, begin=progress)
    short = window_rows(measured)
    judged = adequacy(measured, found, short) if found.runs else None
    places, length = _failing(measured, found, short, judged)
    if judged and judged.verdict == "within_noise" and places:
        judged = replace(judged, verdict="not_enough_data")
    described = measured.profile.joint
    note = timestep_note(measured, found.window, found.whole) if found.runs else None
    forces = tuple(failing_force(measured.curves, described))
    comparison = Comparison(
        joint=described.name,
        unit=described.unit,
        runs=found.runs,
        rmse=known(found.whole),
        rmse_window=known(found.window),
        noise_floor=known(found.noise),
        adequacy=judged,
        failing=tuple(places),
        failing_window=length,
        curves=tuple(curve_error(curve, described) for curve in measured.curves),
        curves_adequacy=curves_verdict(measured.curves, forces) if measured.curves else None,
        failing_force=forces,
        notes=(
            *(note for note in measured.notes if note != measured.barred),
            *left_out(measured.runs, LENGTHS[0]),
            *([note] if note else []),
        ),
        contacts=measured.contacts,
    )
    files: dict[Path, bytes | str] = {}
    if json:
        files[Path(json)] = comparison.to_json()
    if report or picture:
        drawn = png(_picture(measured, found.paths, short))
        if picture:
            files[Path(picture)] = drawn
        if report:
            files[Path(report)] = _page(comparison, drawn)
    write_together(files)
    return comparison


def _failing(
    measured: Measured, found: Errors, short: Array, judged: Adequacy | None
) -> tuple[list[Failing], float]:
    """Where it fails, and the windows' length, s; nothing where the data tell too little."""
    if judged is None or judged.verdict == "not_enough_data":
        return [], LENGTHS[0]
    return where(measured, found.paths, short, judged.verdict == "beyond_noise")


def _page(comparison: Comparison, drawn: bytes) -> str:
    unit = comparison.unit
    runs = [
        (run.file, *(_size(x, unit) for x in (run.rmse, run.rmse_window, run.noise_floor)))
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


def _size(error: float | None, unit: str) -> str:
    return "not replayed" if error is None else f"{error:.3g} {unit}"


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
            left, right = above.subfigures(1, 2, squeeze=False)[0]
            joint = measured.profile.joint
            draw_runs(left, measured.runs, {"model": paths}, joint.unit)
            draw_maps(
                right,
                [Replayed("windows of 0.1 s, \u00b1 2 standard deviations", paths, rows)],
                joint,
                unvisited(measured),
            )
            left.suptitle("measured runs and the model's replay", x=0.02, ha="left")
            right.suptitle("where it fails", x=0.02, ha="left")
        if curves:
            draw_curves(below, measured, curves)
            below.suptitle("quasi-static force that moves the joint", x=0.01, ha="left")
    return figure
