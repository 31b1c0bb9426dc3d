"""Smooth curves as few numbers: a Gaussian process' largest modes on a grid.

A curve's values are `modes @ x` with numbers x that are 0 ± 1 before the data (Karhunen and Loève;
Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), chapter 4).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KEPT = 1e-4
"""Modes of less than this part of the largest one's variance are left out."""


def nearness(at: Array, length: float) -> Array:
    """Correlation of a smooth curve's values, shape (n, n).

    Args:
        at: places, shape (n,).
        length: over which it changes, in their unit.
    """
    return np.asarray(np.exp(-0.5 * ((at[:, None] - at) / length) ** 2))


def modes_of(covariance: Array) -> Array:
    """Factor L of a covariance L Lᵀ, the small modes left out; shape (n, k)."""
    sizes, shapes = np.linalg.eigh(covariance)
    kept = sizes > KEPT * sizes[-1]
    return np.asarray((shapes[:, kept] * np.sqrt(sizes[kept]))[:, ::-1])
