"""What drives a joint away within usual segments is named in much shorter ones."""

from functools import partial

import numpy as np
import pytest

from joda.diagnosis.baseline import fit_baseline, fit_segments
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shorter_segments import telling
from joda.diagnosis.verdict import diagnosed
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run

TELLING = SETTINGS.search.most_missed

INERTIA, FRICTION, DAMPING, HIGH = 3e-5, 0.004, 3e-4, 4.7
SIGMA, FORCE_SIGMA, EVERY = 5e-4, 2e-4, 2e-3
SCENE = f"""<mujoco>
  <compiler angle="radian"/>
  <option timestep="5e-4" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="knob" axis="0 0 1" range="0 {HIGH}" limited="true"
             frictionloss="{FRICTION}" damping="{DAMPING}"/>
      <inertial pos="0 0 0" mass="0.03" diaginertia="2e-5 2e-5 {INERTIA}"/>
    </body>
  </worldbody>
</mujoco>
"""


def turned(rng, strength, width, place, seconds=3.0, h=1e-4):
    """A light knob that a soft hand turns through a Gaussian well: time, positions, forces."""
    rates, phases = rng.uniform(0.2, 0.6, 3), rng.uniform(0, 2 * np.pi, 3)
    parts = rng.uniform(0.5, 1.0, 3)
    parts *= 0.5 * HIGH / parts.sum()
    t = h * np.arange(round(seconds / h))
    angle = 2 * np.pi * rates * t[:, None] + phases
    to = HIGH / 2 + (parts * np.sin(angle)).sum(axis=1)
    speed = (parts * 2 * np.pi * rates * np.cos(angle)).sum(axis=1)
    q, v = to[0], 0.0
    positions, forces = np.empty(len(t)), np.empty(len(t))
    for k in range(len(t)):
        force = 0.06 * (to[k] - q) + 4e-4 * (speed[k] - v)
        positions[k], forces[k] = q, force
        away = (q - place) / width
        pushed = force - strength * away * np.exp(0.5 * (1 - away**2))
        moved = (v + h * pushed / INERTIA) / (1 + h * DAMPING / INERTIA)
        v = np.sign(moved) * max(abs(moved) - h * FRICTION / INERTIA, 0.0)
        q += h * v
    every = round(EVERY / h)
    return t[::every], positions[::every], forces[::every]


def knob(folder, rng, strength, width, place, count=5):
    """Its runs, and a model without the well."""
    (folder / "model.xml").write_text(SCENE)
    files = [folder / f"run{k}.csv" for k in range(count)]
    for file in files:
        t, q, force = turned(rng, strength, width, place)
        seen = q + SIGMA * rng.standard_normal(len(t))
        told = force + FORCE_SIGMA * rng.standard_normal(len(t))
        write_run(file, Run(file.name, t, seen, None, told, True))
    return read_measured(folder / "model.xml", "knob", files)


@pytest.mark.long
def test_a_detent_that_drives_a_light_knob_away_is_named(tmp_path):
    """In half a second the knob falls into it, swings there and rests; a model in which it falls a
    little later, or not, is as wrong as one without."""
    rng = np.random.default_rng()
    strength, width, place = (
        rng.uniform(0.015, 0.025),
        rng.uniform(0.2, 0.35),
        rng.uniform(1.8, 2.9),
    )
    found = diagnosed(knob(tmp_path, rng, strength, width, place)).diagnosis
    first = found.effects[0]
    assert first.effect == "detent_internal"
    assert first.probability > 0.5
    assert first.interval[0] < place / HIGH < first.interval[1]
    assert first.magnitude == pytest.approx(strength, abs=max(3 * first.magnitude_error, 0.005))


def test_some_of_the_segments_tell_most(tmp_path):
    """Those that are missed most, and of the others each so many-th."""
    rng = np.random.default_rng()
    measured = knob(tmp_path, rng, 0.02, 0.3, 2.4, count=3)
    usual = fit_baseline(measured)
    length = usual.estimator.segments.length / 9
    some = fit_segments(measured, partial(telling, measured, length, usual.fit.x), usual.fit.x)
    whole = fit_baseline(measured, length, usual.fit.x)
    every = whole.estimator.begun(whole.base.simulator, usual.fit.x).squares
    own = some.estimator.begun(some.base.simulator, usual.fit.x).squares
    assert 2 * TELLING <= len(own) <= 3 * TELLING < len(every)
    assert np.sort(own)[-TELLING:] == pytest.approx(np.sort(every)[-TELLING:], rel=0.2)
    assert np.sort(own)[TELLING // 2] < 0.1 * np.sort(own)[-TELLING // 2]
