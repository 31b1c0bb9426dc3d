"""The templates' laws, with a few numbers each, are laws of their kind that others would write."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from test_uneven import BARE, UNITS

from joda import templates
from joda.diagnosis.hypotheses import hypotheses
from joda.field import evaluate
from joda.hidden import shapes

HYPOTHESES = {one.effect: one for one in hypotheses(UNITS, templates(), BARE)}
S = np.linspace(0.002, 0.998, 300)
LOBES = shapes.gaussian, shapes.windowed_sine, shapes.triangle, shapes.quartic


def left(hypothesis, course):
    """Part of a course's mean square that the hypothesis cannot be."""
    y = course(S) / np.abs(course(S)).max()

    def curve(x):
        return evaluate(hypothesis.write(BARE, x).channels.conservative, S)[0]

    low, high = hypothesis.unknowns.low.copy(), hypothesis.unknowns.high.copy()
    unit = np.abs(curve(hypothesis.trials[0])).max() / hypothesis.trials[0, 0]
    high[0] = 10 / unit
    begins = []
    for trial in hypothesis.trials:
        own = curve(trial)
        x = np.concatenate([[max(own @ y / (own @ own), 0.01) * trial[0]], trial[1:]])
        begins.append((np.sum((curve(x) - y) ** 2), x))
    fits = [
        least_squares(
            lambda x: curve(x) - y,
            np.clip(x, low + 1e-9, high - 1e-9),
            bounds=(low, high),
            x_scale=np.append(1 / unit, 10 * hypothesis.unknowns.step[1:]),
            diff_step=1e-4,
            max_nfev=100,
        )
        for _, x in sorted(begins, key=lambda begin: begin[0])[:6]
    ]
    return 2 * min(fit.cost for fit in fits) / np.sum(y**2)


def over_centre(rng):
    """A spring, a strut and two textbook curves that leave a place between the ends."""
    middle = rng.uniform(0.4, 0.6)
    yield shapes.Strut(middle, rng.uniform(0.2, 0.6), rng.uniform(1.5, 3.0), 0.0)
    yield shapes.Strut(middle, 0.4, rng.uniform(1.5, 3.0), rng.uniform(1.4, 1.9))
    yield shapes.Sine(middle, rng.uniform(1.1, 2.4))
    yield shapes.Cubic(middle, rng.uniform(0.9 * max(middle, 1 - middle), 0.8))


def test_an_over_centre_mechanism_has_two_sides(rng):
    for course in over_centre(rng):
        assert left(HYPOTHESES["bistable_mechanism"], course) < 0.01, course


@pytest.mark.parametrize("lobe", LOBES, ids=lambda lobe: lobe.__name__)
def test_two_wells_differ_and_overlap_or_are_apart(rng, lobe):
    apart = rng.uniform(0.9, 1.2)
    wells = tuple(shapes.Well(lobe, 0.5 + way * 0.15 * apart, 0.15) for way in (-1, 1))
    course = shapes.Sum(wells, (1.0, rng.uniform(0.7, 1.4)))
    assert left(HYPOTHESES["bistable_mechanism_internal"], course) < 0.01


def test_a_spring_that_does_not_reach_all_over_pulls_wherever_it_reaches():
    springs = [h for h in hypotheses(UNITS, templates(), BARE) if h.effect.startswith("spring_ret")]
    assert sum(bool(one.ends) for one in springs) == 2
    for one in springs:
        x = one.trials[0].copy()
        x[1:3] = one.unknowns.low[1:3]  # no preload, and as much off a straight line as may be
        (part,) = one.write(BARE, x).channels.conservative.components
        slack = np.isclose(part.y, 0).sum()
        assert slack == (1 if one.ends else 3)
