"""Where a template may act: an interval of the range, as numbers that are fitted."""

import numpy as np

from joda.diagnosis.hypotheses.base import Array, Bounds

WIDTHS = (0.08, 0.13, 0.2, 0.3, 0.42, 0.6)
"""Of the intervals that are tried, in normalised position."""
NARROWEST = 0.02
END = (0.0, 1.0, 0.004)
"""Bounds and step of an end of an interval."""


def ends(place: str, x: Array) -> tuple[float, float]:
    """The interval, of which the last numbers are the ends."""
    if place == "whole":
        return 0.0, 1.0
    if place == "low":
        return 0.0, max(float(x[-1]), NARROWEST)
    if place == "high":
        return min(float(x[-1]), 1.0 - NARROWEST), 1.0
    a, b = sorted((float(x[-2]), float(x[-1])))
    a = min(a, 1.0 - NARROWEST)
    return a, max(b, a + NARROWEST)


def places(place: str, widest: float = 1.0) -> tuple[Bounds, list[tuple[float, ...]]]:
    """Bounds and steps of the numbers of an interval, and values to try."""
    widths = [w for w in (*WIDTHS, 0.8) if w <= widest]
    if place == "whole":
        return [], [()]
    if place == "low":
        return [(NARROWEST, widest, 0.004)], [(w,) for w in widths]
    if place == "high":
        return [(1 - widest, 1 - NARROWEST, 0.004)], [(1 - w,) for w in widths]
    begins = [(float(a), w) for w in WIDTHS for a in np.arange(0, 1 - w + 1e-9, w / 3)]
    return [END, END], [(a, a + w) for a, w in begins]
