"""What a fit may change, and what stays true whatever it does."""

import numpy as np
import pytest

from joda import templates
from joda.component import Component
from joda.diagnosis.shape_refinement import resolved
from joda.effects import Backlash, EndStopRestitution, PreslidingFriction
from joda.estimation.least_squares import bounded_step
from joda.estimation.profile_parameters import KINDS, Parameters
from joda.field import evaluate
from joda.profile import CHANNELS, Channel, Channels, Joint, Profile, Resistance

NAMES = sorted(templates())


def planted(name, kind="hinge"):
    curves, out = templates()[name].channels, {}
    for channel in CHANNELS:
        curve = getattr(curves, channel)
        part = curve and Component(label=name, interval=(0.2, 0.6), x=curve.x, y=curve.y)
        cls = Channel if channel == "conservative" else Resistance
        out[channel] = cls(components=(part,) if part else ())
    joint = Joint(name="j", type=kind, range=(0, 2), unit="rad" if kind == "hinge" else "m")
    return Profile(joint=joint, channels=Channels(**out))


@pytest.mark.parametrize("name", NAMES)
def test_the_first_numbers_are_allowed_and_write_the_same_profile(name):
    profile = planted(name)
    for keep in (True, False):
        p = Parameters(profile, KINDS, keep_shape=keep)
        assert np.all(p.constraints.G @ p.start >= p.constraints.h - 1e-12)
        assert p.written(p.start, exact=True) == profile


@pytest.mark.parametrize("name", NAMES)
def test_whatever_is_allowed_keeps_signs_and_rises_and_falls(name):
    profile = planted(name)
    p = Parameters(profile, ("values", "intervals"))
    rng = np.random.default_rng(0)
    for _ in range(20):
        G, h = p.constraints.G, p.constraints.h
        wish = rng.normal(0, 0.5, len(p.start))
        theta = p.start + bounded_step(np.eye(len(wish)), wish, G, h - G @ p.start)
        after = p.written(theta)
        for channel in CHANNELS:
            pairs = (getattr(q.channels, channel).components for q in (profile, after))
            for was, now in zip(*pairs, strict=True):
                a, b = now.interval
                assert 0 <= a < b <= 1
                for old, new in ((was.y, now.y), (np.diff(was.y), np.diff(now.y))):
                    assert np.all(np.sign(old) * np.array(new) >= -1e-6 * np.abs(was.y).max())


@pytest.mark.parametrize("width", [0.3, 0.02])
def test_a_steep_edge_keeps_its_shape_and_gets_no_points(width):
    x, y = (0.0, 0.01, 0.5, 0.99, 1.0), (0.0, 0.6, 0.6, 0.6, 0.0)
    rub = Component(label="rub", interval=(0.3, 0.3 + width), x=x, y=y)
    joint = Joint(name="j", type="hinge", range=(0, 2), unit="rad")
    channels = Channels(friction=Resistance(components=(rub,)))
    finer = resolved(Profile(joint=joint, channels=channels))
    (more,) = finer.channels.friction.components
    gaps = np.diff(more.x) * width
    assert set(x) <= set(more.x) and np.sum(gaps < 0.005) == 2  # the edges alone
    assert len(more.x) == (7 if width > 0.1 else 5)
    s = np.linspace(0, 1, 2001)
    curves = (evaluate(Resistance(components=(one,)), s)[0] for one in (rub, more))
    np.testing.assert_allclose(*curves, atol=0.01)  # an end's slope is of its neighbours
    slots = Parameters(finer, ("values",), keep_shape=False).slots
    assert {slot.index for slot in slots} == set(range(1, len(more.x) - 1))  # the feet stay


