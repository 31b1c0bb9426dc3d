"""Measured runs cut into stretches of one length, as arrays that are simulated side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from joda.measured import smoothing
from joda.measured.runs import Run, known

Array = NDArray[np.float64]
Traced = Any
"""A NumPy array outside, JAX's own inside a compiled function."""

LEAST = 4
"""Fewest samples of a stretch."""
SURE = 0.1
"""Share of the velocity's standard deviation that is left where a run begins at rest."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("force", "position", "index", "weight", "mask"),
    meta_fields=(),
)
@dataclass(frozen=True)
class Batch:
    """What stretches are simulated with; filled up to round sizes, so that few are compiled.

    Attributes:
        force: at each step, shape (stretches, steps).
        position: measured, shape (stretches, samples).
        index, weight: of the step before each sample, and how far it is to the next.
        mask: 1 for samples, 0 for filling.
    """

    force: Traced
    position: Traced
    index: Traced
    weight: Traced
    mask: Traced


@dataclass(frozen=True)
class Stretches:
    """Stretches of runs.

    Attributes:
        batch: their samples, with filling.
        start: measured position and velocity at their beginnings, shape (stretches, 2).
        doubt: their standard deviations, shape (stretches, 2).
    """

    batch: Batch
    start: Array
    doubt: Array

    @property
    def real(self) -> NDArray[np.bool_]:
        """Which samples are no filling, shape (stretches, samples)."""
        return np.asarray(self.batch.mask[: len(self.start)] > 0)

    def filled(self, starts: Array) -> Array:
        """Starts for the batch, filling included; shape (filled stretches, 2)."""
        more = len(self.batch.force) - len(starts)
        return np.vstack([starts, np.repeat(starts[-1:], more, axis=0)])


def cut(runs: Sequence[Run], h: float, sigma: float, window: float | None) -> Stretches:
    """Runs, or windows of them.

    Args:
        runs: measured; parts where the force is not known are left out.
        h: timestep, s.
        sigma: noise of the position.
        window: length of the windows, s; None: as long as the runs are.
    """
    rows, starts, doubts = [], [], []
    for run in runs:
        for piece in known(run):
            time, position, force = run.time[piece], run.position[piece], run.force[piece]
            begins = time[:1]
            length = time[-1] - time[0] + h
            if window is not None:
                length = max(round(window / h), 1) * h
                begins = time[0] + length * np.arange(max(int((time[-1] - time[0]) / length), 1))
            begun = smoothing.smooth(time, position, begins, sigma)
            for k, start in enumerate(begins):
                inside = (time >= start - 1e-9) & (time <= start + length + 1e-9)
                if inside.sum() < LEAST:
                    continue
                rows.append(_row(time - start, position, force, inside, h, round(length / h)))
                velocity, doubt = begun.velocity[k], begun.velocity_error[k]
                if k == 0 and smoothing.begins_at_rest(time, position, sigma):
                    velocity, doubt = 0.0, SURE * doubt
                starts.append((begun.position[k], velocity))
                doubts.append((begun.position_error[k], doubt))
    return Stretches(_batch(rows), np.array(starts), np.array(doubts))


Row = tuple[Array, Array, NDArray[np.intp], Array]


def _row(
    time: Array, position: Array, force: Array, inside: NDArray[np.bool_], h: float, steps: int
) -> Row:
    """Force at the steps since the start; positions, and where between the steps they are."""
    place = np.maximum(time[inside] / h, 0.0)
    index = np.clip(np.floor(place + 1e-9), 0, steps - 1).astype(int)
    forced = np.interp(h * np.arange(steps), time, force)
    return forced, position[inside], index, place - index


def _batch(rows: Sequence[Row]) -> Batch:
    count = _size(len(rows))
    steps = _size(max(len(row[0]) for row in rows))
    samples = _size(max(len(row[1]) for row in rows))
    force = np.zeros((count, steps))
    position, weight, mask = (np.zeros((count, samples)) for _ in range(3))
    index = np.zeros((count, samples), int)
    for k, (forced, measured, before, share) in enumerate(rows):
        n = len(measured)
        force[k, : len(forced)] = forced
        position[k, :n], index[k, :n], weight[k, :n], mask[k, :n] = measured, before, share, 1.0
    return Batch(force, position, index, weight, mask)


def _size(number: int) -> int:
    """The number rounded up to a power of two, or to three quarters of one."""
    power = 1 << max(number - 1, 1).bit_length()
    return power * 3 // 4 if number <= power * 3 // 4 else power
