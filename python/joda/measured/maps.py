"""Pictures of models against measurement: replayed runs, and maps of the force that is missing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from joda.measured.failing_intervals import FORCE, window_rows
from joda.measured.measured_joint import Measured
from joda.measured.quasi_static import QuasiStaticComparison, static_force
from joda.measured.runs import Run
from joda.measured.visited import Interval
from joda.pictures.style import COLOURS, clean
from joda.profile import Joint, Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

Array = NDArray[np.float64]

UNCLEAR = 5.0
"""A force is not drawn if its standard deviation is so many times the median one."""
SHOWN = 4
"""How many runs, and how many curves, a picture shows."""
NOBODY = "#ececec"
"""Colour of where no run has been."""
DOTS = 800.0
"""Size of a curve's dots times their number, points; within limits."""
WAYS = ((1, "friction", "+q"), (-1, "damping", "\N{MINUS SIGN}q"))
"""Sign, colour and name of the two directions."""


@dataclass(frozen=True)
class Replayed:
    """What a model makes of the runs.

    Attributes:
        label: of the model.
        paths: predicted positions at each run's times, rad or m.
        rows: of `joda.measured.comparison.window_rows`.
    """

    label: str
    paths: Sequence[Array]
    rows: Array


def replayed(label: str, measured: Measured) -> Replayed:
    """What the model makes of all runs."""
    return Replayed(label, measured.paths(), window_rows(measured))


def shown(runs: Sequence[Run]) -> list[int]:
    """Numbers of the runs that a picture shows: evenly spread over all of them."""
    count = min(len(runs), SHOWN)
    return [k * len(runs) // count for k in range(count)]


def draw_runs(
    part: "Figure | SubFigure",
    runs: Sequence[Run],
    models: Mapping[str, Sequence[Array]],
    unit: str,
) -> None:
    """Some of the measured runs with the models' replays; the last model's is the red one."""
    numbers = shown(runs)
    plots = np.atleast_1d(part.subplots(len(numbers), 1))
    last = len(models) - 1
    for axes, k in zip(plots, numbers, strict=True):
        axes.plot(runs[k].time, runs[k].position, ".", color="#444444", ms=2.5, label="measured")
        for number, (label, paths) in enumerate(models.items()):
            colour, line = (COLOURS["conservative"], "-") if number == last else ("#888888", "--")
            axes.plot(runs[k].time, paths[k], line, color=colour, lw=1.6, label=label)
        axes.set_ylabel(f"position ({unit})")
        axes.set_title(clean(runs[k].name), loc="left", fontsize=9, parse_math=False)
        axes.spines[["top", "right"]].set_visible(False)
    handles, labels = plots[0].get_legend_handles_labels()
    part.legend(
        handles, labels, loc="outside lower left", frameon=False, fontsize=8, ncols=len(labels)
    )
    plots[-1].set_xlabel("time (s)")


def draw_maps(
    part: "Figure | SubFigure",
    models: Sequence[Replayed],
    joint: Joint,
    unvisited: Sequence[Interval],
) -> None:
    """The residual force of each model, by position above and by velocity below.

    Args:
        part: of a figure.
        models: what each makes of the runs.
        joint: of which they are.
        unvisited: parts of the range where no run was, in normalised position; drawn grey.
    """
    force = joint.force_unit
    panels = part.subplots(2, len(models), squeeze=False, sharey=True, sharex="row")
    for column, model in zip(panels.T, models, strict=True):
        for axes, x in zip(column, (0, 1), strict=True):
            _map(axes, model.rows, x)
        shade(column[0], unvisited)
        column[0].set_title(model.label, loc="left", fontsize=9)
        column[0].set_xlabel("normalised position s")
        column[1].set_xlabel(f"velocity ({joint.unit}/s)")
    for axes in panels[:, 0]:
        axes.set_ylabel(f"residual force ({force})")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    part.legend(handles, labels, loc="outside lower right", frameon=False, fontsize=8, ncols=2)


def shade(axes: "Axes", intervals: Sequence[Interval]) -> None:
    """Greys parts of the horizontal axis where no run has been; one label for all."""
    for number, (a, b) in enumerate(intervals):
        axes.axvspan(a, b, color=NOBODY, lw=0, zorder=-1, label="" if number else "not visited")


def _map(axes: "Axes", rows: Array, x: int) -> None:
    """Forces of segments with two standard deviations over one of the columns of the rows."""
    force_error = rows[:, FORCE + 1]
    clear = rows[force_error < UNCLEAR * np.median(force_error)] if len(rows) else rows
    for sign, name, way in WAYS:
        some = clear[np.sign(clear[:, 1]) == sign]
        style: dict[str, Any] = {
            "fmt": ".",
            "color": COLOURS[name],
            "lw": 0.7,
            "label": f"towards {way}",
        }
        axes.errorbar(some[:, x], some[:, FORCE], 2 * some[:, FORCE + 1], **style)
    axes.axhline(0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.spines[["top", "right"]].set_visible(False)


def draw_curves(
    part: "Figure | SubFigure", measured: Measured, curves: Sequence[QuasiStaticComparison]
) -> None:
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
        named.values(), named, loc="outside lower right", frameon=False, fontsize=8, ncols=2
    )


def draw_models(
    part: "Figure | SubFigure", measured: Measured, models: Mapping[str, Profile]
) -> None:
    """Some of the curves beside each of several models, one model below the other."""
    parts = part.subfigures(len(models), 1, squeeze=False)[:, 0]
    for own, (label, profile) in zip(parts, models.items(), strict=True):
        draw_curves(own, measured.changed(profile), measured.curves[:SHOWN])
        own.suptitle(label, x=0.01, ha="left", fontsize=10)


def _curve(axes: "Axes", measured: Measured, curve: QuasiStaticComparison) -> None:
    joint = measured.profile.joint
    lo, hi = joint.range
    grid, s = np.linspace(lo, hi, 501), (curve.curve.position - lo) / (hi - lo)
    size = float(np.clip(DOTS / len(s), 2.5, 6))
    unclear = curve.direction == 0
    if unclear.any():
        dots = "turning"
        axes.plot(s[unclear], curve.curve.force[unclear], ".", color="#bbbbbb", ms=size, label=dots)
    for way, name, towards in WAYS:
        there = curve.direction == way
        dots, line = (f"{what} towards {towards}" for what in ("measured", "model"))
        colour = COLOURS[name]
        if there.any():
            axes.plot(s[there], curve.curve.force[there], ".", color=colour, ms=size, label=dots)
        force = static_force(measured.profile, measured.context, grid, way)
        axes.plot(np.linspace(0, 1, 501), force, color=colour, lw=1.6, label=line)
    axes.axhline(0, color="#bbbbbb", lw=0.8, zorder=0)
    axes.set_title(clean(curve.curve.name), loc="left", fontsize=9, parse_math=False)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel("normalised position s")
    axes.set_ylabel(f"force ({'N·m' if joint.type == 'hinge' else 'N'})")
    axes.spines[["top", "right"]].set_visible(False)
