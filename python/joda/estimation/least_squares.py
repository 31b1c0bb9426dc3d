"""Least squares under linear inequalities: Levenberg-Marquardt."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Residuals = Callable[[Array], Array]

DAMPING = 1e-3
"""First damping, in units of the diagonal of the normal equations."""
TRIALS = 8
"""Shorter and shorter steps that an iteration tries."""
SETTLED = 1e-6
"""Relative decrease of the cost below which there is no more to gain."""


@dataclass(frozen=True)
class Inequalities:
    """G theta >= h; shapes (m, n) and (m,)."""

    G: Array
    h: Array


@dataclass(frozen=True)
class Fit:
    """Fitted numbers.

    Attributes:
        theta: the numbers.
        covariance: of its errors, from the data and the prior; shape (n, n).
        history: per iteration: stage, RMS misfit then.
        interrupted: whether the user stopped it; theta is then the best so far.
    """

    theta: Array
    covariance: Array
    history: tuple[tuple[str, float], ...]
    interrupted: bool = False


def bounded_step(A: Array, b: Array, G: Array, h: Array) -> Array:
    """The x that minimises |A x - b| under G x >= h.

    Reduced to a least-distance problem and that to non-negative least squares: Lawson and Hanson,
    Solving Least Squares Problems (1974), chapter 23.

    Args:
        A: shape (k, n), of full column rank.
        b: shape (k,).
        G: shape (m, n); x = 0 need not be feasible, but something must be.
        h: shape (m,).

    Returns:
        shape (n,).
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    Q, R = np.linalg.qr(A)
    target = Q.T @ b
    free = solve_triangular(R, target)
    if np.all(G @ free >= h - 1e-12):
        return np.asarray(free)
    E = solve_triangular(R, G.T, trans="T").T
    f = h - E @ target
    system = np.vstack([E.T, f])
    unit = np.zeros(len(system))
    unit[-1] = 1.0
    u, _ = nnls(system, unit, maxiter=50 * system.shape[1])
    rest = system @ u - unit
    z = -rest[:-1] / rest[-1]
    return np.asarray(solve_triangular(R, z + target))


def levenberg_marquardt(
    residuals: Residuals,
    jacobian: Residuals,
    start: Array,
    constraints: Inequalities,
    iterations: int,
    report: Callable[[int, Array, float], None] = lambda number, theta, cost: None,
) -> Array:
    """Minimises the sum of squared residuals.

    Args:
        residuals: shape (n,) to shape (k,).
        jacobian: shape (n,) to shape (k, n).
        start: where to begin, feasible; shape (n,).
        constraints: that hold at every iterate.
        iterations: at most so many.
        report: after each iteration, its number, the point and half the sum of squares there.

    Returns:
        the best point, shape (n,).
    """
    theta, damping = start, DAMPING
    r = residuals(theta)
    cost = 0.5 * float(r @ r)
    for number in range(1, iterations + 1):
        J = jacobian(theta)
        scale = np.sqrt(np.maximum((J**2).sum(axis=0), 1e-12))
        Q, R = np.linalg.qr(J)
        target = np.concatenate([-Q.T @ r, np.zeros(len(theta))])
        before = cost
        for _ in range(TRIALS):
            A = np.vstack([R, np.diag(np.sqrt(damping) * scale)])
            step = bounded_step(A, target, constraints.G, constraints.h - constraints.G @ theta)
            trial = residuals(theta + step)
            new = 0.5 * float(trial @ trial)
            if new < cost:
                theta, r, cost = theta + step, trial, new
                damping = max(damping / 10, 1e-9)
                break
            damping *= 10
        report(number, theta, cost)
        if before - cost <= SETTLED * before:
            break
    return theta
