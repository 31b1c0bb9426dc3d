"""The field in JAX: the same numbers as every other implementation, and safe derivatives."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from goldens import make_field
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from joda.component import Component
from joda.field import jaxfield, merge
from joda.profile import Channel, Joint, Profile

jax.config.update("jax_enable_x64", True)


GOLDENS = make_field.read()
SIZE = dict(components=20, knots=7)  # one shape for all, so that each function compiles once

evaluate_jax = jax.jit(jaxfield.evaluate)


def channel_of(case: make_field.Case) -> Channel:
    joint = Joint(name="door", type="hinge", range=(0, 1), unit="rad")
    attributes = {"conservative": case.text, "conservative_combine": case.combine}
    return Profile.from_attributes(joint, attributes).channels.conservative


def at(channel: jaxfield.Channel, s: np.ndarray) -> list[np.ndarray]:
    """Value and slope at up to 200 positions."""
    filled = np.pad(s, (0, 200 - len(s)))
    return [np.asarray(part)[: len(s)] for part in evaluate_jax(channel, filled)]


def assert_close(actual, expected, relative):
    scale = np.max(np.abs(expected), initial=0)
    np.testing.assert_allclose(actual, expected, rtol=0, atol=relative * scale)


def joint_model(y, x=None, interval=(0.0, 1.0)) -> Channel:
    x = np.linspace(0, 1, len(y)).tolist() if x is None else x
    return Channel(components=(Component(interval=interval, x=tuple(x), y=tuple(y)),))


# --- values


@pytest.mark.parametrize("golden", GOLDENS, ids=lambda case: case.name)
def test_field_agrees_with_the_goldens(golden):
    value, slope = at(jaxfield.from_channel(channel_of(golden), **SIZE), golden.s)
    assert value.dtype == np.float64
    assert_close(value, golden.value, 1e-12)
    assert_close(slope, golden.slope, 1e-12)


@pytest.mark.parametrize("golden", GOLDENS, ids=lambda case: case.name)
def test_single_precision_agrees_with_the_goldens(golden):
    channel = jaxfield.from_channel(channel_of(golden), **SIZE, dtype=jnp.float32)
    s = golden.s.astype(np.float32)
    value, slope = at(channel, s)
    assert value.dtype == slope.dtype == np.float32
    if golden.name.startswith("narrow"):
        # a thousandth of the range wide: single precision knows neither its ends nor s well enough,
        # so the reference gets the same rounded numbers
        whole = jax.tree.map(lambda leaf: leaf.astype(jnp.float64), channel)
        golden = golden._replace(**dict(zip(("value", "slope"), at(whole, s), strict=True)))
    assert_close(value, golden.value, 1e-5)
    assert_close(slope, golden.slope, 1e-5)


def test_random_components_agree_with_scipy():
    rng = np.random.default_rng(1)
    for _ in range(300):
        a, width = rng.uniform(0, 0.5), rng.uniform(0.01, 0.5)
        gaps = rng.uniform(0.2, 1, rng.integers(1, 7))
        x = np.concatenate(([0], np.cumsum(gaps)[:-1] / gaps.sum(), [1]))
        y = np.round(rng.normal(0, 1, len(x)), rng.choice((0, 5, 15)))
        u = np.concatenate((x, rng.uniform(0, 1, 12)))
        s = (a + width * u).clip(a, a + width)
        channel = joint_model(y.tolist(), x.tolist(), (a, a + width))
        value, slope = at(jaxfield.from_channel(channel, **SIZE), s)
        curve = PchipInterpolator(x, y)
        u = (s - a) / (a + width - a)
        assert_close(value, curve(u), 1e-12)
        assert_close(slope, curve(u, 1) / (a + width - a), 1e-12)


def test_a_channel_without_components_is_zero():
    value, slope = jaxfield.evaluate(jaxfield.from_channel(Channel()), np.linspace(-1, 2, 7))
    np.testing.assert_array_equal((value, slope), np.zeros((2, 7)))
    assert jaxfield.max_stiffness(jaxfield.from_channel(Channel()), 0, 1) == 0


@pytest.mark.parametrize("golden", GOLDENS, ids=lambda case: case.name)
def test_channels_survive_the_journey(golden):
    channel = channel_of(golden)
    labels = [component.label for component in channel.components]
    assert jaxfield.to_channel(jaxfield.from_channel(channel, **SIZE), labels) == channel


# --- the steepest descent


descent = jax.jit(jaxfield.max_stiffness)


@pytest.mark.slow
@pytest.mark.parametrize("combine", ["sum", "max"])
def test_max_descent_is_the_plugins(combine):
    """Over the whole range that of C++; over a part, that of the cubics that touch it."""
    rng = np.random.default_rng(3)
    for _ in range(40):
        parts = []
        for _ in range(rng.integers(1, 4)):
            a, b = np.sort(rng.choice(np.arange(0, 1.01, 0.05), 2, replace=False)).tolist()
            x = (0, *np.sort(rng.uniform(0.1, 0.9, 2)).tolist(), 1)
            y = tuple(rng.normal(0, 3, 4).tolist())
            parts.append(Component(interval=(a, b), x=x, y=y))
        channel = Channel(combine=combine, components=tuple(parts))
        merged = merge(channel)
        ours = jaxfield.from_channel(channel, components=3, knots=5)
        assert float(descent(ours, -0.1, 1.1)) == pytest.approx(merged.max_stiffness(), rel=1e-9)
        knots = merged.knots
        c = merged.cubics.T
        t = np.linspace(0, 1, 2001)[:, None] * np.diff(knots)
        steepest = (-(c[1] + t * (2 * c[2] + 3 * c[3] * t))).max(0).clip(0)
        for lo, hi in np.sort(rng.uniform(-0.2, 1.2, (10, 2)), axis=1):
            touched = (knots[:-1] <= hi) & (knots[1:] > lo)
            expected = np.max(steepest[touched], initial=0)
            scale = max(np.abs(steepest).max(), 1)
            assert float(descent(ours, lo, hi)) == pytest.approx(expected, abs=1e-5 * scale)


# --- derivatives

FIELDS = ("a", "b", "x", "y", "strength")


@jax.jit
def gradient(channel, s):
    """d value / d of every number of the channel, and d / ds; value and slope besides."""
    value, slope = jaxfield.evaluate(channel, s)
    by, by_s = jax.grad(lambda c, s: jaxfield.evaluate(c, s)[0], argnums=(0, 1))(channel, s)
    return by, by_s, value, slope


def differences(channel, s, name, index, eps=1e-6):
    """Backward and forward difference by one number."""
    leaf = getattr(channel, name)
    values = []
    for step in (-eps, 0, eps):
        moved = leaf.at[index].add(step)
        changed = channel.replace(**{name: moved})
        values.append(float(evaluate_jax(changed, np.full(200, s))[0][0]))
    return np.diff(values) / eps


marks = st.lists(st.integers(0, 20), min_size=2, max_size=5, unique=True).map(sorted)
values = st.sampled_from((0.0, 1.0, -1.0, 2.0)) | st.floats(-10, 10)


@st.composite
def drawn_components(draw) -> Component:
    (a, b), inside = draw(marks)[:2], draw(marks)
    x = tuple((mark - inside[0]) / (inside[-1] - inside[0]) for mark in inside)
    y = draw(st.lists(values, min_size=len(x), max_size=len(x)))
    return Component(interval=(a / 20, b / 20), x=x, y=tuple(y))


@pytest.mark.slow
@settings(deadline=None, max_examples=150)
@given(
    st.lists(drawn_components(), min_size=1, max_size=3),
    st.sampled_from(("sum", "max")),
    st.integers(0, 20).map(lambda k: k / 20) | st.floats(-0.1, 1.1),
)
def test_gradients_are_finite_and_the_slope_is_the_derivative(parts, combine, s):
    """At knots and ends of intervals, on flat parts and at equal neighbours too."""
    channel = Channel(combine=combine, components=tuple(parts))
    by, by_s, value, slope = gradient(jaxfield.from_channel(channel, components=3, knots=5), s)
    for name in FIELDS:
        assert np.isfinite(getattr(by, name)).all(), name
    scale = 1 + max(abs(v) for part in parts for v in part.y)
    assert float(by_s) == pytest.approx(float(slope), abs=1e-9 * scale * 1e3)
    # every value is made of control values: their derivatives give it back (Euler, degree 1)
    y = jaxfield.from_channel(channel, components=3, knots=5).y
    assert float((by.y * y).sum()) == pytest.approx(float(value), abs=1e-9 * scale)
    assert float(by.strength) == pytest.approx(float(value), abs=1e-9 * scale)


@settings(deadline=None, max_examples=60)
@given(drawn_components(), st.integers(0, 20).map(lambda k: k / 20) | st.floats(0, 1))
def test_gradients_by_control_values_lie_between_the_one_sided_differences(part, s):
    channel = jaxfield.from_channel(Channel(components=(part,)), components=3, knots=5)
    by, *_ = gradient(channel, s)
    scale = 1 + max(map(abs, part.y))
    for k in range(len(part.x)):
        sides = differences(channel, s, "y", (0, k))
        low, high = sides.min() - 1e-4 * scale, sides.max() + 1e-4 * scale
        # on flat and nearly flat parts the derivative may be another direction's
        flat = np.abs(np.diff(part.y)).min() < 1e-9 * scale
        assert low <= float(by.y[0, k]) <= high or flat


@pytest.mark.slow
@pytest.mark.parametrize("combine", ["sum", "max"])
def test_gradients_by_everything_are_central_differences(combine):
    first = Component(interval=(0.1, 0.8), x=(0, 0.3, 0.5, 0.9, 1), y=(1, 2, 1.5, -3, 0.5))
    second = Component(interval=(0.3, 0.95), x=(0, 0.4, 0.7, 1), y=(-1, 2.2, 2.5, 4))
    channel = jaxfield.from_channel(
        Channel(combine=combine, components=(first, second)), components=3, knots=5
    )
    seen = dict.fromkeys(FIELDS, 0)
    for s in np.linspace(0.11, 0.94, 23):
        by, *_ = gradient(channel, s)
        for name in FIELDS:
            for index in np.ndindex(getattr(channel, name).shape):
                expected = differences(channel, s, name, index).mean()
                actual = float(getattr(by, name)[index])
                assert actual == pytest.approx(expected, rel=1e-6, abs=1e-6), (name, index, s)
                seen[name] += actual != 0
    assert min(seen.values()) >= 20


@pytest.mark.parametrize("s", [0.0, 0.2, 0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize(
    "y", [(2, 2, 2, 2, 2), (0, 1, 1, 1, 4), (0, 0, 0, 0, 0)], ids=["flat", "partly", "zero"]
)
def test_no_gradient_vanishes_by_accident(y, s):
    """A flat curve answers to its control values, also where it is zero, at a knot or at an end."""
    by, *_ = gradient(jaxfield.from_channel(joint_model(y), components=3, knots=5), s)
    assert float(by.y[0].sum()) == pytest.approx(1, abs=1e-12)  # all raised by 1: the value too
    nearest = round(4 * s)
    assert float(by.y[0, nearest]) > 0.5


def test_ends_of_intervals_move_the_curve_at_their_own_place():
    channel = jaxfield.from_channel(
        joint_model((1, 3, 2), interval=(0.2, 0.7)), components=3, knots=5
    )
    by, by_s, _, slope = gradient(channel, 0.2)
    assert float(by_s) == pytest.approx(float(slope))
    assert float(by.a[0]) == pytest.approx(-float(slope))
    by, _, _, slope = gradient(channel, 0.7)
    assert float(by.b[0]) == pytest.approx(-float(slope)) and float(slope) != 0


def test_strength_has_a_derivative_at_zero():
    whole = jaxfield.from_channel(joint_model((1, 3, 2)), components=3, knots=5)
    by, *_ = gradient(whole.replace(strength=jnp.zeros(())), 0.3)
    assert float(by.strength) == pytest.approx(float(gradient(whole, 0.3)[2]), rel=1e-12)


def test_profiles_are_mapped_over():
    """One compiled function for profiles of any number of components and control points."""
    cases = [case for case in GOLDENS if case.combine == "sum"]
    stacked = jax.tree.map(
        lambda *leaves: jnp.stack(leaves),
        *(jaxfield.from_channel(channel_of(case), **SIZE) for case in cases),
    )
    s = np.linspace(-0.1, 1.1, 97)
    values, slopes = jax.jit(jax.vmap(partial(jaxfield.evaluate), (0, None)))(stacked, s)
    for case, value, slope in zip(cases, values, slopes, strict=True):
        curves = [make_field.Curve(*c.interval, c.x, c.y) for c in channel_of(case).components]
        expected, expected_slope, _ = make_field.evaluate(curves, s, case.combine)
        assert_close(value, expected, 1e-12)
        assert_close(slope, expected_slope, 1e-12)
