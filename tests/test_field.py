"""The field in C++: against SciPy, and what PCHIP promises."""

from itertools import pairwise

import numpy as np
import pytest
from goldens import make_field
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from joda.component import MIN_WIDTH, Component
from joda.field import evaluate, merge
from joda.profile import Channel, Joint, Profile

GOLDENS = make_field.read()


def scipys(channel: Channel, s) -> tuple:
    """Value, slope, and whether the slope is either of two, by SciPy."""
    curves = [make_field.Curve(*part.interval, part.x, part.y) for part in channel.components]
    return make_field.evaluate(curves, np.asarray(s), channel.combine)


def assert_close(actual, expected, scale=None, relative=1e-12):
    """Equal within `relative` of `scale`, by default the largest magnitude that is expected."""
    scale = np.max(np.abs(expected), initial=0) if scale is None else scale
    np.testing.assert_allclose(actual, expected, rtol=0, atol=relative * scale)


def random_component(rng: np.random.Generator) -> Component:
    """A component 0.01 to 1 wide with 2 to 8 control points, every third one with flat parts."""
    width = rng.uniform(0.01, 1)
    a = rng.uniform(0, 1 - width)
    gaps = rng.uniform(0.2, 1, rng.integers(1, 8))
    x = (0, *(np.cumsum(gaps)[:-1] / gaps.sum()).tolist(), 1)
    y = np.round(rng.normal(0, 1, len(x)), rng.choice((0, 5, 15)))
    return Component(interval=(a, a + width), x=x, y=tuple(y.tolist()))


# --- SciPy


def test_goldens_are_what_scipy_gives_today():
    today = make_field.cases()
    assert [case[:3] for case in GOLDENS] == [case[:3] for case in today]
    for stored, case in zip(GOLDENS, today, strict=True):
        np.testing.assert_array_equal(stored.s, case.s)
        assert_close(stored.value, case.value, relative=1e-13)
        assert_close(stored.slope, case.slope, relative=1e-13)


@pytest.mark.parametrize("golden", GOLDENS, ids=lambda case: case.name)
def test_field_agrees_with_the_goldens(golden):
    joint = Joint(name="door", type="hinge", range=(0, 1), unit="rad")
    attributes = {"conservative": golden.text, "conservative_combine": golden.combine}
    channel = Profile.from_attributes(joint, attributes).channels.conservative
    value, slope = evaluate(channel, golden.s)
    assert_close(value, golden.value)
    assert_close(slope, golden.slope)


def test_field_agrees_with_scipy_on_ten_thousand_random_components():
    rng = np.random.default_rng(1)
    for _ in range(10_000):
        component = random_component(rng)
        a, b = component.interval
        s = a + (b - a) * np.concatenate((component.x, rng.uniform(0, 1, 12)))
        s = s.clip(a, b)
        u = (s - a) / (b - a)
        curve = PchipInterpolator(component.x, component.y)
        expected, expected_slope = curve(u), curve(u, 1) / (b - a)
        value, slope = evaluate(Channel(components=(component,)), s)
        assert_close(value, expected)
        assert_close(slope, expected_slope)


@pytest.mark.parametrize("combine", ["sum", "max"])
def test_field_agrees_with_scipy_on_random_combinations(combine):
    rng = np.random.default_rng(2)
    for _ in range(1000):
        components = tuple(random_component(rng) for _ in range(rng.integers(1, 7)))
        channel = Channel(combine=combine, components=components)
        knots = merge(channel).knots
        ends = np.array([component.interval for component in components]).ravel()
        s = np.concatenate((rng.uniform(-0.1, 1.1, 100), ends, knots))
        value, slope = evaluate(channel, s)
        expected, expected_slope, unclear = scipys(channel, s)
        assert_close(value, expected, scale=sum(max(map(abs, c.y)) for c in components))
        clear = (np.abs(s[:, None] - knots).min(1) > 1e-9) | (np.isin(s, ends) & ~unclear)
        scale = np.abs(expected_slope).max()
        assert_close(slope[clear], expected_slope[clear], scale=scale)


def test_a_position_that_is_not_a_number_is_covered_by_nothing():
    channel = Channel(components=(Component(interval=(0, 1), x=(0, 1), y=(1, 3)),))
    value, slope = evaluate(channel, [np.nan, np.inf])
    np.testing.assert_array_equal(value, [0, 3])
    np.testing.assert_array_equal(slope, [0, 0])


# --- what PCHIP promises

marks = st.lists(st.integers(0, 100), min_size=2, max_size=7, unique=True).map(sorted)
values = st.floats(-100, 100) | st.sampled_from((0.0, 1.0, -1.0))


@st.composite
def drawn_components(draw) -> Component:
    (a, b), inside = draw(marks)[:2], draw(marks)
    x = tuple((mark - inside[0]) / (inside[-1] - inside[0]) for mark in inside)
    y = draw(st.lists(values, min_size=len(x), max_size=len(x)))
    return Component(interval=(a / 100, b / 100), x=x, y=tuple(y))


drawn_channels = st.builds(
    Channel,
    combine=st.sampled_from(("sum", "max")),
    components=st.lists(drawn_components(), max_size=4).map(tuple),
)


@settings(deadline=None)
@given(drawn_channels)
def test_max_descent_is_the_steepest_descent_of_a_dense_sampling(channel):
    merged = merge(channel)
    inside = np.linspace(1e-9, 1 - 1e-9, 400)
    pieces = [(left, right) for left, right in pairwise(merged.knots) if right - left > 1e-6]
    slopes = [merged(left + (right - left) * inside)[1] for left, right in pieces]
    slopes = np.concatenate((*slopes, [0]))
    assert -slopes.min() <= merged.max_stiffness() * (1 + 1e-9)
    if channel.combine == "sum" or len(pieces) == len(merged.knots) - 1:
        assert -slopes.min() >= merged.max_stiffness() - 1e-4 * np.abs(slopes).max()


@settings(deadline=None)
@given(drawn_components(), st.booleans())
def test_monotone_data_give_a_monotone_curve(component, falling):
    y = tuple(sorted(component.y, reverse=falling))
    channel = Channel(components=(component.model_copy(update={"y": y}),))
    s = np.linspace(*component.interval, 300).clip(*component.interval)
    value, _ = evaluate(channel, s)
    steps = -np.diff(value) if falling else np.diff(value)
    assert steps.min() >= -1e-9


@settings(deadline=None)
@given(st.lists(st.floats(-1e15, 1e15) | st.floats(-1e-300, 1e-300), min_size=3, max_size=5))
def test_extreme_values_and_gaps_stay_within_the_control_points(y):
    x = np.linspace(0, 1, len(y))
    x[1] = MIN_WIDTH
    channel = Channel(components=(Component(interval=(0, 1), x=tuple(x.tolist()), y=tuple(y)),))
    s = np.concatenate((np.linspace(0, 1, 50), np.linspace(0, MIN_WIDTH, 50)))
    tolerance = 1e-9 * max(map(abs, y)) + 1e-300
    value, slope = evaluate(channel, s)
    assert min(y) - tolerance <= value.min() <= value.max() <= max(y) + tolerance
    assert np.isfinite(slope).all()
