"""A search without derivatives, for losses that are jagged: where a joint sticks, slips or hits."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def least(
    loss: Callable[[Array], float],
    begin: Array,
    wide: Array | float,
    each: int,
    adaptive: bool = False,
) -> Array:
    """The numbers with the least loss (Nelder and Mead, Computer Journal 7 (1965) 308).

    Args:
        loss: shape (k,) to a number.
        begin: where to begin, shape (k,).
        wide: how far off the first simplex's other corners are, each along one number; shape (k,).
        each: values of the loss for each number, at most.
        adaptive: whether steps are smaller the more numbers there are (Gao and Han, Computational
            Optimization and Applications 51 (2012) 259).

    Returns:
        shape (k,).
    """
    from scipy.optimize import minimize

    k = len(begin)
    simplex = begin + np.vstack([np.zeros(k), wide * np.eye(k)])
    options = {"initial_simplex": simplex, "maxfev": each * k, "adaptive": adaptive}
    return np.asarray(minimize(loss, begin, method="Nelder-Mead", options=options).x)
