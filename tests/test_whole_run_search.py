"""Effects that segments hardly show are asked by whole runs."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scenes import write

from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.end_stops import suited
from joda.diagnosis.search import rank
from joda.diagnosis.verdict import Diagnosed, _by_whole_runs, diagnosed
from joda.diagnosis.whole_run_search import in_whole_runs
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run

SIGMA, STEP, EVERY = 1.5e-3, 0.002, 8
SLIDE = """<mujoco>
  <option gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" range="0 1" damping="{:g}" frictionloss="0.2"
             {}/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


def tossed(folder, rng, damping, extra, stop=""):
    """Four coarse runs of a slide that is tossed to and fro, with a force besides; and its model,
    without that and with MuJoCo's own ends."""
    model = mujoco.MjModel.from_xml_string(SLIDE.format(0.6, stop))
    files = []
    for k in range(4):
        data, rows = mujoco.MjData(model), []
        away = k % 2
        data.qpos[0] = 0.15 + 0.7 * away + rng.uniform(-0.05, 0.05)
        data.qvel[0] = rng.uniform(0.9, 1.3) * (1 - 2 * away)
        for step in range(900):
            if step % EVERY == 0:
                rows.append((step * STEP, data.qpos[0] + SIGMA * rng.standard_normal()))
            data.qfrc_applied[0] = extra(data.qpos[0], data.qvel[0])
            mujoco.mj_step(model, data)
        time, position = np.array(rows).T
        files.append(folder / f"run{k}.csv")
        write_run(files[-1], Run(files[-1].name, time, position, None, np.zeros(len(time)), False))
    return read_measured(write(folder, SLIDE.format(damping, "")), "slide", files)


def asked(measured):
    """What whole runs say, and what is said where segments show nothing and they do."""
    ranking = rank(fit_baseline(measured))
    plain = replace(diagnosed(measured).diagnosis, verdict="unexplained", summary="Whole runs.")
    stops = suited(measured, ranking.baseline)
    told = _by_whole_runs(measured, ranking, stops, Diagnosed(plain)).diagnosis
    return in_whole_runs(measured, ranking, stops), told


@pytest.mark.slow
def test_what_segments_hardly_show_whole_runs_name(tmp_path, rng):
    """A damping of one direction, beside ends that are softer than the model's: in segments many
    effects do nearly as well, in whole runs no other."""
    more = rng.uniform(0.3, 0.5)
    stop = 'solreflimit="0.05 0.7"'
    whole, told = asked(
        tossed(tmp_path, rng, 0.6 + more / 2, lambda q, v: -more * max(v, 0.0), stop)
    )
    assert whole.ranking.baseline.estimator.segments.run.tolist() == [0, 1, 2, 3]
    first, second = whole.ranking.candidates[:2]
    assert first.hypothesis.effect == told.effects[0].effect == "direction_dependent_damping"
    assert second.fit.loss > first.fit.loss + 50
    assert first.fit.loss < 0.5 * whole.ranking.baseline.fit.loss
    assert told.effects[0].magnitude == pytest.approx(more, rel=0.25)
    if told.verdict == "missing_effect":  # else segments held out are missed as much
        assert told.summary.endswith("Segments show nothing of it; free runs do.")
    else:
        assert told.summary.startswith("Whole runs. ")


@pytest.mark.slow
def test_numbers_that_are_off_are_told_by_whole_runs(tmp_path, rng):
    """And how well they are known: also where the joint sticks, and a fit ends beside the best."""
    factor = rng.uniform(1.3, 1.6)
    whole, told = asked(tossed(tmp_path, rng, 0.6 / factor, lambda q, v: 0.0))
    fitted = whole.ranking.baseline
    assert np.all(np.abs(fitted.fit.x - [1.0, factor]) < 5 * whole.errors)
    assert np.all(whole.errors < 0.5)
    assert told.verdict != "missing_effect"
    if told.verdict == "adequate":
        (damping,) = (one for one in told.corrections if one.parameter == "damping")
        assert damping.factor == pytest.approx(factor, rel=0.2)
        assert "Its own numbers are off" in told.summary
