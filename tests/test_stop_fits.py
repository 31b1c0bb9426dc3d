"""How stiff the ends of a range are, and how far they yield to a force, is found by runs that come
to them, and written."""

import mujoco
import numpy as np
import pytest
from scenes import write

from joda import diagnose, improve
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
    {}
  </worldbody>
</mujoco>
"""


BUFFER = '<geom type="box" size=".1 .1 .1" pos="0.7 0 0" solref="0.1 1" solimp="0.05 0.05"/>'


PUSHES = {
    False: ((0, 250, 251, 400, 401, 600, 601), (1, 1, 0, 0, -0.7, -0.7, 0)),
    True: ((0, 250, 320, 400, 470, 600, 670), (1, 1, 0, 0, -0.7, -0.7, 0)),
}
"""Steps and what part of its most a hand pushes with, which lets go at once, or smoothly: else the
force between two samples is not known, nor therefore how fast an end lets go of the joint."""


def pushed(folder, rng, stop, count=6, buffer=False, smoothly=False):
    """Runs of a slide with such ends, that a hand pushes against them and lets go; and its model,
    which has MuJoCo's own ends. A buffer may be what the high end is."""
    text = SLIDE.format(stop, BUFFER if buffer else "")
    if buffer:
        text = text.replace('range="0 0.5"', 'range="0 2"')
    model = mujoco.MjModel.from_xml_string(text)
    data, files = mujoco.MjData(model), []
    for k in range(count):
        mujoco.mj_resetData(model, data)
        data.qpos[0], push = rng.uniform(0.1, 0.4), rng.uniform(2.0, 5.0) * (-1) ** k
        rows = []
        for step in range(900):
            data.qfrc_applied[0] = push * np.interp(step, *PUSHES[smoothly])
            if step % EVERY == 0:
                noisy = data.qpos[0] + SIGMA * rng.standard_normal()
                rows.append((step * STEP, noisy, data.qfrc_applied[0]))
            mujoco.mj_step(model, data)
        time, position, force = np.array(rows).T
        files.append(folder / f"run{k}.csv")
        write_run(files[-1], Run(files[-1].name, time, position, None, force, True))
    return write(folder, SLIDE.format("", "")), files


@pytest.mark.parametrize("solref", [(0.06, 1.0), (0.01, 1.0), (0.05, 0.7)])
def test_the_stop_of_the_runs_is_found(tmp_path, rng, solref):
    model, files = pushed(tmp_path, rng, 'solreflimit="{:g} {:g}"'.format(*solref))
    train, held = parted(read_measured(model, "slide", files))
    found = fitted_stop(train, held)
    assert stiffness_of(found[0], STEP) == pytest.approx(stiffness_of(solref, STEP), rel=0.15)
    assert found[0][1] == pytest.approx(solref[1], rel=0.1)
    assert error(held.stopped(found)).window < 0.7 * error(held).window


@pytest.mark.parametrize("impedance", [0.05, 0.5])
def test_how_far_an_end_yields_to_a_force_is_found(tmp_path, rng, impedance):
    """By the share 1 - d of what a spring of the same stiffness would (docs/diagnose.md)."""
    solref = 0.03, 1.0
    stop = 'solreflimit="{:g} {:g}" solimplimit="{:g} {:g}"'
    model, files = pushed(tmp_path, rng, stop.format(*solref, impedance, impedance), smoothly=True)
    train, held = parted(read_measured(model, "slide", files))
    found, solimp = fitted_stop(train, held)
    stiffness = stiffness_of(found, STEP)
    assert stiffness == pytest.approx(stiffness_of(solref, STEP), rel=0.15)
    yields = (1 - impedance) / stiffness_of(solref, STEP)
    assert (1 - solimp[1]) / stiffness == pytest.approx(yields, rel=0.1)
    stiffer = train.joint_model.solref, train.joint_model.solimp
    best, own = (error(held.stopped(one)).whole for one in ((found, solimp), stiffer))
    assert best < 0.3 * own


def test_a_stop_that_is_right_stays(tmp_path, rng):
    found = fitted_stop(*parted(read_measured(*slide(tmp_path, rng))))
    if found:  # by chance, in one of 20 at most: then it is nearly what it was
        assert stiffness_of(found[0], STEP) == pytest.approx(2500, rel=0.1)


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


def test_whole_runs_that_another_stop_explains_leave_the_model_adequate(tmp_path, rng):
    stop = 'solreflimit="0.03 1" solimplimit="0.05 0.05"'
    model, files = pushed(tmp_path, rng, stop, smoothly=True)
    found = diagnose(model, "slide", files)
    assert found.verdict == "adequate"
    assert "with other ends: solreflimit 0.02 1 → 0.0" in found.summary
    assert "solimplimit 0.9 0.95 0.001 0.5 2 → 0" in found.summary


def test_whole_runs_that_no_stop_explains_do_not(tmp_path):
    """Of a slide whose low end is hard, and whose high end is a soft buffer."""
    rng = np.random.default_rng(0)  # in some draws the buffer is hardly pressed
    model, files = pushed(tmp_path, rng, 'solreflimit="0.004 1"', buffer=True, smoothly=True)
    found = diagnose(model, "slide", files)
    assert found.verdict == "unexplained"
    assert found.summary.startswith("Something at the ends of the range is missing")
    assert found.next_experiment.startswith("Press the joint slowly against either end")
