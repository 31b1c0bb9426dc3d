"""Least squares under inequalities, against SciPy and problems with a known answer."""

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from joda.estimation.least_squares import Inequalities, bounded_step, levenberg_marquardt


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("feasible", [True, False])
def test_the_bounded_step_is_scipys(seed, feasible):
    rng = np.random.default_rng(seed)
    A, b, G = rng.normal(size=(12, 5)), rng.normal(size=12), rng.normal(size=(7, 5))
    inside = np.zeros(5) if feasible else 3 * rng.normal(size=5)
    h = G @ inside - rng.uniform(0.01, 0.3, 7)
    x = bounded_step(A, b, G, h)
    cost = lambda x: float(np.sum((A @ x - b) ** 2))  # noqa: E731
    best = minimize(
        cost,
        inside,
        jac=lambda x: 2 * A.T @ (A @ x - b),
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda x: G @ x - h, "jac": lambda x: G},
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert np.all(G @ x >= h - 1e-8)
    assert cost(x) <= best.fun * (1 + 1e-8) + 1e-8
    np.testing.assert_allclose(x, best.x, atol=1e-3)


def residuals(x):
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def jacobian(x):
    return np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])


FREE = Inequalities(np.zeros((0, 2)), np.zeros(0))
BELOW = Inequalities(np.array([[-1.0, 0.0], [0.0, 1.0]]), np.array([-0.5, -1.0]))
START = np.array([-1.2, 1.0])


def test_rosenbrocks_valley_is_walked_to_its_end():
    x = levenberg_marquardt(residuals, jacobian, START, FREE, 60)
    np.testing.assert_allclose(x, [1, 1], atol=1e-6)


def test_every_iterate_satisfies_the_constraints():
    seen = []
    x = levenberg_marquardt(
        residuals, jacobian, START, BELOW, 60, lambda k, x, c: seen.append((x, c))
    )
    assert all(np.all(BELOW.G @ at >= BELOW.h - 1e-9) for at, _ in seen)
    assert rosen(x) < rosen(START)
    np.testing.assert_allclose(x, [0.5, 0.25], atol=1e-5)  # the valley's lowest point, x <= 1/2
    costs = [cost for _, cost in seen]
    assert costs == sorted(costs, reverse=True)
