"""Numbers that are off beside an effect: what stood in for it is given back, the rest is right."""

from dataclasses import replace

import numpy as np
import pytest
from test_calibration import found_of

from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.joint_calibration import jointly, needed
from joda.estimation.nuisance import nuisances_of

EFFECT = "constant_positive_conservative_hinge"
HEAVIER, ZERO, PULL = 1.4, 0.06, 0.6
"""Factor of the mass, a zero (rad) that nothing asks for, and a force (N m) that is missing."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The runs of such an arm, and its mass as it was found, with a zero that nothing asks for."""
    rng = np.random.default_rng()
    folder = tmp_path_factory.mktemp("arm")
    measured, mass = found_of(folder, rng, mass=HEAVIER)
    every = nuisances_of(measured, mass.numbers.base)
    both = replace(
        mass,
        numbers=every.only(("mass", "position_offset")),
        fit=replace(mass.fit, x=np.append(mass.fit.x, ZERO)),
        covariance=np.diag([mass.covariance[0, 0], 1e-6]),
        others=((), ()),
    )
    pulled, _ = found_of(folder, rng, mass=HEAVIER, extra=lambda q: PULL)
    return pulled, both


def fitted(measured, numbers):
    """The model with these set right, and the force that it lacks."""
    baseline = fit_baseline(numbers.of(measured))
    hypothesis = next(h for h in baseline.hypotheses if h.effect == EFFECT)
    return measured, numbers, baseline, baseline.fit_hypothesis(hypothesis)


@pytest.mark.slow
def test_a_number_that_stood_in_for_an_effect_is_given_back(found):
    assert needed(*fitted(*found)).names == ("mass",)


@pytest.mark.slow
@pytest.mark.parametrize("names", [("mass",), ("mass", "position_offset")])
def test_what_is_left_is_fitted_beside_the_effect(found, names):
    measured, numbers = found
    told = jointly(*fitted(measured, numbers.only(names)))
    assert told.names == names and np.all(told.errors < 0.2)
    right = {"mass": np.log(HEAVIER), "position_offset": 0.0}
    off = told.fit.x[-len(names) :] - [right[name] for name in names]
    assert np.all(np.abs(off) < 4 * told.errors + 0.01)
