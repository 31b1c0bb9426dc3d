"""How bouncy each end of a range is, by the impacts in measured runs."""

import numpy as np
import pytest
from hidden_cases import read

from joda.diagnosis.baseline import RESTITUTION, fit_baseline
from joda.diagnosis.impacts import IMPACT_SAMPLES, mean_of, speed_ratios
from joda.diagnosis.verdict import diagnosed
from joda.hidden import draw
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run

SOLREF = 'damping="0.05" solreflimit="{}"/>'
SIGMA, HERTZ = 2e-4, 250
SLIDE = """<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" range="0 0.5" damping="0.05"/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


def bouncing(start: float, speed: float, low: float, high: float, seconds: float) -> np.ndarray:
    """Positions of a mass with the slide's damping between ends of these restitutions, in closed
    form from one impact to the next: v exp(-c t), x + v / c (1 - exp(-c t))."""
    c, x, v, t0, out = 0.05, start, speed, 0.0, []
    for t in np.arange(round(seconds * HERTZ)) / HERTZ:
        while True:
            end, e = (0.5, high) if v > 0 else (0.0, low)
            part = 1 - c * (end - x) / v if v else -1.0
            hit = t0 - np.log(part) / c if part > 0 else np.inf
            if hit > t or abs(v) < 1e-4:
                break
            x, v, t0 = end, -e * v * part, hit
        out.append(x + v / c * (1 - np.exp(-c * (t - t0))))
    return np.array(out)


def slide(folder, low, high, rng, solref="0.02 1"):
    """A joint with runs that meet each end at several speeds."""
    (folder / "slide.xml").write_text(SLIDE.replace('damping="0.05"/>', SOLREF.format(solref)))
    runs = []
    for k, speed in enumerate((0.5, -0.6, 0.9, -0.8, 0.7, -1.0)):
        position = bouncing(0.5 * rng.uniform(0.3, 0.7), speed, low, high, 1.2)
        noisy = position + SIGMA * rng.standard_normal(len(position))
        time = np.arange(len(position)) / HERTZ
        run = Run(f"run{k}.csv", time, noisy, None, np.zeros(len(time)), False)
        write_run(folder / run.name, run)
        runs.append(folder / run.name)
    return read_measured(folder / "slide.xml", "slide", runs)


@pytest.mark.parametrize(("low", "high"), [(0.1, 0.6), (0.45, 0.08), (0.35, 0.35)])
def test_the_restitution_of_each_end_is_measured(tmp_path, low, high):
    baseline = fit_baseline(slide(tmp_path, low, high, np.random.default_rng()))
    for side, true in ((-1, low), (1, high)):
        measured = speed_ratios(baseline.estimator.segments, baseline.base, [side])
        mean, error = mean_of(measured)
        assert len(measured) >= 2
        assert abs(mean - true) < max(4 * error, 0.02)


def test_a_force_that_presses_on_an_end_is_no_part_of_its_restitution(tmp_path, rng):
    """A mass that is pressed to its low end by 40 N from 0.2 to 0.4 m, and thrown back with 0.4 of
    its speed, again and again; 0.3 would be told from the speeds 10 ms before and after."""
    (tmp_path / "slide.xml").write_text(SLIDE.replace('damping="0.05"/>', SOLREF.format("0.02 1")))
    runs = []
    for k, height in enumerate(np.linspace(0.2, 0.4, 6)):
        time = np.arange(200) / HERTZ
        fall = np.sqrt(2 * height / 40)
        hits = np.cumsum([fall, *(2 * fall * 0.4 ** np.arange(1, 12))])
        n = np.searchsorted(hits, time, side="right")
        begun, speed = np.append(0.0, hits)[n], 40 * fall * 0.4**n
        flown = time - begun
        position = np.where(n == 0, height, speed * flown) - 20 * flown**2
        noisy = np.maximum(position, 0.0) + SIGMA * rng.standard_normal(len(time))
        run = Run(f"run{k}.csv", time, noisy, None, np.full(len(time), -40.0), True)
        write_run(tmp_path / run.name, run)
        runs.append(tmp_path / run.name)
    baseline = fit_baseline(read_measured(tmp_path / "slide.xml", "slide", runs))
    measured = speed_ratios(baseline.estimator.segments, baseline.base, [-1])
    mean, error = mean_of(measured)
    assert len(measured) >= 6
    assert abs(mean - 0.4) < max(4 * error, 0.04)


def ends_named(found):
    return [one.interval for one in found.effects if one.effect == RESTITUTION]


@pytest.mark.slow
@pytest.mark.sweep(2)
@pytest.mark.parametrize(
    ("low", "high", "place"),
    [(0.1, 0.6, (0.98, 1.0)), (0.5, 0.1, (0.0, 0.02)), (0.4, 0.45, (0.0, 1.0)), (0.1, 0.1, None)],
)
def test_the_end_that_is_bouncy_is_named(tmp_path, low, high, place):
    found = diagnosed(slide(tmp_path, low, high, np.random.default_rng())).diagnosis
    if place is None:
        assert found.verdict == "adequate"
        return
    assert found.effects[0].effect == RESTITUTION
    assert found.effects[0].interval == place
    true = low if place == (0.0, 0.02) else high
    assert abs(found.effects[0].magnitude - true) < 3 * found.effects[0].magnitude_error


@pytest.mark.parametrize(
    ("low", "high", "sides"), [(0.1, 0.6, {1}), (0.5, 0.1, {-1}), (0.1, 0.1, set())]
)
def test_an_end_whose_speeds_tell_that_it_is_no_bouncier_is_not_tried(tmp_path, low, high, sides):
    baseline = fit_baseline(slide(tmp_path, low, high, np.random.default_rng()))
    assert set(baseline.impacts) == sides


@pytest.mark.slow
@pytest.mark.parametrize(("high", "restitution"), [(0.6, True), (0.13, False)])
def test_a_stop_of_another_stiffness_is_not_taken_for_a_bouncy_one(tmp_path, high, restitution):
    """The joint's stops are rigid; the model's yield for a third of a segment."""
    measured = slide(tmp_path, 0.13, high, np.random.default_rng(), "0.06 1")
    found = diagnosed(measured).diagnosis
    assert ends_named(found)[:1] == ([(0.98, 1.0)] if restitution else [])
    if not restitution:
        assert found.verdict == "adequate"
        assert "From where the joint comes to an end" in found.summary


def buffered(start, speed, rate, seconds):
    """Positions of the same mass that meets a spring and a damper at the high end, critically
    damped, which push only: v t exp(-r t) deep until t = 2 / r, then thrown back at v exp(-2)."""
    c, t = 0.05, np.arange(round(seconds * HERTZ)) / HERTZ
    hit = -np.log(1 - c * (0.5 - start) / speed) / c
    v = speed * np.exp(-c * hit)
    since = np.maximum(t - hit, 0.0)
    off = np.maximum(since - 2 / rate, 0.0)
    deep = 2 / rate * np.exp(-2) - np.exp(-2) / c * (1 - np.exp(-c * off))
    inside = v * np.where(off > 0, deep, since * np.exp(-rate * since))
    return np.where(t < hit, start + speed / c * (1 - np.exp(-c * t)), 0.5 + inside)


@pytest.mark.slow
@pytest.mark.parametrize("rate", [80, 113])
def test_a_buffer_that_throws_back_hardly_more_than_the_models_stop_is_none(tmp_path, rng, rate):
    (tmp_path / "slide.xml").write_text(SLIDE.replace('damping="0.05"/>', SOLREF.format("0.005 1")))
    runs = [tmp_path / f"run{k}.csv" for k in range(5)]
    for run, speed in zip(runs, rng.uniform(0.4, 1.2, len(runs)), strict=True):
        position = buffered(rng.uniform(0.1, 0.3), speed, rate, 1.2)
        off = int(np.argmax(position > 0.5)) + round(2 / rate * HERTZ)
        # too few samples to tell the speed after it
        position = position[: off + IMPACT_SAMPLES - 1]
        time = np.arange(len(position)) / HERTZ
        noisy = position + SIGMA * rng.standard_normal(len(time))
        write_run(run, Run(run.name, time, noisy, None, 0 * time, False))
    found = diagnosed(read_measured(tmp_path / "slide.xml", "slide", runs)).diagnosis
    assert found.verdict == "adequate"


def test_segments_by_themselves_are_missed_as_among_all(tmp_path):
    baseline = fit_baseline(slide(tmp_path, 0.1, 0.6, np.random.default_rng()))
    segments, simulator = baseline.estimator.segments, baseline.base.simulator(baseline.fit.x)
    kept = segments.impacts
    assert 2 < kept.sum() < len(kept)
    every = segments.residuals(segments.misfit(simulator, segments.start))[kept]
    some = segments.only(kept)
    alone = some.residuals(some.misfit(simulator, some.start))
    assert np.allclose(alone, every, rtol=1e-9, atol=1e-9)


def test_no_end_is_bouncier_than_one_that_gives_nearly_all_back(tmp_path):
    """Only a restitution above the model's is tried, and there is none."""
    baseline = fit_baseline(slide(tmp_path, 0.1, 0.6, np.random.default_rng(), "-40000 -2"))
    assert (baseline.estimator.segments.impacts).any()
    ends = [one for one in baseline.hypotheses if one.effect == RESTITUTION]
    assert len(ends) == 3
    assert baseline.restitution(ends) == []


@pytest.mark.slow
def test_a_bouncy_end_is_told_whatever_its_stiffness(seed=1112655636):
    """Of a stop far softer than the model's, beside a mass of 0.59 of the model's."""
    case = draw(seed, RESTITUTION, family="field")
    found = diagnosed(read(case)[0]).diagnosis
    (first,) = found.effects[:1]
    assert (found.verdict, first.effect) == ("missing_effect", RESTITUTION)
    assert abs(first.magnitude - case.seal["magnitude"]) < 2 * first.magnitude_error
    assert first.held_out_error_after < 0.5 * first.held_out_error_before
