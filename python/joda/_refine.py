"""Gradient refinement: bends a joint's profile until simulation matches measured motions."""

import json
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda._attach import attach
from joda._context import Context, context
from joda.changes import changes, draw_channels
from joda.draw import COLOURS, house_style, write_png
from joda.errors import JodaError
from joda.field import evaluate
from joda.files import check_target, write_text
from joda.model import find_joint, joint_name, load
from joda.parameters import KINDS, Kind, Parameters, gravity_scale
from joda.profile import CHANNELS, Profile
from joda.runs import read_run
from joda.scene import profiles_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from joda.fitting import Fit, Problem

Array = NDArray[np.float64]

ITERATIONS = 60
SEEN = 0.5
"""A part of a curve is seen where the data shrink its uncertainty at least by this factor."""
PARTED = 5.0
"""Whole runs that are missed by so many times more than windows have parted from the measured."""
STEP = 1e-4
RUNS = 4
"""How many runs the picture shows."""
GRID = np.linspace(0, 1, 201)


@dataclass(frozen=True)
class Refined:
    """What a refinement did.

    Attributes:
        scene, composed, picture, history: the files that were written.
        changes: a line per changed component.
        before, after: RMS position error of whole runs from their starts, which are fitted within
            the measurement's error; rad or m.
        windows: the same of windows of 0.4 s, before and after.
        noise: of the measured position, rad or m.
        checked: errors of whole runs that were held out of the fit; None without such.
        unseen: per channel, intervals of normalised position of which the data told little.
        iterations: how many there were.
        notes: what the user should be told, a sentence each.
    """

    scene: Path
    composed: Path
    picture: Path
    history: Path
    changes: tuple[str, ...]
    before: float
    after: float
    windows: tuple[float, float]
    noise: float
    checked: tuple[float, float] | None
    unseen: dict[str, tuple[tuple[float, float], ...]]
    iterations: int
    notes: tuple[str, ...]


