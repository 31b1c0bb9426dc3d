"""Compares a model with measured runs and curves: numbers, sentences, a picture, a page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from json import dumps, loads
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from joda.files import check_targets, write_text, write_together
from joda.measured.adequacy import Adequacy, adequacy
from joda.measured.comparison import Comparison, sentences
from joda.measured.curves import curve_error, curves_verdict, failing_force
from joda.measured.driven import ALL, named_joints
from joda.measured.errors import Errors, errors, known
from joda.measured.failing_intervals import LENGTHS, Failing, where, window_rows
from joda.measured.maps import SHOWN, Replayed, draw_curves, draw_maps, draw_runs
from joda.measured.measured_joint import Measured
from joda.measured.misfit import rms
from joda.measured.reading import read_measured
from joda.measured.replay import left_out
from joda.measured.scene_replay import Together, replayed_together
from joda.measured.timestep_error import timestep_note
from joda.measured.visited import unvisited
from joda.pictures.page import page, paragraph, table
from joda.pictures.page import picture as embedded
from joda.pictures.style import house_style, png
from joda.scenes.model import load_model
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.say import print_json, say
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


@dataclass(frozen=True)
class Compared:
    """A model against logs of several joints.

    Attributes:
        joints: each joint by itself, what the others do to it as a force on it, by name.
        together: replays of the scene as it is, all joints at once; none where a command of one of
            their actuators, or a force, is not known, or runs were corrected.
    """

    joints: dict[str, Comparison]
    together: tuple[Together, ...]

    def rmse(self, joint: str) -> float | None:
        """Of a joint in the replays of all at once, rad or m; None where a run has none."""
        errors = [error for run in self.together if (error := run.rmse.get(joint)) is not None]
        return rms(np.array(errors)) if errors and len(errors) == len(self.together) else None

    def to_json(self) -> str:
        """The comparison as JSON."""
        joints = {
            name: loads(one.to_json()) | {"rmse_together": self.rmse(name)}
            for name, one in self.joints.items()
        }
        runs = [vars(run) for run in self.together]
        return dumps({"joints": joints, "together": runs}, indent=2, ensure_ascii=False) + "\n"


def compare_all(
    model: str | Path,
    runs: Sequence[str | Path],
    joints: Sequence[str] = (ALL,),
    *,
    passive: bool = False,
    corrections: str | Path | None = None,
    json: str | Path | None = None,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Compared:
    """Compares a model with logs of several joints: each joint by itself, then all at once.

    Args:
        model: MJCF or URDF, with or without profiles.
        runs: CSV files with time, `position:JOINT` and perhaps `velocity:JOINT`, `force:JOINT`,
            `ctrl:ACTUATOR`.
        joints: names; "all": those that the first run has.
        passive: whether the actuators on the joints were off.
        corrections: as in `joda.compare`, of every joint by itself.
        json: file to write, all numbers.
        force: overwrite it.
        progress: told what is being done.

    Raises:
        JodaError: as `joda.compare`.
    """
    check_targets([Path(json)] if json else [], force, [model, *runs])
    found = {}
    for name in named_joints(model, runs, joints):
        progress(name)
        found[name] = compare(model, name, runs, passive=passive, corrections=corrections)
    progress("all joints at once")
    together = (
        ()
        if passive or corrections
        else replayed_together(load_model(Path(model)), [*map(Path, runs)])
    )
    compared = Compared(found, together)
    if json:
        write_text(Path(json), compared.to_json())
    return compared


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
        "measured and replayed runs, and the residual force": runs,
        "measured and modelled quasi-static force": curves,
    }
    tables = []
    if runs:
        tables.append(
            table(("run", "free-run error, RMS", "segment error (0.4 s), RMS", "noise"), runs)
        )
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
                [Replayed("segments of 0.1 s, \u00b1 2 standard deviations", paths, rows)],
                joint,
                unvisited(measured),
            )
            left.suptitle("measured runs and the model's replay", x=0.02, ha="left")
            right.suptitle("where it fails", x=0.02, ha="left")
        if curves:
            draw_curves(below, measured, curves)
            below.suptitle("quasi-static force that moves the joint", x=0.01, ha="left")
    return figure


def command(
    model: options.Model,
    runs: options.Runs,
    joint: options.Joints = None,
    as_json: options.JsonFile = None,
    report: options.Report = None,
    output: options.Picture = None,
    corrections: options.Corrections = None,
    passive: options.Passive = False,
    force: options.Force = False,
) -> None:
    """Replay measured runs: how far off the model is, and where.

    Example:

        joda compare oven/scene.xml out/let_go_5.csv out/let_go_45.csv --joint door --report compare.html
    """  # noqa: E501
    written = None if as_json == options.STDOUT else as_json
    if options.several(joint):
        options.one_joint_only(report, output)
        with spinner("compare") as progress:
            every = compare_all(
                model, runs, joint or (), passive=passive, corrections=corrections, json=written,
                force=force, progress=progress,
            )  # fmt: skip
        if as_json == options.STDOUT:
            print_json(loads(every.to_json()))
            return
        _say_joints(every)
        if as_json:
            say(as_json)
        return
    assert joint
    with spinner("compare") as progress:
        found = compare(
            model, joint[0], runs, passive=passive, corrections=corrections, json=written,
            report=report, picture=output, force=force, progress=progress,
        )  # fmt: skip
    if as_json == options.STDOUT:
        print_json(loads(found.to_json()))
        return
    for sentence in (*found.notes, *sentences(found)):
        say(sentence)
    for path in filter(None, (written, report, output)):
        say(path)


def _say_joints(found: Compared) -> None:
    """Errors of all joints of logs of several, a row each, and what is said of each."""
    rows: list[tuple[str, ...]] = []
    rows.append(("joint", "free-run error", "segment error (0.4 s)", "noise", "all joints at once"))
    for name, one in found.joints.items():
        errors = one.rmse, one.rmse_window, one.noise_floor, found.rmse(name)
        rows.append((name, *("" if x is None else f"{x:.3g} {one.unit}" for x in errors)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip())
    if not found.together:
        say("Not replayed all at once: a command of an actuator on them, or a force, is not known.")
    notes = dict.fromkeys(note for one in found.joints.values() for note in one.notes)
    for note in notes:
        say(note)
