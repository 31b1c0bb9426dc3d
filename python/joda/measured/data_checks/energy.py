"""Whether a joint that no force is recorded for moves by itself: then its energy never grows."""

import numpy as np
from numpy.typing import NDArray

from joda.measured import smoothing
from joda.measured.runs import Run

Array = NDArray[np.float64]

LEVELS = 9
"""Positions at which the speeds of all passages are compared."""
EDGE = 0.1
"""Part of the way at either end that is left out, where the joint turns."""
AGREE = 3
"""Least number of levels that a joint passes faster than before."""
FASTER, CLEARLY = 1.25, 6.0
"""How much faster: at the least, and in standard errors."""
PASSAGES = 60
"""Most passages of a level that are looked at."""


def driven(run: Run, position: Array, sigma: float, unit: str) -> str:
    """Compares the speeds at which the joint passes one position again and again.

    What springs, magnets and gravity store depends on the position alone, and all else takes
    energy: a later passage is never the faster one.
    """
    if run.pushed:
        return ""
    lo, hi = float(position.min()), float(position.max())
    grown: list[tuple[float, float, float, float, float]] = []
    for q in np.linspace(lo + EDGE * (hi - lo), hi - EDGE * (hi - lo), LEVELS):
        time = _passages(run.time, position, float(q))[:PASSAGES]
        if len(time) < 2:
            continue
        found = smoothing.smooth(run.time, position, time, sigma)
        speed, error = np.abs(found.velocity), found.velocity_error
        first = np.array([int(np.argmin(speed[: k + 1])) for k in range(len(speed))])
        slowest = speed[first]
        error_of_speed = np.hypot(error, error[first])
        gain = speed - np.maximum(FASTER * slowest, slowest + CLEARLY * error_of_speed)
        k = int(np.argmax(gain))
        if gain[k] > 0:
            i = first[k]
            grown.append((float(gain[k]), float(time[i]), float(time[k]), speed[i], speed[k]))
    if len(grown) < AGREE:
        return ""
    _, before, after, slow, fast = max(grown)
    return (
        f"the joint moves at {fast:.2g} {unit}/s at {after:.3g} s where it moved at {slow:.2g} "
        f"{unit}/s at {before:.3g} s, and no force is recorded: something drove it; record its "
        "force, or cut the run to where the joint moves by itself"
    )


def _passages(time: Array, position: Array, q: float) -> Array:
    """Times at which a position is passed, s."""
    away = position - q
    k = np.flatnonzero(np.sign(away[1:]) * np.sign(away[:-1]) < 0)
    part = away[k] / (away[k] - away[k + 1])
    return np.asarray(time[k] + part * (time[k + 1] - time[k]))
