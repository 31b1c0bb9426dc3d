"""The smoother: noise is estimated as it is, velocity as well as it says."""

from functools import cache

import numpy as np
import pytest

from joda.measured.smoothing import begins_at_rest, noise, pace, pooled_noise, smooth

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


FINE = 1e-4
"""Timestep (s) of the doors below."""


@cache
def shut(speed: float) -> np.ndarray:
    """A door that drifts, snaps shut at about `speed` (rad/s) and stops: position and velocity."""
    q, v, out = 0.9, 0.0, []
    for _ in range(16001):
        out.append((q, v))
        s = q / 0.25
        magnet = 15 * speed**2 * s * (1 - s) if 0 < s < 1 else 0.0
        stop = 2500 * q + 30 * v if q < 0 else 0.0
        v -= FINE * (0.8 + 0.5 * v + magnet + stop)
        q += FINE * v
    return np.array(out).T


@cache
def knocking(speed: float) -> np.ndarray:
    """A door that falls on a hard stop at `speed` (rad/s) and rebounds: position and velocity."""
    q, v, out = 0.2 * speed, 0.0, []
    for _ in range(16001):
        out.append((q, v))
        v -= FINE * speed / 0.4
        q += FINE * v
        q, v = (-q, -0.4 * v) if q < 0 else (q, v)
    return np.array(out).T


@cache
def swinging(speed: float, rate=6.0) -> np.ndarray:
    """A sinusoid of that greatest speed (rad/s) and rate (rad/s): position and velocity."""
    phase = rate * FINE * np.arange(16001)
    return speed * np.array([np.sin(phase) / rate, np.cos(phase)])


def stated_and_true(motion: np.ndarray, hertz: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """Stated and true errors of velocity, at a hundred times a second of three recordings."""
    every = round(1 / (FINE * hertz))
    q, v = motion[:, ::every]
    t = FINE * every * np.arange(len(q))
    found = []
    for seed in range(3):
        y = q + np.random.default_rng(seed).normal(0, sigma, len(q))
        some = slice(None, None, hertz // 100)
        smoothed = smooth(t, y, t[some], noise(t, y))
        found.append((smoothed.velocity_error, smoothed.velocity - v[some]))
    stated, true = np.concatenate(found, axis=1)
    return stated, true


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [2e-4, 2e-3])
@pytest.mark.parametrize("hertz", [100, 200, 1000])
@pytest.mark.parametrize("speed", [1, 3, 6])
@pytest.mark.parametrize("motion", [shut, knocking, swinging])
def test_fast_motion_and_snaps_have_the_velocity_errors_that_are_stated(
    motion, speed, hertz, sigma
):
    stated, true = stated_and_true(motion(speed), hertz, sigma)
    assert np.mean(np.abs(true) < 2 * stated) > 0.9


@pytest.mark.parametrize("sigma", [2e-4, 2e-3])
@pytest.mark.parametrize("hertz", [100, 200, 1000])
@pytest.mark.parametrize("speed", [1, 3, 6])
def test_slow_turns_do_not_have_their_velocity_error_overstated(speed, hertz, sigma):
    stated, true = stated_and_true(swinging(speed, 1.5), hertz, sigma)
    assert np.sqrt(np.mean(stated**2) / np.mean(true**2)) < 5


# --- pace
@pytest.mark.parametrize("stroke", [0.015, 0.06])
def test_a_fast_stroke_has_its_own_pace_and_its_velocity_is_not_smeared(stroke):
    """A button that springs back and then rests: half a sine, in 1 kHz samples."""
    t = np.arange(0, 0.4, 0.001)
    inside = np.clip((t - 0.05) / stroke, 0, 1)
    y = 2e-3 * (1 - np.cos(np.pi * inside))
    sigma = 2e-6
    noisy = y + np.random.default_rng().normal(0, sigma, len(t))
    assert 0.2 * stroke < pace(t, noisy, sigma) < stroke
    middle = np.array([0.05 + stroke / 2])
    found = smooth(t, noisy, middle, sigma)
    assert found.velocity[0] == pytest.approx(np.pi * 2e-3 / stroke, rel=0.15)  # of 7 samples


def test_what_does_not_move_has_no_pace():
    t = np.arange(0, 1, 0.005)
    assert pace(t, np.random.default_rng().normal(0, SIGMA, len(t)), SIGMA) == np.inf


# --- noise
@pytest.mark.parametrize("step", [1.0, 3.0, 6.0])
@pytest.mark.parametrize("hertz", [50, 200, 1000])
def test_the_noise_of_a_noisy_and_quantised_position_that_mostly_rests(step, hertz):
    """Stretches in which no sample differs tell nothing; a run that only rests has that of all."""
    rng = np.random.default_rng()
    t = np.arange(0, 4, 1 / hertz)
    moves = np.where(t < 3, 0.0, np.sin(3 * (t - 3)))
    quantum = step * SIGMA
    runs = [(t, np.round((moves + rng.normal(0, SIGMA, len(t))) / quantum) * quantum)]
    runs.append((t, np.zeros(len(t))))
    true = np.hypot(SIGMA, quantum / 12**0.5)
    assert 0.7 * true < pooled_noise(runs) < 2 * true  # of 50 samples that move


# --- a button that is flicked, let go or left alone, at 1 kHz, in steps of three noises
FLICKED = 1e-3 * np.arange(200)


def pressed(path: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(4)
    return 3e-3 * np.round((path + 1e-3 * rng.standard_normal(len(path))) / 3e-3)


@pytest.mark.parametrize("way", [-1, 1])
def test_a_flicked_button_does_not_begin_at_rest_and_has_its_own_pace(way):
    """It stops after 10 ms and rests for 190."""
    for travel in (0.05, 0.1, 0.3):
        path = way * travel * (1 - np.clip(1 - FLICKED / 0.01, 0, None) ** 2)
        assert not begins_at_rest(FLICKED, pressed(path), 1.3e-3)
        assert 0.003 < pace(FLICKED, pressed(path), 1.3e-3) < 0.02


@pytest.mark.parametrize("before", [0.0, 0.02])
def test_what_is_let_go_or_flicked_later_begins_at_rest(before):
    after = np.clip(FLICKED - before, 0, None)
    let_go = np.minimum((after / 0.05) ** 2, 1.0)
    assert begins_at_rest(FLICKED, pressed(let_go), 1.3e-3)
    if before:
        assert begins_at_rest(FLICKED, pressed(np.minimum(after / 0.02, 1.0)), 1.3e-3)


def test_a_lid_that_falls_begins_at_rest_or_moves_as_its_whole_fall_tells():
    """Near its first sample alone a velocity of 0.5 rad/s is within four standard errors."""
    time, rng = np.arange(0, 0.16, 0.005), np.random.default_rng(0)

    def at_rest(speed):
        path = 1.0 + speed * time - 9.7 * time**2 + 1.7e-3 * rng.standard_normal(len(time))
        return begins_at_rest(time, path, 1.7e-3)

    assert sum(at_rest(0.0) for _ in range(100)) > 85
    assert not any(at_rest(-0.5) for _ in range(100))


def test_two_outliers_are_no_pace():
    path = pressed(0 * FLICKED)
    path[[60, 130]] += 1.0
    assert pace(FLICKED, path, 1.3e-3) > 0.1
