"""Sizes of what a model misses."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from joda.measured.replay import Replayer, Segment
from joda.measured.runs import Run

Array = NDArray[np.float64]


def joined(segments: Sequence[Segment]) -> Array:
    """The misfits of all segments."""
    return np.concatenate([segment.misfit for segment in segments] or [np.zeros(0)])


def missed(
    replayer: Replayer, runs: Sequence[Run], sigma: Sequence[float], quickly: bool = False
) -> float:
    """RMS error of runs in segments, rad or m, NaN if there are none; `quickly`: whether the joint
    simulator may stand for MuJoCo."""
    pairs = zip(runs, sigma, strict=True)
    parts = [joined(replayer.segments(run, noise, quickly=quickly)) for run, noise in pairs]
    return rms(np.concatenate(parts))


def missed_whole(replayer: Replayer, runs: Sequence[Run], sigma: Sequence[float]) -> float:
    """RMS error of whole runs, where their force is known; rad or m, NaN if there are none."""
    parts = []
    for run, noise in zip(runs, sigma, strict=True):
        path = replayer.whole(run, replayer.start(run, noise))
        parts.append((path - run.position)[~np.isnan(path)])
    return rms(np.concatenate(parts or [np.zeros(0)]))


def rms(values: Array) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
