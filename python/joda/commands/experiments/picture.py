"""The picture of a case: what the joint does with its profile and with either baseline."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from joda.commands.experiments.base import Case, Press, unit_shown
from joda.commands.experiments.trial import WAYS, Tried
from joda.field import evaluate
from joda.interaction.traces import draw_force, draw_position, shade, shown
from joda.joints.resistance import friction_bounds
from joda.pictures.offscreen import Image, NoRenderer, render
from joda.pictures.style import COLOURS, house_style
from joda.scenes.motion import at_home, fast

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLES = {
    "joda": "with its profile",
    "constant": "constant friction and damping",
    "spring": "linear return spring",
}
INKS = {"joda": COLOURS["conservative"], "constant": "#777777", "spring": "#1f5fbf"}
SHORT = {"joda": "profile", "constant": "constant", "spring": "spring"}


def draw_case(
    case: Case, tried: Tried, numbers: Mapping[str, Sequence[float]], scene: Path
) -> "Figure":
    """Motions above; below the forces over position, the numbers of all seeds, and the object.

    Args:
        case: the case.
        tried: with the first seed.
        numbers: of all seeds, by name.
        scene: with the first seed's profile, to be rendered.
    """
    from matplotlib.figure import Figure

    with house_style():
        rows = 3 if case.trial.forced else 2
        heights = [1.25, 0.7, 1.0] if case.trial.forced else [1.25, 1.0]
        figure = Figure(figsize=(13, 2.9 * sum(heights) + 0.5), dpi=100, layout="constrained")
        grid: Any = figure.add_gridspec(rows, 3, height_ratios=heights)
        _motions(figure, grid, case, tried)
        _forces(figure.add_subplot(grid[-1, 0]), tried)
        _numbers(figure.add_subplot(grid[-1, 1]), case, tried, numbers)
        axes = figure.add_subplot(grid[-1, 2])
        axes.axis("off")
        view = _view(tried, scene)
        if view is not None:
            axes.imshow(view)
    return figure


def _motions(figure: "Figure", grid: Any, case: Case, tried: Tried) -> None:
    """A panel for each way, all with the same axes; where something pushes, its force below."""
    joint, trial = tried.context.joint, case.trial
    factor, _ = shown(joint)
    upper: Any = None
    lower: Any = None
    for column, way in enumerate(WAYS):
        upper = figure.add_subplot(grid[0, column], sharex=upper, sharey=upper)
        upper.set_title(TITLES[way], loc="left", fontsize=11, color=INKS[way])
        panels = [upper]
        if trial.forced:
            lower = figure.add_subplot(grid[1, column], sharex=upper, sharey=lower)
            panels.append(lower)
        motions = tried.motions[way]
        for k, motion in enumerate(motions):
            style = ":" if trial.forced and k < len(motions) - 1 else "-"
            draw_position(upper, motion, joint, colour=INKS[way], style=style)
            if trial.forced:
                draw_force(lower, motion, joint, colour=INKS[way], style=style)
        for motion in trial.reference():
            draw_position(upper, motion, joint, colour="#111111", style=":")
        for place in trial.ends:
            at = factor * (joint.range[0] + place * np.ptp(joint.range))
            ring: dict[str, Any] = {"mfc": "none", "mec": "#333333", "ms": 7, "clip_on": False}
            upper.plot(motions[0].time[-1], at, "o", zorder=5, **ring)
        told = "; circles: where it belongs" if trial.ends else ""
        told = "; dotted: the object's own motion" if trial.reference() else told
        panels[-1].set_xlabel(f"time (s){told}")
        for axes in panels[: len(panels) * bool(column)]:
            axes.set_ylabel("")
        if isinstance(trial, Press):
            quick = fast(motions[0], float(np.ptp(joint.range)) / trial.seconds)
            for axes in panels:
                shade(axes, quick, "")


def _forces(axes: "Axes", tried: Tried) -> None:
    """Force by position, its friction around it, of the profile and of both baselines."""
    found = tried.context
    lo, hi = found.joint.range
    s = np.linspace(0, 1, 801)
    factor, unit = shown(found.joint)
    q = factor * (lo + s * (hi - lo))
    for way in reversed(WAYS):
        profile = tried.profile if way == "joda" else tried.baselines[way].profile(found)
        force = evaluate(profile.channels.conservative, s)[0]
        up, down = friction_bounds(profile, s, np.inf)
        axes.plot(q, force, color=INKS[way], lw=1.8, label=SHORT[way])
        axes.fill_between(q, force - down, force + up, color=INKS[way], alpha=0.15, lw=0)
    balance = -np.array(found.gravity_force)
    if found.gravity_scale > 0.02 * np.abs(axes.get_ylim()).max():
        at = factor * np.array(found.positions)
        axes.plot(at, balance, "--", color="#222222", lw=1.2, label="balances gravity")
    axes.set_xlabel(f"position ({unit})")
    axes.set_ylabel("own force (N·m)" if found.joint.type == "hinge" else "own force (N)")
    axes.set_title("force and friction", loc="left", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)


def _numbers(
    axes: "Axes", case: Case, tried: Tried, numbers: Mapping[str, Sequence[float]]
) -> None:
    """The case's number of every seed."""
    everything = np.concatenate([numbers[way] for way in WAYS])
    for row, way in enumerate(WAYS):
        values = np.asarray(numbers[way])
        heights = row + 0.3 * (np.linspace(-1, 1, len(values)) if len(values) > 1 else np.zeros(1))
        axes.plot(values, heights, "o", color=INKS[way], ms=5, alpha=0.8, clip_on=False)
    axes.set_yticks(range(len(WAYS)), [SHORT[way] for way in WAYS])
    axes.set_ylim(len(WAYS) - 0.5, -0.5)
    if everything.min() > 0 and everything.max() > 20 * everything.min():
        axes.set_xscale("log")
    else:
        axes.set_xlim(left=0)
    axes.set_xlabel(f"{unit_shown(case, tried.subjects['joda'])}: {case.better} is better")
    seeds = len(next(iter(numbers.values())))
    axes.set_title(f"the number, {seeds} compile seed{'s' * (seeds > 1)}", loc="left", fontsize=10)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(left=False)


def _view(tried: Tried, scene: Path) -> Image | None:
    """The object with its joint half-way; None where nothing can render."""
    subject = tried.subjects["joda"]
    pose = at_home(subject.model).qpos.copy()
    pose[subject.model.jnt_qposadr[subject.joint]] = subject.at(0.5)
    try:
        return render(scene, [pose], width=640, height=480)[0]
    except NoRenderer:
        return None
