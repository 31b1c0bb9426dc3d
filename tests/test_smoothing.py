"""The smoother: noise is estimated as it is, velocity without bias."""

import numpy as np
import pytest

from joda.smoothing import noise, smooth

SIGMA = 1e-3


def times(even: bool, rng, n=1500):
    gaps = np.full(n, 0.005) if even else rng.uniform(0.003, 0.007, n)
    return np.cumsum(gaps)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("motion", ["rest", "swing", "knocks"])
def test_the_noise_is_found_within_a_tenth_whatever_the_motion(even, motion):
    rng = np.random.default_rng(1)
    t = times(even, rng)
    y = {"rest": 0 * t, "swing": np.sin(5 * t), "knocks": np.abs(np.sin(3 * t))}[motion]
    assert noise(t, y + rng.normal(0, SIGMA, len(t))) == pytest.approx(SIGMA, rel=0.1)


def test_a_clean_motion_has_hardly_any_noise():
    t = np.arange(0, 3, 0.005)
    assert noise(t, t**3) < 1e-9
    assert noise(t, np.sin(5 * t)) < 1e-6


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("curved", ["parabola", "sinusoid"])
def test_velocity_is_right_within_its_error(even, curved):
    rng = np.random.default_rng(2)
    t = times(even, rng)
    y, v = (3 * t - t**2, 3 - 2 * t) if curved == "parabola" else (np.sin(3 * t), 3 * np.cos(3 * t))
    at = t[5:-5:20]
    found = smooth(t, y + rng.normal(0, SIGMA, len(t)), at, SIGMA)
    off = (found.velocity - np.interp(at, t, v)) / found.velocity_error
    assert abs(off.mean()) < 0.25
    assert np.mean(np.abs(off) < 2) > 0.9
    off = (found.position - np.interp(at, t, y)) / found.position_error
    assert np.mean(np.abs(off) < 2) > 0.9