def refine(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    check: Sequence[str | Path] = (),
    iterations: int = ITERATIONS,
    method: Literal["lm", "adam"] = "lm",
    fit: Collection[Kind] = ("values", "intervals"),
    keep_shape: bool = True,
    force: bool = False,
    progress: Callable[[str, int, int, float], None] = lambda stage, number, total, rms: None,
) -> Refined:
    """Fits a joint's profile to measured motions.

    The joint is simulated by itself, all others held, at the scene's timestep, exactly as MuJoCo
    with the plugin does, and differentiated. Control points keep their sign, and rising and falling
    parts of a curve keep rising and falling, so that a magnet stays a magnet. What the data do not
    see stays near its value before.

    Args:
        model: a scene (MJCF) whose joint carries a profile.
        joint: its name or address, see `joda.model.find_joint`.
        runs: measured motions, CSV files with time, position and perhaps force.
        output: scene to write; beside it, with its name, go .composed.json, .png and .history.json.
        check: measured motions that are held out of the fit and only compared.
        iterations: at most so many.
        method: Levenberg-Marquardt, or Adam as in the paper.
        fit: what may change: the control points' values, the intervals' ends, the channels'
            strengths, the damping_ratio of the ends of the range, inertia, a gravity offset.
        keep_shape: see above.
        force: overwrite what exists.
        progress: told the stage, the iteration, of how many at most, and the RMS misfit (rad or m).

    Returns:
        what was written, and how much better it is.

    Raises:
        JodaError: a file cannot be read or written, the joint carries no profile, JAX is missing.
    """
    try:
        from joda import solo
        from joda.fitting import Problem
    except ImportError as error:
        raise JodaError(
            f'refine needs JAX (no module {error.name}); run: pip install ".[mjx]"'
        ) from None

    source, target = Path(model), Path(output)
    beside = {
        kind: target.with_suffix(f".{kind}") for kind in ("composed.json", "png", "history.json")
    }
    for path in (target, *beside.values()):
        check_target(path, force)
    if unknown := set(fit) - set(KINDS):
        raise JodaError(f"fit: '{sorted(unknown)[0]}' is none of {', '.join(KINDS)}.")
    if not runs:
        raise JodaError("no runs; give at least one CSV file with time and position.")
    measured, held_out = ([read_run(path) for path in paths] for paths in (runs, check))
    spec, compiled = load(source)
    number = find_joint(compiled, joint)
    name = joint_name(compiled, number)
    profiles = profiles_of(spec, compiled)
    if name not in profiles:
        raise JodaError(
            f"{source}: joint '{name}' carries no profile; make one with joda generate, or attach "
            "one with joda attach."
        )
    before, found = profiles[name], context(source, name)
    first = solo.from_context(found, before, compiled, number, attached=True)
    unit = gravity_scale(found, before)
    parameters = Parameters(before, fit, keep_shape=keep_shape, gravity=unit)
    if not len(parameters.start):
        raise JodaError(f"{source}: the profile of joint '{name}' has nothing to fit.")
    h = float(compiled.opt.timestep)
    problem = Problem(first, parameters, measured, h)
    result = problem.fit(
        iterations, method, lambda stage, k, rms: progress(stage, k, iterations, rms)
    )
    after = parameters.written(result.theta)
    errors = problem.rms(parameters.start), problem.rms(result.theta)
    windows = problem.rms_window(parameters.start), problem.rms_window(result.theta)
    checked = None
    if held_out:
        other = Problem(first, parameters, held_out, h)
        checked = other.rms(parameters.start), other.rms(result.theta)
    hidden = unseen(before, parameters, result.covariance)
    also, said = _beyond(parameters, result.theta, compiled, number, found)
    notes = attach(source, after, target, joint=name, also=also, force=True) + said
    write_text(beside["composed.json"], after.to_json())
    balance = np.array(found.positions), -np.array(found.gravity_force)
    figure = _picture(before, after, balance, problem, result, hidden)
    write_png(figure, beside["png"], force=True)
    write_text(beside["history.json"], _history(result, errors, problem.sigma, checked, hidden))
    if errors[1] > PARTED * max(windows[1], problem.sigma):
        notes.append(
            "Whole runs still part from the measured ones although windows of 0.4 s do not: near "
            "a barrier a small difference decides to which side a joint snaps."
        )
    if result.interrupted:
        notes.append(f"Interrupted; the best of {len(result.history)} iterations was kept.")
    return Refined(
        scene=target,
        composed=beside["composed.json"],
        picture=beside["png"],
        history=beside["history.json"],
        changes=tuple(changes(before, after)),
        before=errors[0],
        after=errors[1],
        windows=windows,
        noise=problem.sigma,
        checked=checked,
        unseen=hidden,
        iterations=len(result.history),
        notes=tuple(notes),
    )


def unseen(
    profile: Profile, parameters: Parameters, covariance: Array
) -> dict[str, tuple[tuple[float, float], ...]]:
    """Per channel, the intervals of normalised position of which the data told little.

    There the curve's standard deviation is more than half of what it was before any data.

    Args:
        profile: the fitted profile's form.
        parameters: what was fitted.
        covariance: of the fitted numbers.
    """
    prior = np.diag(parameters.doubt**2)
    out = {}
    slopes = _curve_slopes(parameters)
    for name in CHANNELS:
        if not getattr(profile.channels, name).components:
            continue
        J = slopes[name]
        left = np.sqrt(np.einsum("gi,ij,gj->g", J, covariance, J))
        begun = np.sqrt(np.einsum("gi,ij,gj->g", J, prior, J))
        hidden = (left > SEEN * begun) & (begun > 1e-9 * max(begun.max(), 1e-300))
        edges = np.flatnonzero(np.diff(np.concatenate([[0], hidden.astype(int), [0]])))
        pairs = edges.reshape(-1, 2)
        out[name] = tuple((float(GRID[a]), float(GRID[b - 1])) for a, b in pairs if b - a > 2)
    return out


def _curve_slopes(parameters: Parameters) -> dict[str, Array]:
    """Derivatives of the curves over GRID by the numbers, by central differences; (grid, n)."""
    n = len(parameters.start)
    out = {name: np.zeros((len(GRID), n)) for name in CHANNELS}
    for k in range(n):
        for sign in (1, -1):
            moved = parameters.start.copy()
            moved[k] += sign * STEP
            profile = parameters.written(moved, exact=True)
            for name in CHANNELS:
                curve = evaluate(getattr(profile.channels, name), GRID)[0]
                out[name][:, k] += sign * curve / (2 * STEP)
    return out


