"""Neighbouring bins whose error is beyond the noise, as intervals."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BINS = 10
MIN_ROWS = 3
"""Fewest rows in a bin that can be significant."""
MIN_DEVIATIONS = 5.0
"""Standard deviations above what noise makes, from which an error counts as significant."""
MIN_ERROR = 1.2
"""Least error of a bin, in units of the noise."""


def significant_intervals(
    edges: Array, values: Array, found: Array, apart: bool = False
) -> Iterator[tuple[tuple[float, float], NDArray[np.bool_]]]:
    """Intervals that fail, of neighbouring bins, and which rows lie in them.

    Args:
        edges: of the bins, shape (b + 1,).
        values: of what is told apart, shape (n,).
        found: RMS error, samples, and sum of squares in units of the noise, shape (n, 3 or more).
        apart: whether the bins on either side of zero are never joined.
    """
    bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    bad = [significant(found[bins == k]) for k in range(len(edges) - 1)]
    first = None
    for k in range(len(bad) + 1):
        ends = k == len(bad) or not bad[k] or (apart and edges[k] == 0)
        if first is not None and ends:
            yield (float(edges[first]), float(edges[k])), (bins >= first) & (bins < k)
            first = None
        if first is None and k < len(bad) and bad[k]:
            first = k


def significant(rows: Array) -> bool:
    """Whether the rows' sum of squares is beyond what noise makes, and the error noticeable.

    Without the worst row: a segment that begins in an impact may have a wrong start.
    """
    if len(rows) < MIN_ROWS:
        return False
    kept = np.argsort(rows[:, 2] / rows[:, 1])[:-1]
    samples, squares = rows[kept, 1].sum(), rows[kept, 2].sum()
    certain = squares > samples + MIN_DEVIATIONS * np.sqrt(2 * samples)
    return bool(certain and squares > MIN_ERROR**2 * samples)
