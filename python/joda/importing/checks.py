"""What is said of each column: its range against the model's, sign, zero and delay."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda.importing.log import Array
from joda.importing.rows import Rows

EARLIEST, LATEST = -0.2, 1.0
"""How far a position is looked for before and after its command, s."""
SURE = 0.3
"""Correlation of speeds from which on sign and delay are told."""
ALIKE = 0.9
"""Peaks this many times as high as the highest could be meant too."""
SAMPLES = 200_000
"""Most samples of a log that are correlated."""


@dataclass(frozen=True)
class Follows:
    """How a position follows another column: its command, or its own logged velocity.

    Attributes:
        correlation: of the two speeds where it is largest, -1 to 1.
        delay: by which the position is later there, s.
        resolution: of the delay: the usual time between two samples, s.
        offset: median of position minus command, that much later; rad or m.
    """

    correlation: float
    delay: float
    resolution: float
    offset: float

    @property
    def sign(self) -> str:
        """Whether both go the same way."""
        return "same" if self.correlation > 0 else "opposite"


def span(made: Sequence[Rows], target: str) -> tuple[float, float]:
    """The least and largest number of a column in all runs, in the model's units."""
    return (
        min(float(np.nanmin(one.columns[target])) for one in made),
        max(float(np.nanmax(one.columns[target])) for one in made),
    )


def outside(made: Sequence[Rows], target: str, limits: tuple[float, float]) -> tuple[float, float]:
    """The share of a column's samples beyond limits, and how far the farthest is."""
    values = np.concatenate([one.columns[target] for one in made])
    beyond = np.maximum(np.maximum(limits[0] - values, values - limits[1]), 0.0)
    slack = 1e-6 * (limits[1] - limits[0])
    return float(np.mean(beyond > slack)), float(beyond.max())


def follows(made: Sequence[Rows], position: str, command: str, gear: float) -> Follows | None:
    """How a position follows its command: the lag at which their speeds correlate most.

    Both are brought to even times, differentiated, and correlated at lags of whole samples; a
    parabola through the three highest gives the fraction. What is found is the delay of the wire
    and the lag of the servo together.

    Args:
        made: the runs.
        position, command: targets.
        gear: the command's units per unit of position.

    Returns:
        None where one of them does not move, or they have too little in common to tell.
    """
    step = float(np.median(np.concatenate([np.diff(one.time) for one in made])))
    lags = np.arange(round(EARLIEST / step), round(LATEST / step) + 1)
    sums, count = np.zeros((3, len(lags))), 0
    for one in made:
        if count > SAMPLES or one.time[-1] / step > SAMPLES:
            break
        even = np.arange(0.0, one.time[-1], step)
        count += len(even)
        moved = np.diff(np.interp(even, one.time, one.columns[position]))
        told = np.diff(np.interp(even, one.time, one.columns[command] / gear))
        for k, lag in enumerate(lags):
            a = told[: len(told) - lag] if lag >= 0 else told[-lag:]
            b = moved[lag:] if lag >= 0 else moved[: len(moved) + lag]
            n = min(len(a), len(b))
            if n > 2:
                sums[:, k] += a[:n] @ b[:n], a[:n] @ a[:n], b[:n] @ b[:n]
    product, first, second = sums
    size = np.sqrt(first * second)
    correlation = np.divide(product, size, out=np.zeros(len(lags)), where=size > 0)
    peak = _peak(correlation, lags)
    if abs(correlation[peak]) < SURE:
        return None
    delay = step * (lags[peak] + _fraction(np.abs(correlation), peak))
    return Follows(
        correlation=float(correlation[peak]),
        delay=float(delay),
        resolution=step,
        offset=_offset(made, position, command, gear, float(delay)),
    )


def _peak(correlation: Array, lags: NDArray[np.intp]) -> int:
    """The index of the lag that is meant.

    A repeating command fits again a period later, and half a period later the other way: so of
    peaks that are nearly as high a positive one is taken, and of those the earliest that is no
    earlier than the command.
    """
    side = 1.0 if correlation.max() >= ALIKE * -correlation.min() else -1.0
    heights = np.pad(side * correlation, 1, constant_values=-np.inf)
    inner = heights[1:-1]
    peaks = (inner >= heights[:-2]) & (inner >= heights[2:]) & (inner >= ALIKE * inner.max())
    return min(np.flatnonzero(peaks).tolist(), key=lambda k: (lags[k] < 0, abs(lags[k])))


def _fraction(heights: Array, peak: int) -> float:
    """Where the top of a parabola through a peak and its neighbours is, -0.5 to 0.5."""
    if not 0 < peak < len(heights) - 1:
        return 0.0
    left, top, right = heights[peak - 1 : peak + 2]
    bend = left - 2 * top + right
    return float(np.clip(0.5 * (left - right) / bend, -0.5, 0.5)) if bend < 0 else 0.0


def _offset(made: Sequence[Rows], position: str, command: str, gear: float, delay: float) -> float:
    differences = []
    for one in made:
        at = np.searchsorted(one.time, one.time - delay, "right") - 1
        good = at >= 0
        told = one.columns[command][np.maximum(at, 0)] / gear
        differences.append((one.columns[position] - told)[good])
    return float(np.median(np.concatenate(differences)))


def velocity_fits(made: Sequence[Rows], position: str, velocity: str) -> tuple[float, float] | None:
    """Correlation of a logged velocity with the differentiated position, and their ratio.

    Returns:
        None where nothing moves, or they have too little in common to tell.
    """
    logged = np.concatenate([one.columns[velocity] for one in made])
    moved = np.concatenate([np.gradient(one.columns[position], one.time) for one in made])
    size = float(np.sqrt((logged @ logged) * (moved @ moved)))
    if not size or abs(logged @ moved) < SURE * size:
        return None
    return float(logged @ moved) / size, float((logged @ moved) / (moved @ moved))
