"""Whether the times of a run can be seconds of one clock."""

import numpy as np
from numpy.typing import NDArray

from joda.measured.data_checks.timing import longest
from joda.measured.runs import Run
from joda.scenes.context import Context

Array = NDArray[np.float64]

CLOSEST, FARTHEST = 1e-5, 0.5
"""Between two samples, s: no encoder is read more often, and nothing is seen of a joint's dynamics
more seldom."""
MICRO, NANO = 200.0, 2e5
"""Steps from which on a time that cannot be seconds is rather in microseconds, or nanoseconds."""
SLOWEST = 300.0
"""Longest time for the whole range at a joint's highest speed, s."""
MOVED = 0.1
"""Part of the range that a joint must have moved for its speed to tell anything."""
PARTS = 50
"""Parts of a run over which speed is told."""


def wrong_clock(run: Run) -> str:
    """Speaks where the times cannot be seconds, or are those of two clocks."""
    intervals = np.diff(run.time)
    usual = float(np.median(intervals))
    if usual > FARTHEST:
        if usual == 1 and np.all(intervals == np.round(intervals)):
            mostly = "" if np.all(intervals == 1) else "mostly "
            return (
                f"{_from_to(run)} {mostly}in steps of 1, as if it counted samples or frames; "
                "divide it by the sampling rate in Hz"
            )
        return (
            f"{_from_to(run)} in steps of {usual:.4g}: too far apart for seconds, as nothing would "
            f"be seen of how a joint moves; it looks like {_unit(usual)}, or record at 30 Hz or "
            "more"
        )
    if usual < CLOSEST:
        return (
            f"{_from_to(run)} in steps of {usual:.2g} s, closer than any encoder is read; it must "
            "be in seconds, so if these are hours multiply it by 3600"
        )
    gaps = np.flatnonzero(intervals > longest(intervals))
    if intervals[gaps].sum() > np.ptp(run.time) / 2:
        worst = gaps[np.argmax(intervals[gaps])]
        return (
            f"most of its time has no samples: after {run.time[worst]:.6g} s there is none for "
            f"{intervals[worst]:.4g} s, where {1e3 * usual:.3g} ms is usual, as if two recordings "
            "or two clocks were joined; cut the file there into two"
        )
    return ""


def too_slow(run: Run, position: Array, context: Context) -> str:
    """Speaks where the joint is slower than one that is moved by anybody or anything."""
    lo, hi = context.joint.range
    if np.ptp(position) < MOVED * (hi - lo):
        return ""
    m = max(len(position) // PARTS, 1)
    speed = np.abs(position[m:] - position[:-m]) / (run.time[m:] - run.time[:-m])
    whole = (hi - lo) / float(speed.max())
    if whole < SLOWEST:
        return ""
    usual = float(np.median(np.diff(run.time)))
    return (
        f"{_from_to(run)} in steps of {usual:.4g}: as seconds, the joint would take {whole:.3g} s "
        "for its range at its fastest; it looks like milliseconds, divide it by 1000"
    )


def _from_to(run: Run) -> str:
    first, last = (run.origin + t for t in run.time[[0, -1]])
    return f"time goes from {first:.10g} to {last:.10g}"


def _unit(step: float) -> str:
    """The likely unit of a time with these steps, and what to do."""
    units = {"milli": 1e3, "micro": 1e6, "nano": 1e9}
    unit = "milli" if step < MICRO else "micro" if step < NANO else "nano"
    return f"{unit}seconds, divide it by {units[unit]:.0f}"
