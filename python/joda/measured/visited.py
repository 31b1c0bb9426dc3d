"""Where no run has been: nothing is known there."""

import numpy as np

from joda.measured.measured_joint import Measured
from joda.measured.runs import known

Interval = tuple[float, float]

NARROW = 0.02
"""Parts of the range that are narrower, normalised, are not worth a word."""


def unvisited(measured: Measured) -> tuple[Interval, ...]:
    """Parts of the range where no run with known force has been, in normalised position.

    A joint moves continuously: each run has been everywhere between its extremes.
    """
    lo, hi = measured.profile.joint.range
    parts = [run.position[piece] for run in measured.runs for piece in known(run)]
    parts += [curve.curve.position for curve in measured.curves if not measured.runs]
    ends = sorted(
        tuple(np.clip((np.array([q.min(), q.max()]) - lo) / (hi - lo), 0, 1)) for q in parts
    )
    out, reached = [], 0.0
    for first, last in [*ends, (1.0, 1.0)]:
        if first - reached > NARROW:
            out.append((float(reached), float(first)))
        reached = max(reached, last)
    return tuple(out)


def unvisited_part(measured: Measured, interval: Interval) -> tuple[Interval, ...]:
    """What of an interval no run has visited."""
    a, b = interval
    parts = ((max(a, c), min(b, d)) for c, d in unvisited(measured))
    return tuple((c, d) for c, d in parts if d > c)


def visited_share(measured: Measured, interval: Interval) -> float:
    """Part of an interval that runs have visited, 0 to 1."""
    a, b = interval
    away = sum(d - c for c, d in unvisited_part(measured, interval))
    return 1.0 - away / (b - a) if b > a else 1.0
