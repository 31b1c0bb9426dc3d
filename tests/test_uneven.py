"""Effects whose size differs along the way."""

import numpy as np
import pytest
from hidden_cases import read

from joda import templates
from joda.diagnosis.adding import starts
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.hypotheses import hypotheses
from joda.diagnosis.search import rank
from joda.diagnosis.uncertainty import uncertainty
from joda.effects.guesses import Units
from joda.hidden import draw
from joda.profile import Joint, Profile

UNITS = Units(2.0, 3.0, 0.5, 2.0, (0.1, 1.0), 0.3, True, 0.0, True)
BARE = Profile(joint=Joint(name="j", type="hinge", range=(0, 2), unit="rad"))
EFFECTS = [one for one in hypotheses(UNITS, templates(), BARE) if one.uneven]


def levels(flat):
    """What it is more and more finely."""
    while flat.uneven:
        flat = flat.uneven
        yield flat


def curve(hypothesis, x):
    (effect,) = hypothesis.write(BARE, x).effects
    a, b = effect.interval
    return np.interp(np.linspace(0, 1, 201), a + (b - a) * np.array(effect.x), effect.y)


def test_friction_and_drag_of_one_way_of_rest_and_of_speed_may_be_uneven():
    assert [(one.effect, one.direction) for one in EFFECTS] == [
        ("direction_dependent_damping", "positive"),
        ("direction_dependent_damping", "negative"),
        ("asymmetric_friction", "positive"),
        ("asymmetric_friction", "negative"),
        ("stribeck_friction", "both"),
        ("quadratic_damping", "both"),
    ]


@pytest.mark.parametrize("flat", EFFECTS)
def test_without_factors_it_is_as_it_was_and_with_them_as_large_as_the_largest(flat):
    x = np.append(0.7, flat.trials[0, 1:])
    for uneven in levels(flat):
        even = np.append(x, np.zeros(uneven.factors))
        assert np.allclose(curve(uneven, even), curve(flat, x), rtol=1e-12)
        assert uneven.magnitude(even) == pytest.approx(flat.magnitude(x))
        even[-1] = np.log(1.5)
        assert uneven.magnitude(even) == pytest.approx(1.5 * flat.magnitude(x))
        assert curve(uneven, even)[-1] == pytest.approx(1.5 * curve(flat, x)[-1])
        assert curve(uneven, even)[0] == pytest.approx(curve(flat, x)[0])
        wide = flat.unknowns.widest, uneven.unknowns.widest
        assert np.array_equal(wide[0], wide[1][:, : len(x)], equal_nan=True)


@pytest.mark.long
@pytest.mark.parametrize("seed", [154852941, 31])
def test_a_friction_that_ripples_along_the_way_is_found_with_its_largest_size(seed):
    """Of a machine's one-way friction, ten periods of which may lie in the range."""
    case = draw(seed, "asymmetric_friction", True, None, "machinery")
    baseline = fit_baseline(read(case)[0])
    ranking = rank(baseline)
    first, second = ranking.candidates[:2]
    assert first.hypothesis.effect == "asymmetric_friction"
    assert first.hypothesis.direction == case.seal["direction"]
    assert first.hypothesis.factors and first.fit.loss < 0.3 * second.fit.loss
    size = first.hypothesis.magnitude(first.x)
    known = uncertainty(ranking.baseline, first, first.fit.loss / baseline.fit.loss)
    assert abs(size - case.seal["magnitude"]) < 3 * known.magnitude < size


@pytest.mark.long
def test_what_is_added_begins_with_the_ripples():
    """Of a slide's one-way friction, ten periods of which lie in the range."""
    case = draw(2003795171, "asymmetric_friction", True, None, "machinery")
    begun = starts(fit_baseline(read(case)[0]), "asymmetric_friction", "positive", (0.0, 1.0))[0]
    (effect,) = begun.effects
    s = np.linspace(0.03, 0.97, 201)
    found = np.interp(s, effect.x, effect.y)
    true = 1 + 0.191 * np.sin(2 * np.pi * (s - 0.2589) / 0.10406)
    assert np.corrcoef(found, true)[0, 1] > 0.95