def _beyond(
    parameters: Parameters, theta: Array, model: mujoco.MjModel, joint: int, found: Context
) -> tuple[dict[str, str], list[str]]:
    """What was fitted besides the profile: attributes for the joint, and sentences."""
    also, said = {}, []
    values = {
        (slot.kind, slot.index): value for slot, value in zip(parameters.slots, theta, strict=True)
    }
    if ("damping_ratio", 0) in values:
        constant, ratio = model.jnt_solref[joint]
        also["solreflimit"] = f"{constant:.6g} {ratio * np.exp(values['damping_ratio', 0]):.6g}"
    if ("inertia", 0) in values:
        inertia = found.equivalent_inertia * np.exp(values["inertia", 0])
        armature = model.dof_armature[model.jnt_dofadr[joint]] + inertia - found.equivalent_inertia
        unit = "kg·m²" if found.joint.type == "hinge" else "kg"
        said.append(f"Inertia: {found.equivalent_inertia:.4g} → {inertia:.4g} {unit}.")
        if armature >= 0:
            also["armature"] = f"{armature:.6g}"
        else:
            said[-1] = said[-1][:-1] + ", which is less than the bodies have; make them lighter."
    if ("gravity", 0) in values:
        unit_force = gravity_scale(found, parameters.profile)
        a, b = (unit_force * values.get(("gravity", k), 0.0) for k in (0, 1))
        what = f"{a:.4g} cos q + {b:.4g} sin q N·m" if found.joint.type == "hinge" else f"{a:.4g} N"
        said.append(
            f"Gravity's force on the joint lacks {what}; mend the bodies' centre of mass or tilt."
        )
    return also, said


def _history(
    result: "Fit",
    errors: tuple[float, float],
    noise: float,
    checked: tuple[float, float] | None,
    hidden: dict[str, tuple[tuple[float, float], ...]],
) -> str:
    content = {
        "rmse_before": errors[0],
        "rmse_after": errors[1],
        "noise_floor": noise,
        "held_out": checked,
        "unseen": hidden,
        "iterations": [{"stage": stage, "rmse": rms} for stage, rms in result.history],
        "interrupted": result.interrupted,
    }
    return json.dumps(content, indent=2) + "\n"


def _picture(
    before: Profile,
    after: Profile,
    gravity: tuple[Array, Array],
    problem: "Problem",
    result: "Fit",
    hidden: dict[str, tuple[tuple[float, float], ...]],
) -> "Figure":
    """Channels before and after, grey where the data told little; runs before and after."""
    from matplotlib.figure import Figure

    runs = problem.runs[:RUNS]
    with house_style():
        figure = Figure(figsize=(12, 7), dpi=120, layout="constrained")
        left, right = figure.subfigures(1, 2, squeeze=False)[0]
        panels = left.subplots(3, 1, sharex=True, height_ratios=[2, 1, 1])
        draw_channels(panels, before, after, gravity)
        lo, hi = after.joint.range
        for axes, name in zip(panels, CHANNELS, strict=True):
            for k, (a, b) in enumerate(hidden.get(name, ())):
                label = "not seen by the data" if k == 0 else None
                span = (lo + a * (hi - lo), lo + b * (hi - lo))
                axes.axvspan(*span, color="#dddddd", lw=0, zorder=-1, label=label)
        panels[0].legend(frameon=False, fontsize=8, ncols=2)
        panels[-1].set_xlabel(f"joint position ({after.joint.unit})")
        plots = np.atleast_1d(right.subplots(len(runs), 1, sharex=True))
        was, now = (problem.paths(theta) for theta in (problem.parameters.start, result.theta))
        for axes, (time, measured), old, new in zip(plots, runs, was, now, strict=False):
            axes.plot(time, measured, ".", color="#444444", ms=2.5, label="measured")
            axes.plot(time, old, "--", color="#888888", lw=1.6, label="before")
            axes.plot(time, new, color=COLOURS["conservative"], lw=1.6, label="after")
            axes.set_ylabel(f"position ({after.joint.unit})")
            axes.spines[["top", "right"]].set_visible(False)
        plots[0].legend(frameon=False, fontsize=8, ncols=3)
        plots[-1].set_xlabel("time (s)")
        left.suptitle(f"{after.joint.name}: profile", x=0.02, ha="left", parse_math=False)
        right.suptitle("measured runs", x=0.02, ha="left")
        return figure
