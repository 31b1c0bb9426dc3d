"""Where a model fails: which force is blamed, and when none is."""

from types import SimpleNamespace

import numpy as np
import pytest
from scenes import write
from test_scene_contacts import pushed

from joda import attach, compare, context
from joda.measured.comparison import _places
from joda.measured.failing_intervals import COLUMNS, IMPACT, Failing, failing_intervals
from joda.measured.reading import read_measured
from joda.measured.run_files import read_run
from joda.profile import Profile
from joda.scenes.model import load_model
from joda.scenes.native import whole_profile

STICKS = """<mujoco><compiler angle="radian"/><option timestep=".002"/><worldbody><body>
  <joint name="lid" axis="0 1 0" range="-1 1" stiffness="{spring}" springref="{rest}"
    frictionloss="{friction}"/>
  <geom type="box" size=".2 .1 .01" mass="{mass}"/>
</body></worldbody></mujoco>"""


def sentence(share):
    place = Failing("load", (0.0, 1.0), 1e-3, 0.2, share, True)
    return " ".join(_places(SimpleNamespace(failing=(place,), unit="rad")))


def rows(force, force_error, ways=(1.0, -1.0), count=60):
    """Segments missed by ten times a noise of 1 that may blame such a force."""
    out = np.zeros((count, COLUMNS))
    out[:, 0] = np.linspace(0.05, 0.95, count)
    out[:, 1] = np.resize(ways, count)
    out[:, 2] = out[:, 1] / 2
    out[:, 3] = np.arange(count)
    out[:, 5:8] = 10.0, 40, 4000.0
    out[:, 8], out[:, 9] = force, force_error
    return out


@pytest.mark.parametrize(
    ("force", "force_error", "blamed"),
    [
        (0.7, 0.02, 0.7),
        (2e-16, 3e-3, None),
        (-4e-13, 1e-6, None),
        (0.004, 0.02, None),  # sixty of them: 1.5 standard deviations of the mean
        (-0.05, 0.02, -0.05),
        (0.0, np.inf, None),
    ],
)
def test_a_force_that_may_be_none_is_not_blamed(force, force_error, blamed):
    found = failing_intervals(rows(force, force_error))
    assert found and all(place.force == pytest.approx(blamed) for place in found)
    ways = [place for place in found if place.by == "direction"]
    assert len(ways) == 2 * (blamed is not None)  # each for itself, with its share
    assert all(place.share == pytest.approx(0.5) for place in ways)


def test_a_force_that_explains_no_misfit_is_not_blamed():
    """Within each segment the force changes its sign: a constant one explains a tenth."""
    whole, uneven = rows(0.7, 0.02), rows(0.7, 0.02)
    whole[:, 10:12] = 4000.0, 40.0
    uneven[:, 10:12] = 4000.0, 3600.0
    assert all(place.force == pytest.approx(0.7) for place in failing_intervals(whole))
    assert failing_intervals(uneven) and all(
        place.force is None for place in failing_intervals(uneven)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("friction", "spring", "rest", "mass"), [(0.3, 2, 0.1, 1.0), (1.2, 20, -0.3, 4.0)]
)
def test_noise_free_runs_that_stick_blame_no_tiny_force(friction, spring, rest, mass, tmp_path):
    text = STICKS.format(friction=friction, spring=spring, rest=rest, mass=mass)
    bare = write(tmp_path, text, "model.xml")
    joint = context(bare, "lid").joint
    path = tmp_path / "scene.xml"  # friction of a profile, which holds the lid at rest
    attach(bare, whole_profile(load_model(bare), 0, Profile(joint=joint)), path)
    runs = [
        pushed(path.read_text(), "lid", lambda t: 0.0, tmp_path, f"{k}.csv", 2.0, start, noise=0.0)
        for k, start in enumerate((rest, -0.6, 0.8))
    ]
    found = compare(path, "lid", runs)
    blamed = [abs(place.force) for place in found.failing if place.force is not None]
    assert not blamed or min(blamed) > 1e-3 * friction
    measured = read_measured(path, "lid", [runs[0]])
    (window, *_) = measured.replayer.segments(read_run(runs[0]), measured.sigma[0])
    assert window.force == 0.0 and np.isinf(window.force_error)  # friction holds it at rest


SWINGS = """<mujoco><compiler angle="radian"/><option timestep=".001"/><worldbody><body>
  <joint name="lid" axis="0 0 1" range="-1 1" stiffness="4" damping="0.001"/>
  <geom type="box" size=".2 .2 .01" mass="{mass}"/>
</body></worldbody></mujoco>"""


@pytest.mark.slow
def test_a_whole_run_that_no_constant_force_explains_blames_none(tmp_path):
    """A swing whose model is a little too heavy parts from it ever more: no segment shows it."""
    path = write(tmp_path, SWINGS.format(mass=4.016), "model.xml")
    text = SWINGS.format(mass=4.0)
    run = pushed(text, "lid", lambda t: 0.0, tmp_path, "a.csv", 8.0, 0.5, noise=1e-3)
    found = compare(path, "lid", [run])
    assert found.failing_window == 0.0 and found.failing
    assert all(place.force is None for place in found.failing)


def test_a_small_share_is_no_bare_zero():
    assert "By load: less than 1 % of the error is under" in sentence(share=0.003)
    assert "By load: 3 % of the error is under" in sentence(share=0.03)


def test_what_is_missed_in_knocks_is_told_by_place_alone():
    """All knocks at the high end come in one direction, at one time, fast; the rest is missed by
    friction in the other."""
    knocks = rows(-3.0, 0.02, ways=(1.0,), count=20)
    knocks[:, 0], knocks[:, 3], knocks[:, IMPACT] = 0.99, 5.0, 1.0
    rest = rows(0.7, 0.02, ways=(-1.0,))
    rest[:, 5:8] = 1.5, 40, 90.0
    found = failing_intervals(np.concatenate([knocks, rest]))
    assert found[0].by == "position"
    others = [place for place in found if place.by == "direction"]
    assert [place.interval for place in others] == [(-1.0, 0.0)]
    assert others[0].share < 0.1
