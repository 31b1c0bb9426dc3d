"""Hidden laws of speed and position together, of time, and of direction: their closed forms."""

import numpy as np
import pytest

from joda.hidden import uncatalogued_laws

ZERO, ONE = np.zeros(1), np.ones(1)


def test_a_wave_fades_to_half_at_its_velocity():
    law = uncatalogued_laws.FadingWave(2.0, 1.0, 0.0, 0.5)
    quarter = np.array([0.25])
    assert law.force(quarter, ZERO, ZERO, ZERO) == pytest.approx(2.0)
    for v in (0.5, -0.5):
        assert law.force(quarter, ZERO, v * ONE, ZERO) == pytest.approx(1.0)
    assert law.force(np.array([0.5]), ZERO, ZERO, ZERO) == pytest.approx(0.0, abs=1e-12)


def test_a_drift_comes_with_time():
    law = uncatalogued_laws.Drift(-3.0, 2.0)
    assert law.force(ZERO, ZERO, ZERO, ZERO) == pytest.approx(0.0)
    assert law.force(ZERO, ZERO, ZERO, 2 * ONE) == pytest.approx(-3 * (1 - np.exp(-1)))
    assert law.force(ZERO, ZERO, ZERO, 100 * ONE) == pytest.approx(-3.0)


def test_a_tremor_has_its_size_and_no_mean():
    law = uncatalogued_laws.Tremor(0.7, (1.0, np.sqrt(2), np.pi), (0.0, 1.0, 2.0))
    t = np.linspace(0, 2000, 400_001)
    force = law.force(0 * t, 0 * t, 0 * t, t)
    assert np.sqrt(np.mean(force**2)) == pytest.approx(0.7, rel=0.01)
    assert np.mean(force) == pytest.approx(0.0, abs=0.01)


def test_a_ratchet_resists_one_way_and_rises_along_each_tooth():
    law, s = uncatalogued_laws.Ratchet(4.0, 10.0, -1), np.array([0.0, 0.05, 0.099, 0.15])
    limits = law.limit(s, 0 * s, np.full(4, -1.0), 0 * s, 0 * s)
    assert limits == pytest.approx([0.0, 2.0, 3.96, 2.0])
    assert not law.limit(s, 0 * s, np.ones(4), 0 * s, 0 * s).any()
