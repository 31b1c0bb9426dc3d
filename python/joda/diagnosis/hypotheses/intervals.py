"""Where a template may act: an interval of the range, as numbers that are fitted."""

import numpy as np

from joda.component import Component
from joda.diagnosis.hypotheses.base import Array, Bounds
from joda.diagnosis.settings import SETTINGS
from joda.field import evaluate
from joda.profile import Channel

WIDTHS = (0.08, 0.13, 0.2, 0.3, 0.42, 0.6)
"""Of the intervals that are tried, in normalised position."""
NARROWEST, AT_STOP = 0.02, 0.01
"""Interval; and how near an end of the range it ends at that."""
GRID = 401
"""Points on which that is looked for."""
END = (0.0, 1.0, 0.004)
"""Bounds and step of an end of an interval."""


def ends(place: str, x: Array) -> tuple[float, float]:
    """The interval within the range, of which the last numbers are the ends; a rough trial's may be
    outside. One that ends at rest at a stop, of which no run tells, ends there."""
    a, b = _ends(place, x)
    return 0.0 if a < AT_STOP else a, 1.0 if b > 1 - AT_STOP else b


def _ends(place: str, x: Array) -> tuple[float, float]:
    if place == "whole":
        return 0.0, 1.0
    if place == "low":
        return 0.0, min(max(float(x[-1]), NARROWEST), 1.0)
    if place == "high":
        return max(min(float(x[-1]), 1.0 - NARROWEST), 0.0), 1.0
    a, b = sorted((float(x[-2]), float(x[-1])))
    a = min(max(a, 0.0), 1.0 - NARROWEST)
    return a, min(max(b, a + NARROWEST), 1.0)


def places(place: str, widest: float = 1.0) -> tuple[Bounds, list[tuple[float, ...]]]:
    """Bounds and steps of the numbers of an interval, and values to try."""
    widths = [w for w in (*WIDTHS, 0.8) if w <= widest]
    if place == "whole":
        return [], [()]
    if place == "low":
        return [(NARROWEST, widest, 0.004)], [(w,) for w in widths]
    if place == "high":
        return [(1 - widest, 1 - NARROWEST, 0.004)], [(1 - w,) for w in widths]
    if place == "most":
        return [END, END], [(0.04, 0.96), (0.0, 0.92), (0.08, 1.0)]
    begins = [(float(a), w) for w in WIDTHS for a in np.arange(0, 1 - w + 1e-9, w / 3)]
    return [END, END], [(a, a + w) for a, w in begins]


def felt(
    part: Component, level: float = SETTINGS.naming.felt_force, to_ends: bool = True
) -> tuple[float, float]:
    """Where a curve is at least so large a part of its largest value, in normalised position.

    Args:
        part: the curve.
        level: the part of its largest value.
        to_ends: whether an end of the range that is one of the curve's interval stays one.
    """
    a, b = part.interval
    grid = np.linspace(a, b, GRID)
    value = np.abs(evaluate(Channel(components=(part,)), grid)[0])
    there = grid[value >= level * value.max()]
    low, high = float(there[0]), float(there[-1])
    return a if to_ends and a <= 0.0 else low, b if to_ends and b >= 1.0 else high
