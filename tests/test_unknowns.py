"""What is known of numbers before the data: its penalty, gradient and precision belong together."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from joda.diagnosis.hypotheses.effects import KNOTS, free_curves
from joda.effects.guesses import Units
from joda.estimation.unknowns import Unknowns


def numbers(rng, k, rough=False):
    low, high = -np.ones(k), np.ones(k)
    mean, prior_std = rng.normal(size=k), rng.uniform(0.2, 3, k)
    own = rng.normal(size=(2, k)) if rough else None
    return Unknowns(low, high, np.full(k, 0.01), mean, prior_std, rough=own)


@pytest.mark.parametrize(("first", "second"), [(False, False), (True, False), (False, True)])
def test_gradient_and_precision_are_those_of_the_penalty(rng, first, second):
    both = numbers(rng, 3, first).and_(numbers(rng, 4, second))
    x = rng.normal(size=7)
    np.testing.assert_allclose(2 * both.pull(x), approx_fprime(x, both.penalty), atol=1e-4)
    curved = [2 * (both.pull(x + e) - both.pull(x - e)) / 2e-3 for e in 1e-3 * np.eye(7)]
    np.testing.assert_allclose(2 * both.known, curved, atol=1e-6)


def test_of_some_numbers_only_what_is_known_of_these_alone_is_left(rng):
    one = numbers(rng, 5)
    one = replace(one, rough=np.diff(np.eye(5), 2, axis=0))  # three second differences
    kept = np.arange(5) != 0
    np.testing.assert_allclose(one.some(kept).rough, np.diff(np.eye(4), 2, axis=0))


def test_a_free_curve_is_straight_where_nothing_is_known_of_it():
    units = Units(
        force=1.0, speed=1.0, inertia=1.0, span=1.0, visited=(0.0, 1.0), friction=1.0, forced=True,
        weight=0.0, hinge=True,
    )  # fmt: skip
    for one in free_curves(units):
        line, bump = np.linspace(0.5, 2.0, KNOTS), np.zeros(KNOTS)
        bump[4] = 2.0
        assert one.unknowns.penalty(line) == pytest.approx(0, abs=1e-20)
        assert 1 < one.unknowns.penalty(bump) < 30  # far less than what data tell of it
