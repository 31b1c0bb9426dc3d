"""Whether a measured velocity is that of the measured position."""

import numpy as np
from numpy.typing import NDArray

from joda.measured.data_checks.timing import longest
from joda.measured.runs import Run

Array = NDArray[np.float64]

UNITS = {
    1 / 60: "if time were in minutes",
    1e-3: "if time were in milliseconds",
    2 * np.pi: "if positions were in turns",
    np.pi / 180: "if positions were in degrees",
    180 / np.pi: "if the velocity were in degrees per second",
    30 / np.pi: "if the velocity were in turns per minute",
    1 / (2 * np.pi): "if the velocity were in turns per second",
}
"""What makes a velocity so many times the position's derivative."""
NEARLY = 0.02
"""How near to such a factor it must be, as a part of it."""
TRIED = 0.2
"""Longest delay of a velocity that is looked for, s."""


def wrong_velocity(run: Run, position: Array, unit: str) -> str:
    """Compares the position with the velocity's integral, as nothing is differentiated then."""
    if run.velocity is None:
        return ""
    time, velocity = run.time, run.velocity
    intervals = np.diff(time)
    moves = (velocity[1:] + velocity[:-1]) / 2 * intervals
    moves = np.where(intervals > longest(intervals), np.diff(position), moves)
    path = np.append(0, np.cumsum(moves))
    most = min(TRIED, (time[-1] - time[0]) / 5)
    some = np.flatnonzero((time >= time[0] + most) & (time <= time[-1] - most))
    if len(some) < 10 or np.ptp(position[some]) < 0.5 * np.ptp(position):
        some = np.arange(len(time))  # it moved at the very beginning or end
    some = some[:: max(len(some) // 1000, 1)]
    delays = np.linspace(-most, most, 81)
    paths = np.interp(time[some] + delays[:, None], time, path)
    paths -= paths.mean(axis=1, keepdims=True)
    q = position[some] - position[some].mean()
    factors = paths @ q / np.maximum((paths**2).sum(axis=1), 1e-300)
    errors = np.sqrt(((q - factors[:, None] * paths) ** 2).mean(axis=1))
    best, none = int(np.argmin(errors)), len(delays) // 2
    clear = errors[none] > max(3 * errors[best], 5e-3 * np.ptp(position))
    late = clear and abs(delays[best]) > max(0.01, 2.5 * np.median(intervals))
    k = best if late else none
    if errors[k] > 0.25 * q.std():
        what = "is not the derivative of the position"
    elif abs(factors[k] - 1) > 0.15 and (likely := _unit(1 / factors[k])):
        return (
            f"the velocity is {1 / factors[k]:.3g} times the derivative of the position, in "
            f"{unit}/s, as {likely}; correct whichever it is"
        )
    elif abs(factors[k] - 1) > 0.15:
        what = f"is {1 / factors[k]:.3g} times the derivative of the position, in {unit}/s"
    elif late:
        what = f"is {'late' if delays[k] > 0 else 'early'} by {1e3 * abs(delays[k]):.0f} ms"
    else:
        return ""
    return f"the velocity {what}; correct it, or leave the column out"


def _unit(times: float) -> str:
    """The likely cause of a velocity that is so many times the derivative; empty if none is."""
    near = (told for factor, told in UNITS.items() if abs(times / factor - 1) < NEARLY)
    return next(near, "")
