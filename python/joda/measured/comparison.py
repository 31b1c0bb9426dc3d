"""A model against measurements: its errors against the noise, and where it fails."""

from collections.abc import Sequence
from dataclasses import dataclass
from json import dumps
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.measured.curves import CurveError, FailingForce, told
from joda.measured.places import BINS, places
from joda.measured.reading import Measured
from joda.measured.replay import Window
from joda.scenes.contacts import Contact

Array = NDArray[np.float64]
By = Literal["position", "velocity", "direction", "time", "load"]

SHORT = 0.1
"""Length of the windows that tell where a model fails, s."""


@dataclass(frozen=True)
class RunError:
    """Errors of one run, rad or m.

    Attributes:
        file: its name.
        rmse: of an open-loop replay of the whole run from its measured start.
        rmse_window: of windows of 0.4 s from fresh measured starts.
        noise_floor: the measurement's noise: no model gets below it.
    """

    file: str
    rmse: float
    rmse_window: float
    noise_floor: float


@dataclass(frozen=True)
class Failing:
    """Where the model fails.

    Attributes:
        by: what is told apart.
        interval: of it: normalised position, rad/s or m/s, -1 to 0 or 0 to 1 (direction), s, N·m
            or N.
        error: RMS position error of windows of 0.1 s there, rad or m.
        force: mean force that the model has too much there, N·m or N.
        share: of the sum of squared errors beyond the noise, 0 to 1.
        significant: whether noise alone would hardly ever make such an error.
    """

    by: By
    interval: tuple[float, float]
    error: float
    force: float
    share: float
    significant: bool


@dataclass(frozen=True)
class Comparison:
    """A model against measured runs and quasi-static curves.

    Attributes:
        joint: its name.
        unit: of position, rad or m.
        runs: errors by run.
        rmse, rmse_window, noise_floor: of all runs together, rad or m; None without a run.
        failing: where it fails, the largest share first.
        curves: errors by quasi-static curve.
        failing_force: where its quasi-static force fails, the largest share first.
        notes: what is suspicious about the data, a sentence each.
        contacts: of the scene that resist the joint where it was measured.
    """

    joint: str
    unit: str
    runs: tuple[RunError, ...]
    rmse: float | None
    rmse_window: float | None
    noise_floor: float | None
    failing: tuple[Failing, ...]
    curves: tuple[CurveError, ...]
    failing_force: tuple[FailingForce, ...]
    notes: tuple[str, ...]
    contacts: tuple[Contact, ...]

    def to_json(self) -> str:
        """The comparison as JSON."""
        content = {
            "joint": self.joint,
            "unit": self.unit,
            "runs": [vars(run) for run in self.runs],
            **{key: getattr(self, key) for key in ("rmse", "rmse_window", "noise_floor")},
            "failing": [vars(place) for place in self.failing],
            "curves": [vars(curve) for curve in self.curves],
            "failing_force": [vars(place) for place in self.failing_force],
            "notes": list(self.notes),
            "contacts": [vars(contact) for contact in self.contacts],
        }
        return dumps(content, indent=2, ensure_ascii=False) + "\n"


def sentences(comparison: Comparison) -> list[str]:
    """The comparison for a person: how far off, where most."""
    curves = told(comparison.curves, comparison.failing_force)
    return (_of_runs(comparison) if comparison.runs else []) + curves


