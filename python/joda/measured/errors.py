"""All measured runs replayed, whole and in segments: how far a model is off."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from joda.measured.measured_joint import Measured
from joda.measured.misfit import joined, rms
from joda.measured.replay import Segment
from joda.measured.runs import CLEAR, Run, arrival

Array = NDArray[np.float64]

ASTRAY = 1e9
"""Error, in units of the noise, of a simulation that is not finite."""
MULTIPLE = 3.0
"""Largest RMS error of a whole run or of a segment that an all-clear allows, in units of the
noise."""
EXPLAINED = 3.0
"""So many times what errors of the measured start and force make may be these errors' still."""


@dataclass(frozen=True)
class RunError:
    """Errors of one run, rad or m.

    Attributes:
        file: its name.
        rmse: of an open-loop replay of the whole run from its measured start; None if it could not
            be replayed.
        rmse_window: of segments of 0.4 s from fresh measured starts; None likewise.
        noise_floor: the measurement's noise: no model gets below it.
        reason: why something could not be replayed; None if all was.
        rmse_explained: how far errors of the measured start and force alone move the whole run's
            replay, by an ensemble of starts; None where that was not asked for.
    """

    file: str
    rmse: float | None
    rmse_window: float | None
    noise_floor: float
    reason: str | None = None
    rmse_explained: float | None = None


@dataclass(frozen=True)
class Missed:
    """How much a whole run, or a segment of it, is missed by.

    Attributes:
        file: of the run.
        multiple: RMS error in units of the run's noise; `ASTRAY` if the simulation went astray.
        explained: what errors of the measured start and force alone make of it, in the same units.
        time: of the segment, s from and to; None for the whole run.
    """

    file: str
    multiple: float
    explained: float = 0.0
    time: tuple[float, float] | None = None

    @property
    def fault(self) -> bool:
        """Whether it is missed by more than the measurement's own errors make."""
        return self.multiple >= MULTIPLE and self.multiple > EXPLAINED * self.explained

    @property
    def order(self) -> tuple[bool, float]:
        """What is the model's fault counts more than what is missed by more."""
        return self.fault, self.multiple


@dataclass(frozen=True)
class Errors:
    """What came of the replays; errors in rad or m, NaN where there is nothing to tell.

    Attributes:
        paths: the model's positions at each run's times, rad or m.
        runs: by run.
        missed: every whole run and every segment that was replayed.
        whole, window, noise: of all runs together, as those of a `RunError`.
    """

    paths: tuple[Array, ...]
    runs: tuple[RunError, ...]
    missed: tuple[Missed, ...]
    whole: float
    window: float
    noise: float


def errors(
    measured: Measured,
    *,
    windows: bool = True,
    explained: bool = False,
    within: bool = False,
    begin: Callable[[str], None] = lambda name: None,
) -> Errors:
    """Replays all runs in MuJoCo with the plugin.

    Args:
        measured: the runs, and the model.
        windows: whether the errors of segments, which take longer, are wanted.
        explained: whether what errors of start and force make of whole runs is, which takes longer
            still; else it is 0.
        within: whether a position beyond an end of the range counts as at it: how deep a joint
            presses into a stop is no law of the joint's.
        begin: told the name of each run before its replay.
    """
    bounds = measured.profile.joint.range if within else (-np.inf, np.inf)

    def misfits(path: Array, position: Array) -> Array:
        return np.clip(path, *bounds) - np.clip(position, *bounds)

    paths, rows, missed = [], [], []
    off, left = [np.zeros(0)], [np.zeros(0)]
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        begin(run.name)
        start = measured.replayer.start(run, sigma)
        paths.append(measured.replayer.whole(run, start))
        misfit = misfits(paths[-1], run.position)
        off.append(misfit[~np.isnan(paths[-1])])
        pieces = measured.replayer.segments(run, sigma) if windows else []
        if within:
            there = [run.position[piece.samples] for piece in pieces]
            pieces = [
                replace(piece, misfit=misfits(own + piece.misfit, own))
                for piece, own in zip(pieces, there, strict=True)
            ]
        left.append(joined(pieces))
        whole = rms(off[-1])
        scatter = measured.replayer.scatter(run, start) if explained and start else None
        if len(off[-1]):
            missed.append(Missed(run.name, _multiple(whole, sigma), (scatter or 0.0) / sigma))
        missed += [_missed(run, sigma, piece) for piece in pieces]
        reason = _reason(run, whole, pieces) if windows else None
        rows.append(RunError(run.name, known(whole), known(rms(left[-1])), sigma, reason, scatter))
    return Errors(
        paths=tuple(paths),
        runs=tuple(rows),
        missed=tuple(missed),
        whole=rms(np.concatenate(off)),
        window=rms(np.concatenate(left)),
        noise=rms(np.array(measured.sigma)),
    )


def worst_missed(measured: Measured) -> Missed | None:
    """The whole run that is missed by most, those first that are the model's fault; None where
    nothing is replayed."""
    missed = errors(measured, windows=False, explained=True).missed
    return max(missed, key=lambda one: one.order, default=None)


def until_an_end(measured: Measured, found: Errors) -> Array:
    """How much whole runs are missed by until they come to an end of the range (the first samples
    of a run that begins there count), in units of the noise, shape (r,); fewer where a run has no
    such samples."""
    out = []
    for run, sigma, path in zip(measured.runs, measured.sigma, found.paths, strict=True):
        before = slice(arrival(run, measured.profile.joint.range, CLEAR * sigma))
        misfit = (path - run.position)[before]
        if len(misfit := misfit[~np.isnan(misfit)]):
            out.append(_multiple(rms(misfit), sigma))
    return np.array(out)


def _multiple(error: float, sigma: float) -> float:
    return min(error / sigma, ASTRAY) if np.isfinite(error) else ASTRAY


def _missed(run: Run, sigma: float, segment: Segment) -> Missed:
    first, last = run.time[segment.samples[[0, -1]]]
    multiple = _multiple(rms(segment.misfit), sigma)
    return Missed(run.name, multiple, segment.explained / sigma, (float(first), float(last)))


def known(error: float) -> float | None:
    """None for what is not a number: there was nothing to replay."""
    return error if np.isfinite(error) else None


def _reason(run: Run, whole: float, segments: Sequence[Segment]) -> str | None:
    """Why a run could not be replayed, as a clause."""
    if np.isnan(run.force).all():
        return "its force is unknown throughout"
    if not np.isfinite(whole):
        return "its force is unknown from near its beginning, so only segments of it are replayed"
    if not segments:
        known_force = " of known force" if run.forced else ""
        return f"no segment of 0.4 s has enough samples{known_force}"
    return None
