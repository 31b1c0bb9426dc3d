"""How stiff the ends of a range are, and how far they yield to a force, is found by runs that come
to them, and written."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scenes import write

from joda import diagnose, improve
from joda.diagnosis import adding, verdict
from joda.diagnosis.adding import Error, better_stops, error
from joda.diagnosis.end_stops import OtherEnds, _visits, fitted_stops
from joda.diagnosis.free_runs import Worst
from joda.diagnosis.split import parted
from joda.measured.errors import errors, until_an_end
from joda.measured.reading import read_measured
from joda.measured.replay import Start
from joda.measured.run_files import write_run
from joda.measured.runs import Run, arrival
from joda.scenes.limits import SecondStop, stiffness_of
from joda.scenes.unmodelled import unmodelled_elements

SIGMA, EVERY, STEP = 2e-4, 2, 0.002
SLIDE = """<mujoco>
  <option gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" range="0 0.5" damping="0.4" {}/>
      <geom type="box" size=".1 .1 .1" mass="1"/>
    </body>
  </worldbody>
  {}
</mujoco>
"""


PUSHES = {
    False: ((0, 250, 251, 400, 401, 600, 601), (1, 1, 0, 0, -0.7, -0.7, 0)),
    True: ((0, 250, 320, 400, 470, 600, 670), (1, 1, 0, 0, -0.7, -0.7, 0)),
}
"""Steps and what part of its most a hand pushes with, which lets go at once, or smoothly: else the
force between two samples is not known, nor therefore how fast an end lets go of the joint."""


def pushed(folder, rng, stop, count=6, smoothly=False, besides="", kicks=0.0):
    """Runs of a slide with such ends, that a hand pushes against them and lets go; and its model,
    which has MuJoCo's own ends. Besides there may be a tendon; and the high end may throw back, at
    always the same speed, what comes to it."""
    model = mujoco.MjModel.from_xml_string(SLIDE.format(stop, besides))
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
            if kicks and data.qpos[0] > 0.5 and data.qvel[0] > 0:
                data.qvel[0] = -kicks
        time, position, force = np.array(rows).T
        files.append(folder / f"run{k}.csv")
        write_run(files[-1], Run(files[-1].name, time, position, None, force, True))
    return write(folder, SLIDE.format("", "")), files


def apart(stop):
    """A tendon that stops the slide at its high end besides."""
    return f"<tendon>{stop.element('stop', 'slide', (0.0, 0.5))}</tendon>"


STIFFER = SecondStop(1, (0.01, 0.8), (0.3, 0.3, 0.001, 0.5, 2.0))
SOFTER = 'solreflimit="0.03 1" solimplimit="0.05 0.05"'
"""A tendon's limit, and the joint's."""


@pytest.mark.parametrize("solref", [(0.06, 1.0), (0.01, 1.0), (0.05, 0.7)])
def test_the_stop_of_the_runs_is_found(tmp_path, rng, solref):
    model, files = pushed(tmp_path, rng, 'solreflimit="{:g} {:g}"'.format(*solref))
    train, held = parted(read_measured(model, "slide", files))
    found = fitted_stops(train, held)
    assert stiffness_of(found.solref, STEP) == pytest.approx(stiffness_of(solref, STEP), rel=0.15)
    assert found.solref[1] == pytest.approx(solref[1], rel=0.1) and found.second is None
    assert error(held.stopped(found)).window < 0.7 * error(held).window


@pytest.mark.parametrize("impedance", [0.05, 0.5])
def test_how_far_an_end_yields_to_a_force_is_found(tmp_path, rng, impedance):
    """By the share 1 - d of what a spring of the same stiffness would (docs/diagnose.md)."""
    solref = 0.03, 1.0
    stop = 'solreflimit="{:g} {:g}" solimplimit="{:g} {:g}"'
    model, files = pushed(tmp_path, rng, stop.format(*solref, impedance, impedance), smoothly=True)
    train, held = parted(read_measured(model, "slide", files))
    found = fitted_stops(train, held)
    stiffness = stiffness_of(found.solref, STEP)
    assert stiffness == pytest.approx(stiffness_of(solref, STEP), rel=0.15)
    yields = (1 - impedance) / stiffness_of(solref, STEP)
    assert (1 - found.solimp[1]) / stiffness == pytest.approx(yields, rel=0.1)
    best, own = (error(held.stopped(one)).whole for one in (found, train.joint_model.stops))
    assert best < 0.3 * own


def test_until_an_end_another_stop_does_not_count(tmp_path, rng):
    """Nor does how far a whole run is off after it came to an end that is not the model's."""
    model, files = pushed(tmp_path, rng, 'solreflimit="0.1 0.3"', smoothly=True)
    measured = read_measured(model, "slide", files)
    found = errors(measured, windows=False)
    assert max(one.multiple for one in found.missed) > 100
    paths = []
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        there = arrival(run, (0, 0.5), 3 * sigma)
        paths.append(run.position + np.where(np.arange(len(run.time)) < there, 2 * sigma, 0.1))
        assert np.all(np.abs(run.position[:there] - 0.25) < 0.25 - 2 * SIGMA)
        assert abs(run.position[there] - 0.25) > 0.25 - 4 * SIGMA
    off = until_an_end(measured, replace(found, paths=tuple(paths)))
    assert off == pytest.approx(np.full(len(files), 2.0))