def _of_runs(comparison: Comparison) -> list[str]:
    unit, floor = comparison.unit, comparison.noise_floor
    out = [
        f"Whole runs are missed by {comparison.rmse:.3g} {unit} RMS, windows of 0.4 s by "
        f"{comparison.rmse_window:.3g} {unit}; the measurement's noise is {floor:.2g} {unit}."
    ]
    if not comparison.failing:
        out.append("Nothing beyond the noise: these runs show no fault of the model.")
    force = "N·m" if unit == "rad" else "N"
    for place in comparison.failing[:6]:
        a, b = place.interval
        where = {
            "position": f"at s = {a:.2f} to {b:.2f}",
            "velocity": f"at {a:.3g} to {b:.3g} {unit}/s",
            "direction": "while moving towards " + ("+q" if b > 0 else "\N{MINUS SIGN}q"),
            "time": f"at {a:.3g} to {b:.3g} s",
            "load": f"under a load of {a:.3g} to {b:.3g} {force}",
        }[place.by]
        much = "much" if place.force > 0 else "little"
        out.append(
            f"By {place.by}: {100 * place.share:.0f} % of the error is {where}, where the model "
            f"pushes {abs(place.force):.2g} {force} too {much} towards +q in the mean."
        )
    return out


def failing(rows: Array) -> list[Failing]:
    """Where windows are missed by more than noise, the largest share first.

    Args:
        rows: of `window_rows`.
    """
    if not len(rows):
        return []
    values, found = rows[:, :5], rows[:, 5:]
    beyond = np.maximum(found[:, 2] - found[:, 1], 0.0)
    out = []
    for column, by in enumerate(("position", "velocity", "direction", "time", "load")):
        out += _by(by, values[:, column], found, beyond)  # type: ignore[arg-type]
    return sorted(out, key=lambda place: (not place.significant, -place.share))


FORCE = 8
"""Column of `_rows`: force too much; the next is its standard deviation."""


def window_rows(measured: Measured) -> Array:
    """A row per window of 0.2 s.

    Columns: normalised position, velocity, direction / 2, time, load; RMS misfit, samples, sum of
    squares in units of the noise, force too much, its standard deviation.
    """
    lo, hi = measured.profile.joint.range
    found = measured.context
    rows = []
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        for window in measured.replayer.windows(run, sigma, SHORT):
            ends = window.samples[[0, -1]]
            middle = run.position[window.samples].mean()
            speed = float(np.diff(run.position[ends])[0] / np.diff(run.time[ends])[0])
            gravity = np.interp(middle, found.positions, found.gravity_force)
            load = run.force[window.samples].mean() + gravity
            place = (middle - lo) / (hi - lo)
            square = np.sum(window.misfit**2) / sigma**2
            row = [place, speed, np.sign(speed) * 0.5, run.time[ends].mean(), load]
            row += [rms(window.misfit), len(window.misfit), square, window.force, window.doubt]
            rows.append(row)
    return np.array(rows).reshape(-1, 10)


def _by(by: By, values: Array, found: Array, beyond: Array) -> list[Failing]:
    """Neighbouring bins of one quantity that fail, as intervals."""
    edges = _edges(by, values)
    if not beyond.sum():
        return []
    out = []
    for interval, inside in places(edges, values, found, apart=by in ("velocity", "load")):
        rows = found[inside]
        out.append(
            Failing(
                by=by,
                interval=interval,
                error=float(np.sqrt(np.average(rows[:, 0] ** 2, weights=rows[:, 1]))),
                force=float(np.average(rows[:, 3], weights=rows[:, 4] ** -2.0)),
                share=float(beyond[inside].sum() / beyond.sum()),
                significant=True,
            )
        )
    return out


def _edges(by: By, values: Array) -> Array:
    """Of the bins: even, and never on both sides of zero where the sign is a direction."""
    if by == "direction":
        return np.array([-1.0, 0.0, 1.0])
    if by == "position":
        return np.linspace(0, 1, BINS + 1)
    lo, hi = float(values.min()), float(values.max()) + 1e-9
    if by == "time" or lo * hi >= 0:
        return np.linspace(lo, hi, BINS + 1)
    below = min(max(round(BINS * lo / (lo - hi)), 1), BINS - 1)
    return np.concatenate([np.linspace(lo, 0, below + 1), np.linspace(0, hi, BINS - below + 1)[1:]])


def joined(windows: Sequence[Window]) -> Array:
    """The misfits of all windows."""
    return np.concatenate([window.misfit for window in windows] or [np.zeros(0)])


def rms(values: Array) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
