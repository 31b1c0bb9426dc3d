"""What the model gave stays as it was given, or it is said that the runs want it otherwise."""

import json

import numpy as np
import pytest
from lids import FRICTION, thrown
from test_compare import door, runs_of, scene_of

from joda import add
from joda.commands.add import sentences
from joda.commands.improve import _departures as told_by_improve
from joda.component import Component
from joda.diagnosis import adding
from joda.diagnosis.adding import OWN, Error, add_effect
from joda.diagnosis.departures import Departures, changed_parts, departures, given_parts, restored
from joda.diagnosis.improvement import Step
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shape_refinement import Trials
from joda.diagnosis.split import parted
from joda.effects import GravityOffset, StribeckFriction
from joda.measured.reading import read_measured
from joda.profile import Joint, Profile

LID = Profile(joint=Joint(name="lid", type="hinge", range=(0.0, 2.0), unit="rad"))


def level(label, value, a=0.0, b=1.0):
    return Component(label=label, interval=(a, b), x=(0, 1), y=(value, value))


def given_by(rng):
    """A model with friction, damping, and an effect; and their sizes."""
    sizes = np.exp(rng.normal(0, 2, 3))
    profile = LID.with_component("friction", level("native friction", sizes[0]))
    profile = profile.with_component("damping", level("native damping", sizes[1]))
    return profile.with_effect(StribeckFriction(velocity=0.1, y=(sizes[2],) * 2)), sizes


def times(profile, factors, sizes):
    """The model with other sizes, and one effect more."""
    names = ("friction", "damping")
    out = LID
    for name, factor, size in zip(names, factors, sizes, strict=False):
        out = out.with_component(name, level(f"native {name}", factor * size))
    out = out.with_component("conservative", level("detent_internal", 1.0, 0.2, 0.4))
    return out.with_effect(StribeckFriction(velocity=0.1, y=(factors[2] * sizes[2],) * 2))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_moved_by_more_than_its_doubt_is_told_and_can_be_put_back(rng, way):
    for _ in range(20):
        given, sizes = given_by(rng)
        far = rng.random(3) < 0.5
        factors = 1 + way * np.where(far, rng.uniform(0.31, 1.0, 3), rng.uniform(0, 0.29, 3))
        fitted = times(given, factors, sizes)
        parts = changed_parts(given, fitted, "detent_internal")
        assert len(parts) == far.sum()
        told = departures(given, fitted, "detent_internal").changed or ""
        for number, (name, unit) in enumerate((("friction", "N·m"), ("damping", "N·m·s/rad"))):
            before, after = sizes[number], factors[number] * sizes[number]
            line = f"native {name} {before:.3g} → {after:.3g} {unit}"
            assert (line in told) == far[number], told
        assert ("stribeck friction" in told) == far[2]
        whole = restored(fitted, given, given_parts(given, "detent_internal"))
        assert whole.channels.friction == given.channels.friction
        assert whole.channels.damping == given.channels.damping
        assert whole.effects == given.effects
        assert whole.channels.conservative == fitted.channels.conservative
        back = restored(fitted, given, parts)
        assert changed_parts(given, back, "detent_internal") == ()
        assert back.channels.conservative == fitted.channels.conservative
        others = np.flatnonzero(~far)
        for number in others[others < 2]:
            name = ("friction", "damping")[number]
            assert getattr(back.channels, name) == getattr(fitted.channels, name)


def test_a_curve_that_changes_at_one_place_is_told_there():
    given = LID.with_component("friction", level("native friction", 1.0))
    bent = Component(label="native friction", interval=(0, 1), x=(0, 0.5, 1), y=(1, 1, 2))
    (part,) = changed_parts(given, LID.with_component("friction", bent), "backlash")
    assert part.described == "native friction 1 → 2 N·m at s = 1.00"


def test_a_number_of_either_sign_counts_too():
    given = LID.with_effect(GravityOffset(sin=0.5, cos=-1.0))
    for cos, far in ((-1.0, 0), (-1.0 + 0.9 * SETTINGS.adding.model_error, 0), (0.2, 1)):
        new = LID.with_effect(GravityOffset(sin=0.5, cos=cos))
        assert len(changed_parts(given, new, "detent_internal")) == far
        assert changed_parts(given, new, "gravity_offset") == ()  # that was added to


@pytest.mark.parametrize(
    ("near", "said"), [((0.0, 0.5), True), ((0.2, 0.45), False), (None, False)]
)
def test_where_else_it_acts_is_told(near, said):
    fitted = LID.with_component("conservative", level("detent_internal", 1.0, 0.2, 0.4))
    told = departures(LID, fitted, "detent_internal", near).elsewhere
    assert bool(told) == said
    if said:
        assert "acts at s = 0.20 to 0.40, diagnosed at s = 0.00 to 0.50" in told


def test_a_magnet_acts_where_its_pull_is_a_twentieth_and_more():
    x = np.linspace(0, 1, 81)
    part = Component(
        label="magnetic_return_to_low_end", interval=(0, 1), x=tuple(x), y=tuple(-np.exp(-20 * x))
    )
    fitted = LID.with_component("conservative", part)
    assert departures(LID, fitted, part.label, (0.0, 0.15)).elsewhere is None
    assert departures(LID, fitted, part.label, (0.0, 0.5)).elsewhere


# --- fits
ADDED = "constant_friction_hinge"
RUBS = 0.07
"""Friction that the lid has besides what its model says, N·m."""


@pytest.fixture
def rubbing(tmp_path, rng):
    """Runs of a lid with more friction than its model."""
    return thrown(tmp_path, rng, 2, drag=1e-6, friction=FRICTION + RUBS)