def test_points_where_no_run_was_change_by_what_was_seen_of_what_they_bend():
    rub = Component(label="rub", interval=(0.2, 1.0), x=(0, 0.25, 0.5, 1), y=(1.0, 2.0, 2.0, 1.0))
    joint = Joint(name="j", type="hinge", range=(0, 2), unit="rad")
    profile = Profile(joint=joint, channels=Channels(friction=Resistance(components=(rub,))))
    prior_std = Parameters(profile, ("values",), away=((0.0, 0.3), (0.7, 1.0))).prior_std
    np.testing.assert_allclose(prior_std, [0.25, 0.5, 0.5, 0.125])  # at s = 0.2, 0.4, 0.6 and 1
    about = Parameters(profile, ("values",), away=((0.3, 1.0),)).about(profile)
    np.testing.assert_allclose(about.prior_std, [0.5, 0.125, 0.05, 0.05])
    flat = rub.model_copy(update={"interval": (0.0, 1.0), "x": (0.0, 1.0), "y": (1.0, 1.0)})
    channels = Channels(friction=Resistance(components=(flat,)))
    profile = profile.model_copy(update={"channels": channels})
    prior_std = Parameters(profile, ("values",), away=((0.0, 0.2), (0.7, 1.0))).prior_std
    np.testing.assert_allclose(prior_std, [0.25, 0.25])  # both ends away, half of it seen


def test_strengths_multiply_channels():
    profile = planted("detent_internal")
    p = Parameters(profile, ("strengths",))
    after = p.written(p.start * [2, 0.5, 3])
    s = np.linspace(0, 1, 101)
    for name, factor in zip(CHANNELS, (2, 0.5, 3), strict=True):
        was, now = (evaluate(getattr(q.channels, name), s)[0] for q in (profile, after))
        np.testing.assert_allclose(now, factor * was, atol=1e-12)


def test_ends_of_the_range_stay_where_they_are():
    profile = planted("constant_friction_hinge")
    part = profile.channels.friction.components[0].model_copy(update={"interval": (0.0, 1.0)})
    whole = Channels(friction=Resistance(components=(part,)))
    p = Parameters(profile.model_copy(update={"channels": whole}), ("intervals",))
    assert not len(p.start)


@pytest.mark.parametrize(("kind", "count"), [("hinge", 2), ("slide", 1)])
def test_a_slides_weight_is_one_number_and_a_hinges_two(kind, count):
    assert len(Parameters(planted("detent_internal", kind), ("gravity",)).start) == count


def test_a_step_for_differences_may_not_turn_an_interval_round():
    p = Parameters(planted("detent_internal"), ("intervals",))
    for ends in ([0.4, 0.398], [1.0, 1.002], [-0.002, 0.0]):
        theta = np.tile(ends, len(p.start) // 2)
        (a, b), *_ = (c.interval for c in p.written(theta, exact=True).channels.friction.components)
        assert 0 <= a < b <= 1


@pytest.mark.parametrize(
    "effect",
    [
        PreslidingFriction(stiffness=100.0, breakaway=1.0),
        EndStopRestitution(restitution=0.95),
        Backlash(play=0.02, inertia=1e-3, side="motor", share=0.99),
    ],
)
def test_a_step_for_differences_may_not_lead_beyond_what_an_effect_may_be(effect):
    p = Parameters(planted(NAMES[0]).with_effect(effect), ("effects",), inertia=1.0)
    for way in (0.01 * np.eye(len(p.start)), -0.01 * np.eye(len(p.start))):
        for step in way:
            after = p.written(p.start + step, exact=True).effects[0]
            assert type(after).model_validate(after.model_dump()) == after


@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_gravity_that_lacks_is_an_effect_of_the_profile(kind):
    p = Parameters(planted("detent_internal", kind), ("gravity",), gravity=2.0)
    assert not p.written(p.start).effects
    (offset,) = p.written(np.full(len(p.start), 0.25)).effects
    wanted = (0.5, 0.5, 0.0) if kind == "hinge" else (0.0, 0.0, 0.5)
    assert (offset.cos, offset.sin, offset.force) == wanted
    again = Parameters(p.written(np.full(len(p.start), 0.25)), ("gravity",), gravity=2.0)
    (more,) = again.written(np.full(len(p.start), 0.25)).effects
    assert (more.cos, more.sin, more.force) == tuple(2 * np.array(wanted))


@pytest.mark.parametrize("name", NAMES)
def test_sizes_make_components_larger_and_keep_their_shapes(name):
    p = Parameters(planted(name), ("sizes",))
    larger = p.written(np.full(len(p.start), np.log(3)), exact=True)
    s = np.linspace(0, 1, 101)
    for channel in CHANNELS:
        was, now = (evaluate(getattr(one.channels, channel), s)[0] for one in (p.profile, larger))
        np.testing.assert_allclose(now, 3 * was, atol=1e-12)
