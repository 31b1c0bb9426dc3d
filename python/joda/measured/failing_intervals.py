"""Where a model fails: segments sorted by position, velocity, direction, time and load."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.measured import smoothing
from joda.measured.measured_joint import Measured
from joda.measured.misfit import rms
from joda.measured.replay import Segment
from joda.measured.runs import STOP, Run
from joda.measured.significant_bins import BINS, significant_intervals

Array = NDArray[np.float64]
By = Literal["position", "velocity", "direction", "time", "load"]

LENGTHS = (0.1, 0.4, 1.6)
"""Segments that tell where a model fails, s: longer ones where shorter ones show nothing, as a
small force needs time to move a joint."""
PIECES = 40
"""Of a whole run's replay, where no segment shows what its end does."""
LONGEST = 10.0
"""Of a run whose mean residual force is told from its start, s."""
MIN_NOISES = 3.0
"""Error, in units of the noise and of what errors of start and force make, up to which they are
not enough to blame the model."""
SLIGHT = 0.01
"""Mean residual force of a whole run, in units of what acts on it, that is none."""
SPEED_ERRORS = 2.0
"""Standard errors from which on the direction of a segment's motion is known."""
FORCE_ERRORS = 3.0
"""Standard deviations from which on a mean residual force is not 0."""
MIN_SIGN_SHARE = 0.8
"""Part of the evidence that must have the sign of the mean force for that force to be told."""
FORCE = 8
"""Column of the rows: residual force; the next is its standard deviation."""
COLUMNS = 13
IMPACT = 12
"""Column of the rows: whether the joint is at an end of its range in the segment."""
MIN_IMPACT_SHARE = 0.8
"""Part of what is beyond the noise at ends from which speed, direction, time and load are told by
other segments alone: an impact has all of these, but by its place."""
MIN_EXPLAINED = 0.5
"""Part of what is beyond the noise that a mean force must explain to be told."""


@dataclass(frozen=True)
class Failing:
    """Where the model fails.

    Attributes:
        by: what is told apart.
        interval: of it: normalised position, rad/s or m/s, -1 to 0 or 0 to 1 (direction), s, N·m
            or N.
        error: RMS position error of segments there, rad or m.
        force: mean residual force (model's less the true one) there, N·m or N; None where it
            changes its sign there, or cannot be told from 0.
        share: of the sum of squared errors beyond the noise, 0 to 1.
        significant: whether noise alone would hardly ever make such an error.
    """

    by: By
    interval: tuple[float, float]
    error: float
    force: float | None
    share: float
    significant: bool


def where(
    measured: Measured, paths: Sequence[Array], short: Array, beyond: bool
) -> tuple[list[Failing], float]:
    """Where the model fails, by the shortest segments that show it.

    Args:
        measured: the joint and its runs.
        paths: the model's positions at each run's times.
        short: rows of the shortest segments.
        beyond: whether the model is beyond the noise: then longer segments and whole runs are
            searched where these show nothing.

    Returns:
        intervals, the largest share first; and the length of the segments that told, s, 0 for
        pieces of whole runs.
    """
    found = failing_intervals(short)
    if found or not beyond:
        return found, LENGTHS[0]
    for length in LENGTHS[1:]:
        if found := _clearly(measured, failing_intervals(window_rows(measured, length))):
            return found, length
    return _clearly(measured, failing_intervals(_whole_rows(measured, paths))), 0.0


def _clearly(measured: Measured, found: Sequence[Failing]) -> list[Failing]:
    """What is missed by several noises: in longer segments small errors of all kinds pile up."""
    least = MIN_NOISES * measured.floor
    return [place for place in found if place.error > least]


def failing_intervals(rows: Array) -> list[Failing]:
    """Where segments are missed by more than noise, the largest share first.

    Args:
        rows: of `window_rows`.
    """
    if not len(rows):
        return []
    values, found = rows[:, :5], rows[:, 5:]
    beyond = np.maximum(found[:, 2] - found[:, 1], 0.0)
    rest = np.ones(len(rows), bool)
    impacts = rows[:, IMPACT] > 0
    if beyond[impacts].sum() > MIN_IMPACT_SHARE * beyond.sum():
        rest = ~impacts
    out = _by("position", values[:, 0], found, beyond)
    others: tuple[By, ...] = ("velocity", "direction", "time", "load")
    for column, by in enumerate(others, 1):
        for place in _by(by, values[rest, column], found[rest], beyond[rest]):
            share = place.share * float(beyond[rest].sum() / beyond.sum())
            out.append(replace(place, share=share))
    return sorted(out, key=lambda place: (not place.significant, -place.share))


def window_rows(measured: Measured, length: float = LENGTHS[0]) -> Array:
    """A row per segment; slow sampling makes segments longer.

    Columns: normalised position, velocity, direction / 2, time, load; RMS misfit, samples, sum of
    squares in units of the noise (the position's, and what the force's makes of it), residual
    force, its standard deviation, sums of squares from the best start without and with that force;
    whether the joint is at an end of its range.
    """
    rows = []
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        least = (smoothing.MIN_SAMPLES + 1) * float(np.median(np.diff(run.time)))
        segments = measured.replayer.segments(run, sigma, max(length, least))
        rows += [
            [*_row(measured, run, sigma, segment), float(_at_end(measured, run, sigma, segment))]
            for segment in segments
            if _tells(segment, sigma)
        ]
    return np.array(rows).reshape(-1, COLUMNS)