def without_its_own(profile):
    """All of the friction is what was added: it moves as well, but the model said otherwise."""
    none = profile.channels.friction.components[0].model_copy(update={"y": (0.0, 0.0)})
    friction = profile.channels.friction.model_copy(update={"components": (none,)})
    channels = profile.channels.model_copy(update={"friction": friction})
    bare = profile.model_copy(update={"channels": channels})
    return bare.with_component("friction", level(ADDED, FRICTION + RUBS))


@pytest.mark.slow
def test_a_number_that_need_not_vanish_stays(rubbing, monkeypatch):
    start = without_its_own(rubbing.profile)
    monkeypatch.setattr(adding, "starts", lambda *_: [start])
    added_effect = add_effect(*parted(rubbing), ADDED)
    assert added_effect.effect == ADDED, added_effect.reason
    own, added = (max(part.y) for part in added_effect.profile.channels.friction.components)
    assert own == pytest.approx(FRICTION, rel=SETTINGS.adding.model_error)
    # the noise of two throws leaves about 2 %
    assert own + added == pytest.approx(FRICTION + RUBS, rel=0.2)
    assert added_effect.departs.sentences == ()


def test_where_no_fit_is_better_its_own_numbers_are_held_as_given(rubbing, monkeypatch):
    """Fits of all numbers end where what was held out is missed by more."""
    (own,) = rubbing.profile.channels.friction.components
    wrong = own.model_copy(update={"y": (FRICTION + 3 * RUBS,) * 2})
    friction = rubbing.profile.channels.friction.model_copy(update={"components": (wrong,)})
    channels = rubbing.profile.channels.model_copy(update={"friction": friction})
    worse = rubbing.profile.model_copy(update={"channels": channels})
    worse = worse.with_component("friction", level(ADDED, RUBS))
    monkeypatch.setattr(Trials, "refined_shapes", lambda self, *_: [self.tried(worse)])
    added_effect = add_effect(*parted(rubbing), ADDED)
    assert added_effect.effect == ADDED, added_effect.reason
    own, added = (part.y for part in added_effect.profile.channels.friction.components)
    assert own == pytest.approx((FRICTION, FRICTION), rel=0.01)
    assert np.mean(added) == pytest.approx(RUBS, rel=0.2)


def test_what_is_held_stays_while_all_else_is_fitted(rubbing):
    start = without_its_own(rubbing.profile)
    parts = changed_parts(rubbing.profile, start, ADDED)
    trials = Trials(*parted(rubbing))
    for one in trials.holding(restored(start, rubbing.profile, parts), parts, lambda what: None):
        own, added = (part.y for part in one.profile.channels.friction.components)
        assert own == pytest.approx((FRICTION, FRICTION), rel=0.01)
    assert np.mean(added) == pytest.approx(RUBS, rel=0.1)
    assert one.unseen < trials.tried(rubbing.profile).unseen


@pytest.mark.slow
def test_a_number_that_the_runs_contradict_is_told(tmp_path, rng):
    """The model's friction is three times too large, and the drag is missing."""
    measured = thrown(tmp_path, rng, 3, drag=0.02, friction=FRICTION / 3)
    added_effect = add_effect(*parted(measured), "quadratic_damping")
    assert added_effect.effect == "quadratic_damping", added_effect.reason
    own = max(added_effect.profile.channels.friction.components[0].y)
    assert own == pytest.approx(FRICTION / 3, rel=0.15)
    assert f"native friction {FRICTION:g} → 0.01" in added_effect.departs.changed


@pytest.mark.slow
def test_an_effect_gets_no_credit_for_numbers_that_were_wrong(tmp_path, rng):
    """The model's friction and damping are several times too large, and nothing is missing."""
    runs = runs_of(door(), tmp_path, int(rng.integers(2**31)), 4)
    model = scene_of(door(friction=0.9, damping=2.5), tmp_path)
    measured = read_measured(model, "joint", runs)
    for effect in ("added_inertia", "quadratic_damping"):
        added_effect = add_effect(*parted(measured), effect)
        assert added_effect.effect is None
        assert added_effect.reason == OWN


@pytest.mark.slow
@pytest.mark.sweep(1)
@pytest.mark.parametrize("near", [(0.55, 0.75), (0.05, 0.25)])
def test_an_effect_that_acts_elsewhere_than_diagnosed_is_told(tmp_path, rng, near):
    x, y = (0, 0.25, 0.5, 0.75, 1), (0, 1.0, 0, -1.0, 0)
    click = Component(label="click", interval=(0.55, 0.75), x=x, y=y)
    runs = runs_of(door(click), tmp_path, int(rng.integers(2**31)), 3)
    said = {"effects": [{"effect": "detent_internal", "interval": near}]}
    (tmp_path / "said.json").write_text(json.dumps(said))
    model, new = scene_of(door(), tmp_path), tmp_path / "new.xml"
    found = add(model, "joint", tmp_path / "said.json", runs, new)
    assert found.added, found.reason
    (one, *_) = found.departures or ("",)
    assert bool(one) == (near[0] < 0.5)
    assert not one or "diagnosed at s = 0.05 to 0.25" in one
    assert set(found.departures) <= set(sentences(found))
    assert list(found.departures) == json.loads(json.dumps(found.as_json()))["departures"]


def test_improve_tells_of_every_place_and_of_the_last_numbers():
    first, last = (
        Step(None, LID, Error(1.0, 1.0), departs=Departures((), f"numbers {k}", f"place {k}"))
        for k in (1, 2)
    )
    assert told_by_improve([first, last]) == ("numbers 2", "place 1", "place 2")
