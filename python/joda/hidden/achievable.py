"""What the true joint itself misses of measured runs: no model can be much better."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Array
from joda.hidden.measuring import Encoder, spoil
from joda.hidden.simulator import Tape, simulate
from joda.hidden.truth import Truth
from joda.measured.runs import Run

DRAWS = 8
"""Of the noise."""
BEGIN = 0.1
"""Longest begin of a run that tells its start, s."""
MIN_SAMPLES = 8
"""Fewest samples of it."""
CLOSE = 1.2
"""RMS distance of the samples from a parabola, standard deviations, up to which it fits."""


@dataclass(frozen=True)
class Achievable:
    """RMS errors (rad or m) of whole runs, over draws of the noise.

    Attributes:
        runs: of each.
        together: of all samples of all runs.
    """

    runs: tuple[float, ...]
    together: float


def achievable(
    truth: Truth, clean: Sequence[Run], encoder: Encoder, h: float, clock: Array
) -> Achievable:
    """Replays the true joint in steps of h (s), from noisy starts and under the measured force.

    Args:
        truth: the joint.
        clean: its runs without noise.
        encoder: what made the noise.
        h: length of a step; samples lie on steps.
        clock: time at the beginning of each run, s.
    """
    rng = np.random.default_rng(0)
    runs = [spoil(rng, run, encoder) for run in clean for _ in range(DRAWS)]
    at = [np.rint(run.time / h).astype(int) for run in runs]
    t = h * np.arange(max(samples[-1] for samples in at) + 1)
    starts = np.array([_start(run, encoder.sigma) for run in runs])
    trace = simulate(
        truth,
        Tape(np.array([np.interp(t, run.time, run.force) for run in runs]).T),
        starts[:, 0],
        starts[:, 1],
        len(t) - 1,
        h,
        np.repeat(clock, DRAWS),
    )
    squares = [
        np.square(trace.position[samples, lane] - run.position)
        for lane, (run, samples) in enumerate(zip(runs, at, strict=True))
    ]
    by_run = [np.concatenate(squares[k : k + DRAWS]) for k in range(0, len(runs), DRAWS)]
    return Achievable(
        tuple(float(np.sqrt(np.mean(one))) for one in by_run),
        float(np.sqrt(np.mean(np.concatenate(by_run)))),
    )


def _start(run: Run, sigma: float) -> tuple[float, float]:
    """Position and velocity by a parabola over the longest begin of a run that it fits."""
    count = max(int(np.searchsorted(run.time, BEGIN, side="right")), MIN_SAMPLES)
    while True:
        time, position = run.time[:count], run.position[:count]
        parabola = np.polyfit(time, position, 2)
        misfit = np.sqrt(np.mean(np.square(np.polyval(parabola, time) - position)))
        if misfit <= CLOSE * sigma or count == MIN_SAMPLES:
            return float(parabola[2]), float(parabola[1])
        count = max(3 * count // 4, MIN_SAMPLES)
