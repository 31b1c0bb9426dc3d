"""Numbers that are off beside an effect: what stood in for it is given back, the rest is right."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_calibration import arm, found_of, logged

from joda.diagnosis import verdict
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.joint_calibration import jointly, needed
from joda.estimation.nuisance import nuisances_of
from joda.measured.reading import read_measured

EFFECT = "constant_positive_conservative_hinge"
HEAVIER, ZERO, PULL = 1.4, 0.06, 0.6
"""Factor of the mass, a zero (rad) that nothing asks for, and a force (N m) that is missing."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The runs of such an arm, and its mass as it was found, with a zero that nothing asks for."""
    rng = np.random.default_rng()
    folder = tmp_path_factory.mktemp("arm")
    measured, mass = found_of(folder, rng, mass=HEAVIER)
    mass = mass.only(("mass",))  # now and then an inertia that is off by 0.1 % is beside it
    every = nuisances_of(measured, mass.numbers.base)
    both = replace(
        mass,
        numbers=every.only(("mass", "position_offset")),
        fit=replace(mass.fit, x=np.append(mass.fit.x, ZERO)),
        covariance=np.diag([mass.covariance[0, 0], 1e-6]),
        others=((), ()),
    )
    pulled, _ = found_of(folder, rng, mass=HEAVIER, extra=lambda q, v: PULL)
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
@pytest.mark.parametrize("trust", [{}, {"frictionloss": 0.05, "damping": 0.05}])
def test_of_masses_and_forces_the_ratio_is_known_unless_the_resistances_are(tmp_path, trust):
    """Friction and damping are 1.6 times the model's, or all else is 1.6 times less."""
    rng, lighter, more = np.random.default_rng(), 0.6, 1.6
    _, mass = found_of(tmp_path, rng, mass=lighter)
    slow = lambda q, v: PULL - (more - 1) * (0.15 * np.tanh(v / 0.001) + 0.1 * v)  # noqa: E731
    measured, _ = found_of(tmp_path, rng, trust, mass=lighter, extra=slow)
    every = nuisances_of(measured, fit_baseline(measured).base)
    both = replace(
        mass,
        numbers=every.only(("mass", "force_scale")),
        fit=replace(mass.fit, x=np.array([1.0, 1.0, np.log(lighter / more), np.log(1 / more)])),
        covariance=1e-4 * np.eye(2),
        others=((), ()),
    )
    left = needed(*fitted(measured, both))
    assert ({"mass", "force_scale"} <= set(left.names)) == bool(trust)


@pytest.mark.slow
@pytest.mark.parametrize("names", [("mass",), ("mass", "position_offset")])
def test_what_is_left_is_fitted_beside_the_effect(found, names):
    measured, numbers = found
    told = jointly(*fitted(measured, numbers.only(names)))
    assert told.names == names and np.all(told.errors < 0.2)
    right = {"mass": np.log(HEAVIER), "position_offset": 0.0}
    off = told.fit.x[-len(names) :] - [right[name] for name in names]
    assert np.all(np.abs(off) < 4 * told.errors + 0.01)


@pytest.mark.parametrize(
    ("left", "together", "ends"),
    [
        ("unexplained", True, "both"),
        ("unexplained", False, "numbers"),
        ("missing_effect", True, "numbers"),
        ("adequate", True, "numbers"),
    ],
)
def test_numbers_and_effects_are_asked_for_together_where_these_leave_something(
    tmp_path, monkeypatch, left, together, ends
):
    numbers = SimpleNamespace(alone=True, of=lambda measured: measured, unusual=False)
    looks = SimpleNamespace(selection=SimpleNamespace(verdict=left))
    runs = logged(tmp_path, np.random.default_rng(0))
    (tmp_path / "arm.xml").write_text(arm())
    measured = read_measured(tmp_path / "arm.xml", "arm", runs)
    monkeypatch.setattr(verdict.Calibrator, "numbers", lambda *_: numbers)
    monkeypatch.setattr(verdict, "looked", lambda *_, **__: looks)
    answer = ("both", looks) if together else None
    monkeypatch.setattr(verdict, "_asked_with", lambda *_: answer)
    monkeypatch.setattr(verdict, "_set_right", lambda _, found, *rest: found)
    assert verdict.diagnosed(measured) == (numbers if ends == "numbers" else ends)
