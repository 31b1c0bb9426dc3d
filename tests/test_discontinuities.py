"""Fits between the jumps of a force: against planted profiles, and the same joint in MuJoCo."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from refine_table import MODELS, NOISE, STEP, cabinet_profile, errors, planted, quiet_rig

from joda import context
from joda.effects import EndStopRestitution
from joda.estimation.profile_parameters import KINDS, Parameters
from joda.joints import joint_model
from joda.refining.discontinuities import Between
from joda.refining.engine import JointEngine
from joda.refining.shooting import Shooting


def between(case, kinds=("values", "intervals"), profile=None, **changed) -> Between:
    """A planted case; `changed` is what of the joint is wrong."""
    model = quiet_rig(case.found, case.true)
    joint = replace(joint_model.joint_model(case.found, case.true, model, 0), **changed)
    return between_of(joint, Parameters(profile or case.start, kinds), case.runs)


def between_of(joint, parameters, runs=()) -> Between:
    span = parameters.profile.joint.range
    engine = JointEngine(joint, span, runs, NOISE * float(np.ptp(span)), STEP)
    return Between(Shooting(engine, parameters))


def truth(case, parameters: Parameters):
    """The true numbers in the parameters' units."""
    true = Parameters(case.true, ("values", "intervals"))
    return true.start * true.scales / parameters.scales


def quiet(theta, misfit) -> None:
    pass


def test_a_jump_where_no_run_was_stays():
    case = planted("constant_negative_conservative_hinge", 4)
    joint = between(case)
    far = joint.parameters.start.copy()
    far[joint._ends(far)] = 0.995, 0.9995
    assert np.array_equal(joint.placed(far, quiet), far)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        planted("constant_negative_conservative_hinge", 4),
        planted("constant_friction_hinge", 4),
        planted("constant_damping_hinge", 13),
    ],
    ids=["conservative", "friction", "damping"],
)
def test_numbers_are_recovered_although_jumps_are_off(case):
    joint = between(case)
    begin = joint.parameters.start.copy()  # strengths off by up to two times
    jumps = joint._ends(begin)
    begin[jumps] = truth(case, joint.parameters)[jumps] + [0.008, -0.008]
    found = joint.fit(begin, 12, quiet)
    before, after = (errors(case, joint.parameters.written(x)) for x in (begin, found))
    assert max(rms for rms, _ in before.values()) > 0.1
    assert max(rms for rms, _ in after.values()) < 0.03


def test_jumps_are_moved_to_where_they_are():
    case = planted("constant_damping_hinge", 13)
    joint = between(case)
    true = truth(case, joint.parameters)
    jumps = joint._ends(true)
    begin = true.copy()
    begin[jumps] += [0.012, -0.02]
    assert joint.fit(begin, 12, quiet)[jumps] == pytest.approx(true[jumps], abs=0.003)


def test_segments_between_the_jumps_cross_none():
    case = planted("constant_positive_conservative_hinge", 1)
    joint = between(case)
    estimator = joint._clear(truth(case, joint.parameters))
    assert 0.2 < estimator.counts.mean() < 0.9
    span = float(np.ptp(case.found.joint.range))
    (component,) = case.true.channels.conservative.components
    for row in estimator.segments.rows[estimator.counts]:
        s = estimator.segments.position[row[row >= 0]] / span
        for end in component.interval:
            assert s.min() > end or s.max() < end


def test_a_curve_that_begins_at_zero_does_not_jump():
    joint = between(planted("detent_internal", 0))
    assert not joint._ends(joint.parameters.start)
    assert joint._clear(joint.parameters.start).counts.all()


def test_a_wrong_inertia_is_found():
    case = planted("constant_friction_hinge", 0)
    right = case.found.equivalent_inertia
    joint = between(case, ("inertia",), case.true, inertia=0.8 * right)
    (found,) = joint.fit(np.zeros(1), 12, quiet)
    assert np.exp(found) == pytest.approx(1 / 0.8, rel=0.01)


def test_what_misses_the_segments_is_worse():
    case = planted("constant_positive_conservative_hinge", 1)
    joint = between(case)
    true = truth(case, joint.parameters)
    values = np.array([slot.kind == "values" for slot in joint.parameters.slots])
    assert joint.worse(np.where(values, 1.05 * true, true), true)
    assert not joint.worse(joint.fit(true, 4, quiet), true)


@pytest.mark.slow
@pytest.mark.parametrize("iterations", [1, 2, 7, 12])
def test_it_does_not_take_more_iterations_than_it_may(iterations):
    joint = between(planted("constant_damping_hinge", 0))
    heard = []
    joint.fit(joint.parameters.start, iterations, lambda theta, misfit: heard.append(misfit))
    assert 0 < len(heard) <= iterations


def test_every_kind_of_number_does_what_it_does_in_mujoco():
    found = context(MODELS + "/cabinet.xml", "door")
    profile = cabinet_profile(found, 2.5, 0.4)
    parameters = Parameters(profile, KINDS)
    own = joint_model.joint_model(found, profile, quiet_rig(found, profile), 0)
    shooting = between_of(own, parameters).shooting
    theta = parameters.start + 0.05 * np.random.default_rng(0).uniform(size=len(parameters.start))
    force = 8 * np.sin(6 * STEP * np.arange(600))
    start = np.array([[0.3, 0.5]])
    begin = np.zeros(1, int), start, np.array([True])
    path = shooting.simulator(theta).replay(force, *begin, STEP)[1]
    body = shooting.engine.body(parameters, theta)
    model = quiet_rig(
        joint_model.weighing(found.model_copy(update={"equivalent_inertia": body.inertia}), body),
        parameters.written(theta, exact=True),
    )
    model.opt.timestep, model.jnt_solref[0] = STEP, body.solref
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = start[0]
    wanted = []
    for push in force:
        data.qfrc_applied[0] = push
        mujoco.mj_step(model, data)
        wanted.append(data.qpos[0])
    np.testing.assert_allclose(path, wanted, atol=1e-5)
    assert np.ptp(path) > 0.5


@pytest.mark.parametrize("end", ["low", "high", "both"])
def test_the_ends_bounce_as_those_of_the_model(end):
    found = context(MODELS + "/cabinet.xml", "door")
    profile = cabinet_profile(found, 2.5, 0.4)
    profile = profile.with_effect(EndStopRestitution(restitution=0.6, end=end))
    model = quiet_rig(found, profile)
    model.opt.timestep = STEP
    own = joint_model.joint_model(found, profile, model, 0)
    solref, solimp = own.limits(profile, STEP)
    parameters = Parameters(profile, KINDS)
    shooting = between_of(replace(own, solref=solref, solimp=solimp), parameters).shooting
    force = np.repeat([-40.0, 40.0, 40.0, -40.0], 150)
    begin = np.zeros(1, int), np.array([[0.3, 0.5]]), np.array([True])
    path = shooting.simulator(parameters.start).replay(force, *begin, STEP)[1]
    wanted = own.simulator(profile, STEP).replay(force, *begin, STEP)[1]
    np.testing.assert_array_equal(path, wanted)
    assert path.min() < found.joint.range[0] and path.max() > found.joint.range[1]
