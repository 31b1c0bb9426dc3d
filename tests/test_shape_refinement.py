"""All numbers of a profile are fitted, and where no run was a curve keeps to its law."""

import numpy as np
import pytest
from lids import FRICTION, SPAN, thrown

from joda.diagnosis.shape_refinement import Trials, refitted
from joda.diagnosis.split import parted
from joda.effects import QuadraticDamping
from joda.measured.visited import visited_share

DRAG, KNOTS = 0.02, 17


@pytest.fixture
def lid(tmp_path, rng):
    """Runs of a lid with drag; and half of that drag over the whole range."""
    measured = thrown(tmp_path, rng, 4, drag=DRAG)
    x = tuple(np.linspace(0, 1, KNOTS))
    return measured, measured.profile.with_effect(QuadraticDamping(x=x, y=(DRAG / 2,) * KNOTS))


def test_where_no_run_was_a_curve_is_as_much_off_its_law_as_beside(lid):
    measured, law = lid
    last = max(run.position.max() for run in measured.runs) / SPAN
    assert visited_share(measured, (0.9, 1.0)) == 0
    (drag,) = refitted(measured, law, 1.0, law=law).effects
    seen = np.interp(0.7 * last, drag.x, drag.y)
    assert seen == pytest.approx(DRAG, rel=0.2)
    beyond = np.array(drag.y)[np.array(drag.x) > last]
    assert len(beyond) > 1
    assert np.all(beyond > 0.7 * DRAG) and np.all(beyond < 1.2 * DRAG)  # back to it slowly


def test_one_size_of_an_effect_is_all_of_its_curve(lid):
    measured, law = lid
    trials = Trials(*parted(measured))
    sizes = {}
    for profile in trials._resized(law):
        own = profile.channels.friction.components[0].y[0]
        drags = np.array(profile.effects[0].y)
        assert np.ptp(drags) < 1e-9
        sizes[own / FRICTION, drags[0] / DRAG] = profile
    factors = {round(float(drag), 3) for friction, drag in sizes if friction == pytest.approx(1)}
    assert factors == {0.25, 0.35, 0.7, 1.0}
    assert trials.tried(law).score > min(trials.tried(p).score for p in sizes.values())


def test_a_curve_of_which_a_fit_made_next_to_nothing_stays_so(lid):
    measured, law = lid
    none = QuadraticDamping(x=(0.0, 0.5, 1.0), y=(1e-20,) * 3)
    profile = measured.profile.with_effect(none)
    law = measured.profile.with_effect(QuadraticDamping(x=(0.0, 0.5, 1.0), y=(DRAG,) * 3))
    fitted = refitted(measured, profile, 1.0, law=law)
    assert 0 < max(fitted.effects[0].y) < 1e-17
    (friction,) = fitted.channels.friction.components
    assert np.all(np.isfinite(friction.y))
    first, last = (end(run.position) / SPAN for run in measured.runs[:1] for end in (min, max))
    seen = np.interp(np.linspace(first, last), friction.x, friction.y)
    assert np.mean(seen) > FRICTION  # it does the drag's work where runs were