@pytest.mark.parametrize(
    ("position", "first"), [([0, 0, 2, 5, 9, 10, 9], 5), ([0, 0, 0], 3), ([5, 6, 5], 3)]
)
def test_the_first_sample_at_an_end_after_the_joint_was_off_it(position, first):
    run = Run("run", np.arange(len(position)), np.array(position), None, None, False)
    assert arrival(run, (0, 10), 0.5) == first


def test_a_stop_that_is_right_stays(tmp_path, rng):
    found = fitted_stops(*parted(read_measured(*slide(tmp_path, rng))))
    if found:  # by chance, in one of 20 at most: then it is nearly what it was
        assert stiffness_of(found.solref, STEP) == pytest.approx(2500, rel=0.1)


def slide(folder, rng):
    model, files = pushed(folder, rng, "")
    return model, "slide", files


@pytest.mark.slow
def test_improve_writes_it_and_says_so(tmp_path, rng):
    model, files = pushed(tmp_path, rng, 'solreflimit="0.06 1"')
    found = improve(model, "slide", files, tmp_path / "new.xml")
    assert found.steps[-1].stops
    assert any(
        line.startswith("ends of the range: solreflimit 0.02 1 → 0.0") for line in found.changes
    )
    written = mujoco.MjModel.from_xml_path(str(found.scene))
    assert stiffness_of(written.jnt_solref[0], STEP) == pytest.approx(1 / 0.06**2, rel=0.15)
    new, old = (error(read_measured(scene, "slide", files)).whole for scene in (found.scene, model))
    assert new < 0.5 * old
    printed = json.loads(json.dumps(found.as_json()))  # as `--json` prints it
    assert printed["scene"] == str(found.scene) and printed["why"] == found.why
    assert len(printed["steps"]) == len(found.steps) - 1
    assert printed["error"]["whole"] == found.steps[0].error.whole


@pytest.mark.slow
def test_what_is_right_is_not_improved(tmp_path, rng):
    """Ends that fit the runs a little better do not what was held out."""
    model, files = pushed(tmp_path, rng, "", count=4)
    found = improve(model, "slide", files, tmp_path / "new.xml")
    assert found.scene is None and not found.changes
    assert all(one.stops is None for one in found.steps)


@pytest.mark.parametrize("held", ["none", "worse"])
def test_ends_are_kept_only_if_what_was_held_out_confirms_them(tmp_path, rng, monkeypatch, held):
    model, files = pushed(tmp_path, rng, 'solreflimit="0.05 0.7"')
    train, judge = parted(read_measured(model, "slide", files))
    assert better_stops(train, judge)
    if held == "none":  # no visit to an end
        middle = replace(judge.runs[0], position=0.25 + 0 * judge.runs[0].position)
        judge = replace(judge, runs=(middle,), sigma=judge.sigma[:1])
    else:
        rises = iter((Error(1e-3, 1e-3), Error(1.2e-3, 0.9e-3)))
        monkeypatch.setattr(adding, "error", lambda *_, **__: next(rises))
    assert better_stops(train, judge) is None


def test_whole_runs_that_another_stop_explains_leave_the_model_adequate(tmp_path, rng):
    stop = 'solreflimit="0.03 1" solimplimit="0.05 0.05"'
    model, files = pushed(tmp_path, rng, stop, smoothly=True)
    found = diagnose(model, "slide", files)
    assert found.verdict == "adequate"
    assert "with other ends: solreflimit 0.02 1 → 0.0" in found.summary
    assert "solimplimit 0.9 0.95 0.001 0.5 2 → 0" in found.summary


