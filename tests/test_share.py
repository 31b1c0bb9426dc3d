"""What a profile has of an effect, and the rest: together the whole profile, never both."""

import numpy as np
import pytest

from joda.component import Component
from joda.diagnosis.overlap import divided, overlap, places
from joda.effects import AsymmetricFriction, StribeckFriction
from joda.profile import CHANNELS, Joint, Profile

JOINT = Joint(name="lid", type="hinge", range=(0.0, 2.0), unit="rad")
NAMES = ("detent_internal", "position_dependent_friction", "stribeck_friction", "native friction")


def drawn(rng):
    """A profile with components of several labels, and effects."""
    profile = Profile(joint=JOINT)
    for name in rng.choice(NAMES, rng.integers(1, 7)):
        part = Component(label=str(name), interval=(0, 1), x=(0, 1), y=tuple(rng.uniform(0, 1, 2)))
        profile = profile.with_component(str(rng.choice(CHANNELS)), part)
    if rng.random() < 0.5:
        profile = profile.with_effect(StribeckFriction(velocity=0.1, y=(1.0, 1.0)))
    return profile.with_effect(AsymmetricFriction(direction="positive", y=(0.1, 0.1)))


def pieces(profile):
    return [
        *(part for name in CHANNELS for part in getattr(profile.channels, name).components),
        *profile.effects,
    ]


def test_what_is_seen_and_what_is_left_are_the_whole():
    rng = np.random.default_rng()
    for _ in range(50):
        profile, name = drawn(rng), str(rng.choice(NAMES))
        own, rest = map(pieces, divided(profile, name))
        assert sorted(map(repr, own + rest)) == sorted(map(repr, pieces(profile)))
        assert all(name == (getattr(x, "label", None) or x.effect) for x in own)
        assert not any(name == (getattr(x, "label", None) or x.effect) for x in rest)


def test_what_was_given_is_among_the_rest():
    rng = np.random.default_rng()
    for _ in range(50):
        given, name = drawn(rng), str(rng.choice(NAMES))
        part = Component(label=name, interval=(0.1, 0.4), x=(0, 0.5, 1), y=(0, 1, 0))
        profile = given.with_component("friction", part)
        own, rest = divided(profile, name, given)
        assert pieces(own) == [part]
        assert rest == given


@pytest.mark.parametrize(
    ("y", "interval", "where"),
    [
        ((0.0, 1.0, 0.0), (0.2, 0.7), (0.25, 0.65)),  # a fifth of a triangle and more
        ((2.0, 2.0, 2.0), (0.0, 1.0), (0.0, 1.0)),  # alike everywhere
        ((2.0, 2.0, 2.0), (0.0, 0.4), (0.0, 0.4)),
    ],
)
def test_where_an_effect_acts_in_closed_form(y, interval, where):
    x = tuple(np.linspace(0, 1, 81))  # so that the curve is as good as its lines
    values = tuple(np.interp(x, (0, 0.5, 1), y))
    part = Component(label="detent_internal", interval=interval, x=x, y=values)
    for channel in CHANNELS:
        profile = Profile(joint=JOINT).with_component(channel, part)
        assert places(profile, "detent_internal")[0] == pytest.approx(where, abs=0.005)


def test_what_rises_above_a_level_acts_everywhere_and_there():
    x = tuple(np.linspace(0, 1, 81))
    part = Component(
        label="detent_internal", interval=(0, 1), x=x, y=tuple(np.interp(x, (0, 0.5, 1), (2, 3, 2)))
    )
    found = places(Profile(joint=JOINT).with_component("friction", part), "detent_internal")
    assert found[:3] == [(0.0, 1.0)] * 3
    assert found[3] == pytest.approx((0.1, 0.9), abs=0.005)


def test_a_pull_that_runs_out_slowly_acts_from_a_twentieth_on():
    x = np.linspace(0, 1, 81)
    part = Component(
        label="magnetic_return_to_low_end", interval=(0, 1), x=tuple(x), y=tuple(-np.exp(-10 * x))
    )
    profile = Profile(joint=JOINT).with_component("conservative", part)
    own = places(profile, part.label)[:3]
    for (low, high), level in zip(own, (0.2, 0.1, 0.05), strict=True):
        assert (low, high) == pytest.approx((0.0, -np.log(level) / 10), abs=0.005)


def test_a_law_acts_everywhere():
    profile = Profile(joint=JOINT).with_effect(StribeckFriction(velocity=0.1, y=(1.0, 1.0)))
    assert places(profile, "stribeck_friction") == [(0.0, 1.0)]


def test_the_overlap_of_places():
    assert overlap((0.0, 0.4), (0.2, 0.6)) == pytest.approx(1 / 3)
    assert overlap((0.0, 0.1), (0.2, 0.6)) == 0.0
