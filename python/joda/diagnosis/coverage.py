"""Whether the measurements cover enough: samples, range, motion, both directions."""

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import usable, windows_for
from joda.measured.reading import Measured

ONE_WAY = 0.97
"""Part of the way, in one direction, from which the joint counts as moved in that one only."""
WINDOWS, MOVES = 4, 8.0
"""Fewest windows with motion that tell anything; and what is motion, in noises."""
SAMPLES = 15
"""Fewest samples of curves that do."""
VISITED = 0.02
"""Least part of the range that must be visited."""


def moved_one_way(measured: Measured) -> bool:
    """Whether the joint was moved in one direction only."""
    forth = back = 0.0
    for gauged in () if measured.runs else measured.curves:
        forth += float(np.sum(gauged.direction > 0))
        back += float(np.sum(gauged.direction < 0))
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        turns = _directed(run.position, 6 * sigma)
        forth, back = forth + turns[0], back + turns[1]
    return max(forth, back) > ONE_WAY * (forth + back)


def _directed(position: NDArray[np.float64], noise: float) -> tuple[float, float]:
    """Ways in positive and in negative direction; what is within the noise is no way."""
    forth = back = 0.0
    at = position[0]
    for q in position[1:]:
        if abs(q - at) > noise:
            forth, back = forth + max(q - at, 0.0), back + max(at - q, 0.0)
            at = q
    return forth, back


def too_little(measured: Measured) -> str:
    """Why a model that misses nothing may lack much, as a sentence; nothing if that is not so."""
    windows = windows_for(measured)
    if not measured.runs:
        told = len(windows.position)
        return f"{told} samples are too few; record {SAMPLES}." if told < SAMPLES else ""
    span = float(np.ptp(measured.profile.joint.range))
    visited = float(np.ptp(windows.position)) / span
    if visited < VISITED:
        return f"The runs visit only {100 * visited:.1g} % of the joint's range."
    own = [windows.position[row[row >= 0]] for row in windows.rows[usable(windows)]]
    moving = sum(bool(np.ptp(position) > MOVES * max(measured.sigma)) for position in own)
    if moving < WINDOWS:
        return (
            f"The joint moves in {moving} windows of {windows.length:.2g} s; {WINDOWS} are needed."
        )
    return ""