@pytest.mark.parametrize(("times", "said"), [(4.0, "adequate"), (8.0, "unexplained")])
def test_where_other_ends_explain_whole_runs_nothing_else_is_asked(
    tmp_path, rng, monkeypatch, times, said
):
    model, runs = pushed(tmp_path, rng, "", count=4)
    monkeypatch.setattr(verdict, "worst", lambda *_: Worst(free=8.0, whole=12.0))
    ends = OtherEnds(None, "solreflimit 0.02 1 → 0.01 1", times)
    monkeypatch.setattr(verdict, "with_other_ends", lambda *_: ends)
    monkeypatch.setattr(verdict, "_by_whole_runs", lambda measured, ranking, stops, plain: plain)
    found = diagnose(model, "slide", runs)
    assert found.verdict == said
    assert ("and 4.0 times with other ends: solreflimit" in found.summary) == (times == 4.0)


@pytest.mark.flaky(reruns=3)  # of eight draws a pair of stops explains one by chance
def test_whole_runs_that_no_stop_explains_do_not(tmp_path, rng):
    """Of a slide whose high end throws back what comes slowly and fast alike."""
    model, files = pushed(tmp_path, rng, SOFTER, smoothly=True, kicks=0.15)
    found = diagnose(model, "slide", files)
    assert found.verdict == "unexplained"
    assert found.summary.startswith("Something at the ends of the range is missing")
    assert found.next_experiment.startswith("Press the joint slowly against either end")


# --- ends that differ
@pytest.mark.parametrize("end", [-1, 1])
def test_what_stops_a_joint_besides_is_simulated_as_mujoco_does(tmp_path, rng, end):
    besides = apart(replace(STIFFER, end=end))
    _, files = pushed(tmp_path, rng, SOFTER, 2, True, besides)
    scene = write(tmp_path, SLIDE.format(SOFTER, besides), "scene.xml")
    measured = read_measured(scene, "slide", files)
    assert measured.joint_model.second == replace(STIFFER, end=end)
    assert not unmodelled_elements(mujoco.MjModel.from_xml_path(str(scene)), 0)
    model, replayer = mujoco.MjModel.from_xml_path(str(scene)), measured.replayer
    for run in measured.runs:
        data, path = mujoco.MjData(model), []
        data.qpos[0], steps = run.position[0], round(run.time[-1] / STEP)
        for force in np.interp(STEP * np.arange(steps + 1), run.time, run.force):
            path.append(data.qpos[0])
            data.qfrc_applied[0] = force
            mujoco.mj_step(model, data)
        start = Start(np.array([run.position[0], 0.0]), np.eye(2))
        alone, quick = (replayer.whole(run, start, quickly) for quickly in (False, True))
        assert np.allclose(alone, quick, atol=1e-8)
        assert np.allclose(alone, path[::EVERY], atol=SIGMA)  # its damping is MuJoCo's own


@pytest.mark.flaky(reruns=3)  # of eight draws one ends beside the least loss
@pytest.mark.parametrize("end", [-1, 1])
def test_ends_that_differ_are_found(tmp_path, rng, end):
    besides = apart(replace(STIFFER, end=end))
    model, files = pushed(tmp_path, rng, SOFTER, 9, True, besides)
    train, held = parted(read_measured(model, "slide", files))
    found = fitted_stops(train, held)
    assert found.second.end == end
    assert stiffness_of(found.solref, STEP) == pytest.approx(0.03**-2, rel=0.2)
    scene = write(tmp_path, SLIDE.format(SOFTER, besides), "true.xml")
    true = read_measured(scene, "slide", files).joint_model.stops
    own = train.joint_model.stops
    assert error(held.stopped(found)).whole < 0.4 * error(held.stopped(own)).whole
    for part in (train, held):  # as little is left as the true ends leave
        visits = _visits(part)
        assert visits.loss(found) < 1.3 * visits.loss(true) < 0.1 * visits.loss(own)


@pytest.mark.slow
@pytest.mark.flaky(reruns=3)  # of three draws one's runs are as likely with another pair of stops
def test_improve_writes_ends_that_differ(tmp_path, rng):
    model, files = pushed(tmp_path, rng, SOFTER, 9, True, apart(STIFFER))
    told = diagnose(model, "slide", files)
    assert told.verdict == "adequate"
    assert "at the high end besides a tendon's limit with solreflimit 0.0" in told.summary
    found = improve(model, "slide", files, tmp_path / "new.xml")
    assert any("at the high end besides a tendon's limit" in line for line in found.changes)
    written = mujoco.MjModel.from_xml_path(str(found.scene))
    assert written.ntendon == 1 and written.tendon_range[0, 1] == 0.5
    new, old = (error(read_measured(scene, "slide", files)).whole for scene in (found.scene, model))
    assert new < 0.1 * old
    assert diagnose(found.scene, "slide", files).verdict == "adequate"
