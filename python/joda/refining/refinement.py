"""What a refinement leaves: its history, its picture, and where the data told little."""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from joda.estimation.least_squares import Fit
from joda.estimation.profile_parameters import Parameters
from joda.field import evaluate
from joda.pictures.changes import draw_channels
from joda.pictures.style import COLOURS, clean, house_style
from joda.profile import CHANNELS, NOUNS, Profile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

NARROW = 0.05
"""Parts of the range that are narrower need no word."""
MUCH = 0.3
"""Part of a channel's largest value by which it has changed by much."""
SEEN = 0.5
"""A part of a curve is seen where the data shrink its uncertainty at least by this factor."""
STEP = 1e-4
RUNS = 4
"""How many runs the picture shows."""
GRID = np.linspace(0, 1, 201)


class Fitted(Protocol):
    """What a joint's parameters were fitted to.

    Attributes:
        axes: over what it was measured, and what was, with their units.
    """

    axes: tuple[str, str]

    @property
    def runs(self) -> Sequence[tuple[Array, Array]]:
        """Of each, over what it was measured, and what was."""
        ...


def unseen(
    profile: Profile,
    parameters: Parameters,
    covariance: Array,
    away: Sequence[tuple[float, float]],
) -> dict[str, tuple[tuple[float, float], ...]]:
    """Per channel, the intervals of normalised position of which the data told little.

    There no run was, or the curve's standard deviation is more than half of what it was before any
    data.

    Args:
        profile: the fitted profile's form.
        parameters: what was fitted.
        covariance: of the fitted numbers.
        away: where no run was.
    """
    prior = np.diag(parameters.prior_std**2)
    out = {}
    slopes = _curve_slopes(parameters)
    nowhere = _within([(a, b) for a, b in away if b - a > NARROW])
    for name in CHANNELS:
        if not getattr(profile.channels, name).components:
            continue
        J = slopes[name]
        left = np.sqrt(np.einsum("gi,ij,gj->g", J, covariance, J))
        begun = np.sqrt(np.einsum("gi,ij,gj->g", J, prior, J))
        hidden = (left > SEEN * begun) | nowhere
        hidden &= begun > 1e-9 * max(begun.max(), 1e-300)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], hidden.astype(int), [0]])))
        pairs = edges.reshape(-1, 2)
        out[name] = tuple((float(GRID[a]), float(GRID[b - 1])) for a, b in pairs if b - a > 2)
    return out


def extrapolated(before: Profile, after: Profile, away: Sequence[tuple[float, float]]) -> list[str]:
    """Where no run was and a fit has changed a channel by much all the same, a sentence each.

    Args:
        before, after: the profiles.
        away: where no run was, in normalised position.
    """
    nowhere = _within(away)
    out: list[str] = []
    if not nowhere.any():
        return out
    where = " and ".join(f"s = {a:.2f} to {b:.2f}" for a, b in away)
    for name in CHANNELS:
        was, now = (evaluate(getattr(one.channels, name), GRID)[0] for one in (before, after))
        change = np.where(nowhere, np.abs(now - was), 0.0)
        if change.max() > MUCH * np.abs(was).max():
            at = int(np.argmax(change))
            out.append(
                f"No run was at {where}: there the {NOUNS[name]} is changed too, at s = "
                f"{GRID[at]:.2f} from {was[at]:.3g} to {now[at]:.3g} "
                f"{before.joint.unit_of(name)}. That only goes on with what changed where runs "
                "were, and may be wrong."
            )
    return out


def _within(parts: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    """Which positions of GRID lie in some parts of the range."""
    inside = np.zeros(len(GRID), bool)
    for c, d in parts:
        inside |= (c <= GRID) & (d >= GRID)
    return inside


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


def history(
    result: Fit,
    errors: tuple[float, float],
    noise: float,
    checked: tuple[float, float] | None,
    hidden: dict[str, tuple[tuple[float, float], ...]],
) -> str:
    """The refinement as JSON: errors, noise, places not seen, the error of every iteration."""
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


def picture(
    before: Profile,
    after: Profile,
    gravity: tuple[Array, Array],
    problem: Fitted,
    paths: tuple[Sequence[Array], Sequence[Array]],
    hidden: dict[str, tuple[tuple[float, float], ...]],
) -> "Figure":
    """Channels before and after, grey where the data told little; runs before and after.

    Args:
        before, after: the profile.
        gravity: positions (rad or m) and the force that balances gravity there.
        problem: what was fitted.
        paths: what the model had, before and after, instead of what was measured.
        hidden: see `unseen`.
    """
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
        over, what = problem.axes
        for axes, (at, measured), old, new in zip(plots, runs, *paths, strict=False):
            axes.plot(at, measured, ".", color="#444444", ms=2.5, label="measured")
            axes.plot(at, old, "--", color="#888888", lw=1.6, label="before")
            axes.plot(at, new, color=COLOURS["conservative"], lw=1.6, label="after")
            axes.set_ylabel(what)
            axes.spines[["top", "right"]].set_visible(False)
        plots[0].legend(frameon=False, fontsize=8, ncols=3)
        plots[-1].set_xlabel(over)
        left.suptitle(f"{clean(after.joint.name)}: profile", x=0.02, ha="left", parse_math=False)
        right.suptitle("measured", x=0.02, ha="left")
        return figure
