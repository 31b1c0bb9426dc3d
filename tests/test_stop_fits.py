"""How stiff the ends of a range are is found by runs that come to them, and written."""

import mujoco
import numpy as np
import pytest
from scenes import write

from joda import improve
from joda.diagnosis.adding import error
from joda.diagnosis.end_stops import fitted_stop
from joda.diagnosis.split import parted
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.scenes.limits import stiffness_of

SIGMA, EVERY, STEP = 2e-4, 2, 0.002
SLIDE = """<mujoco>
  <option gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" range="0 0.5" damping="0.4" {}/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


def pushed(folder, rng, stop, count=6):
    """Runs of a slide with such ends, that a hand pushes against them and lets go; and its model,
    which has MuJoCo's own ends."""
    model = mujoco.MjModel.from_xml_string(SLIDE.format(stop))
    data, files = mujoco.MjData(model), []
    for k in range(count):
        mujoco.mj_resetData(model, data)
        data.qpos[0], push = rng.uniform(0.1, 0.4), rng.uniform(2.0, 5.0) * (-1) ** k
        rows = []
        for step in range(900):
            data.qfrc_applied[0] = push * (1 if step < 250 else -0.7 if 400 < step < 600 else 0)
            if step % EVERY == 0:
                noisy = data.qpos[0] + SIGMA * rng.standard_normal()
                rows.append((step * STEP, noisy, data.qfrc_applied[0]))
            mujoco.mj_step(model, data)
        time, position, force = np.array(rows).T
        files.append(folder / f"run{k}.csv")
        write_run(files[-1], Run(files[-1].name, time, position, None, force, True))
    return write(folder, SLIDE.format("")), files


@pytest.mark.parametrize("solref", [(0.06, 1.0), (0.01, 1.0), (0.05, 0.7)])
def test_the_stop_of_the_runs_is_found(tmp_path, rng, solref):
    model, files = pushed(tmp_path, rng, 'solreflimit="{:g} {:g}"'.format(*solref))
    train, held = parted(read_measured(model, "slide", files))
    found = fitted_stop(train, held)
    assert stiffness_of(found, STEP) == pytest.approx(stiffness_of(solref, STEP), rel=0.15)
    assert found[1] == pytest.approx(solref[1], rel=0.1)
    assert error(held.stopped(found)).window < 0.7 * error(held).window


def test_a_stop_that_is_right_stays(tmp_path, rng):
    found = fitted_stop(*parted(read_measured(*slide(tmp_path, rng))))
    if found:  # by chance, in one of 20 at most: then it is nearly what it was
        assert stiffness_of(found, STEP) == pytest.approx(2500, rel=0.1)


def slide(folder, rng):
    model, files = pushed(folder, rng, "")
    return model, "slide", files


@pytest.mark.slow
def test_improve_writes_it_and_says_so(tmp_path, rng):
    model, files = pushed(tmp_path, rng, 'solreflimit="0.06 1"')
    found = improve(model, "slide", files, tmp_path / "new.xml")
    assert found.steps[-1].stop
    assert any(
        line.startswith("ends of the range: solreflimit 0.02 1 → 0.0") for line in found.changes
    )
    written = mujoco.MjModel.from_xml_path(str(found.scene))
    assert stiffness_of(written.jnt_solref[0], STEP) == pytest.approx(1 / 0.06**2, rel=0.15)
    new, old = (error(read_measured(scene, "slide", files)).whole for scene in (found.scene, model))
    assert new < 0.5 * old