def _tells(segment: Segment, sigma: float) -> bool:
    """Whether its misfit is more than errors of its start and force can make, or near the noise."""
    error = rms(segment.misfit)
    return error < MIN_NOISES * sigma or error > MIN_NOISES * segment.explained


def _whole_rows(measured: Measured, paths: Sequence[Array]) -> Array:
    """The same of pieces of whole runs, with the whole run's force, NaN if that is long, and each
    its part of what that force explains; none is an impact, which is not what is missed there."""
    rows = []
    for run, sigma, path in zip(measured.runs, measured.sigma, paths, strict=True):
        there = np.flatnonzero(~np.isnan(path))
        duration = float(np.ptp(run.time))
        force = force_error = float("nan")
        squares = np.zeros(2)
        if duration <= LONGEST and len(there) == len(run.time):
            whole = measured.replayer.segments(run, sigma, duration)
            if len(whole) == 1:
                force, force_error = whole[0].force, whole[0].force_error
                squares = np.array(whole[0].squares)
            if abs(force) < max(MIN_NOISES * force_error, SLIGHT * _usual_force(measured, run)):
                continue  # it drifts, but no force on the whole makes it
        off = measured.replayer.scatter(run, measured.replayer.start(run, sigma))
        for samples in np.array_split(there, PIECES):
            if len(samples) > 1:
                misfit = path[samples] - run.position[samples]
                part = squares * len(samples) / len(there)
                piece = Segment(
                    samples, misfit, force, force_error, pushed=off, squares=tuple(part)
                )
                rows.append([*_row(measured, run, sigma, piece), 0.0])
    return np.array(rows).reshape(-1, COLUMNS)


def _usual_force(measured: Measured, run: Run) -> float:
    """RMS of what acts on the joint in a run, by load or, where there is none, by its speed."""
    load = float(np.sqrt(np.mean(measured.load(run) ** 2)))
    pace = float(np.ptp(run.position)) / float(np.ptp(run.time)) ** 2
    return max(load, measured.joint_model.inertia * pace)


def _row(measured: Measured, run: Run, sigma: float, segment: Segment) -> list[float]:
    lo, hi = measured.profile.joint.range
    ends = segment.samples[[0, -1]]
    middle = float(run.position[segment.samples].mean())
    speed, speed_error = _speed(run.time[segment.samples], run.position[segment.samples], sigma)
    direction = 0.5 * float(np.sign(speed)) if abs(speed) > SPEED_ERRORS * speed_error else 0.0
    load = float(measured.load(run.part(segment.samples)).mean())
    square = float(np.sum(segment.misfit**2) / (sigma**2 + segment.pushed**2))
    place = (middle - lo) / (hi - lo)
    row = [place, speed, direction, float(run.time[ends].mean()), load]
    size = rms(segment.misfit), len(segment.misfit), square
    return [*row, *size, segment.force, segment.force_error, *segment.squares]


def _speed(time: Array, position: Array, sigma: float) -> tuple[float, float]:
    """Of a line through a segment's positions, and its standard error."""
    away = time - time.mean()
    spread = float(away @ away)
    return float(away @ position) / spread, sigma / spread**0.5


def _at_end(measured: Measured, run: Run, sigma: float, segment: Segment) -> bool:
    """Whether the joint is at an end of its range in a segment."""
    lo, hi = measured.profile.joint.range
    s, noise = (run.position[segment.samples] - lo) / (hi - lo), sigma / (hi - lo)
    reach = STOP + MIN_NOISES * noise
    return bool((s < reach).any() or (s > 1 - reach).any())


def _by(by: By, values: Array, found: Array, beyond: Array) -> list[Failing]:
    """Neighbouring bins of one quantity that fail, as intervals."""
    if not beyond.sum() or (by not in ("direction", "time") and np.ptp(values) == 0):
        return []
    out = []
    for interval, inside in significant_intervals(
        _edges(by, values), values, found, apart=by in ("velocity", "load", "direction")
    ):
        rows = found[inside]
        force = _force(rows[:, 3], rows[:, 4])
        share = float(beyond[inside].sum() / beyond.sum())
        if by == "direction" and force is None:
            continue  # what changes its sign within a direction is not the direction's
        out.append(
            Failing(
                by=by,
                interval=interval,
                error=float(np.sqrt(np.average(rows[:, 0] ** 2, weights=rows[:, 1]))),
                force=None if _uneven(rows) else force,
                share=share,
                significant=True,
            )
        )
    return out


def _uneven(rows: Array) -> bool:
    """Whether a force that does not change explains hardly any of what is beyond the noise."""
    count = float(rows[:, 1].sum())
    without, with_force = (float(rows[:, k].sum()) - count for k in (5, 6))
    return without > FORCE_ERRORS * (2 * count) ** 0.5 and with_force > MIN_EXPLAINED * without


def _force(force: Array, force_error: Array) -> float | None:
    """Mean residual force, weighted by how well it is known; None if it may be 0.

    Most of the evidence has its sign, and it is several standard deviations of the mean.
    """
    known = np.isfinite(force) & np.isfinite(force_error) & (force_error > 0)
    if not known.any():
        return None
    force, least = force[known], force_error[known].min()
    weight = (force_error[known] / least) ** -2.0
    mean = float(np.average(force, weights=weight))
    evidence = weight * np.abs(force)
    alike = float(evidence[np.sign(force) == np.sign(mean)].sum())
    clear = abs(mean) >= FORCE_ERRORS * least / np.sqrt(float(weight.sum()))
    return mean if clear and alike >= MIN_SIGN_SHARE * float(evidence.sum()) else None


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
