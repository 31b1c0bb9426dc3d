"""The plugin in MuJoCo's machinery: inverse, derivatives, copies, states, threads, sleep, flags."""

import copy
from importlib import import_module

import mujoco
import numpy as np
import pytest
from joints import (
    SLEEP,
    SOLVERS,
    SPRING,
    component,
    flat,
    has,
    load,
    needs,
    run,
    scene,
    warnings,
)
from mujoco import rollout

import joda
from joda.component import Component
from joda.profile import Channel, Channels, Joint, Profile, Resistance
from joda.scenes.scene import INERT

FULL = mujoco.mjtState.mjSTATE_INTEGRATION
LATCH = component((0, 0.3), (0, 0.5, 1), (-2, -3, 0))
EVERYTHING = dict(
    conservative=LATCH, friction=flat(0.2), damping=component((0, 1), (0, 1), (0.1, 0.6))
)


def swinging(**options):
    model, data = load(**EVERYTHING, inertia=0.05, **options)
    data.qvel[0] = -1.5
    return model, data


def random_profile(random) -> Profile:
    def part(low):
        return Component(interval=(0, 1), x=(0, 0.4, 1), y=tuple(random.uniform(low, 1, 3)))

    return Profile(
        joint=Joint(name="j", type="slide", range=(0, 1), unit="m"),
        channels=Channels(
            conservative=Channel(components=(part(-1),)),
            friction=Resistance(components=(part(0),)),
            damping=Resistance(components=(part(0),)),
        ),
    )


def chain(count: int = 4, option: str = "", joint: str = "") -> str:
    """Hinged links that fall on a floor, each with all three channels: contacts and coupling."""
    keys = "".join(f'<config key="{k}" value="{v}"/>' for k, v in EVERYTHING.items())
    instances = "".join(f'<instance name="p{k}">{keys}</instance>' for k in range(count))
    rows = "".join(f'<joint name="joda_damping_j{k}" joint1="j{k}" {INERT}/>' for k in range(count))
    links, close = "", ""
    for k in range(count):
        links += (
            f'<body pos="{0.25 if k else 0} 0 {0 if k else 0.3}">'
            f'<joint name="j{k}" axis="0 1 0" range="-1.2 1.2" frictionloss="1e-12" {joint}/>'
            f'<geom type="capsule" fromto="0 0 0 .25 0 0" size=".02" mass=".3"/>'
            f'<plugin instance="p{k}"/>'
        )
        close += "</body>"
    return f"""
    <mujoco><compiler angle="radian"/><option timestep="0.002" {option}/>
      <extension><plugin plugin="joda.joint_dynamics">{instances}</plugin></extension>
      <worldbody><geom type="plane" size="2 2 .1"/>{links}{close}</worldbody>
      <equality>{rows}</equality>
    </mujoco>"""


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize("island", ["enable", "disable"])
def test_solvers_jacobians_and_islands_agree(solver, jacobian, island):
    def final(solver, jacobian, island):
        option = f'solver="{solver}" jacobian="{jacobian}" tolerance="1e-13" iterations="5000"'
        text = chain(option=option).replace(
            "<worldbody>", f'<option><flag island="{island}"/></option><worldbody>', 1
        )
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        run(model, data, 0.25)  # before the first contact, where the solvers differ by themselves
        return np.concatenate([data.qpos, data.qvel])

    assert final(solver, jacobian, island) == pytest.approx(
        final("Newton", "dense", "disable"), abs=1e-6
    )


def test_inverse_dynamics_give_the_applied_force_back():
    model = mujoco.MjModel.from_xml_string(chain())
    data = mujoco.MjData(model)
    random = np.random.default_rng()
    for _ in range(50):
        data.qfrc_applied[:] = random.normal(size=model.nv)
        mujoco.mj_step(model, data, 10)
        mujoco.mj_forward(model, data)
        mujoco.mj_inverse(model, data)
        assert data.qfrc_inverse == pytest.approx(data.qfrc_applied, abs=1e-9)


def test_finite_difference_derivatives_match_the_closed_form():
    """A' = dv+/dq, dv+/dv of backward-Euler damping and explicit force, sliding."""
    h, inertia, k, c = 0.002, 0.05, 3.0, 0.4
    model, data = load(
        component((0, 1), (0, 1), (k / 2, -k / 2)), flat(0.1), flat(c), inertia=inertia, h=h
    )
    data.qvel[0] = 1.0
    A = np.zeros((2, 2))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, A, None, None, None)
    dv = np.array([-h * k, inertia]) / (inertia + h * c)
    assert A[1] == pytest.approx(dv, rel=1e-6)
    assert A[0] == pytest.approx([1, 0] + h * dv, rel=1e-6)


def test_derivatives_leave_the_state_alone():
    model, data = swinging()
    run(model, data, 0.1)
    before = np.empty(mujoco.mj_stateSize(model, FULL))
    after = before.copy()
    mujoco.mj_getState(model, data, before, FULL)
    A = np.zeros((2, 2))
    mujoco.mjd_transitionFD(model, data, 1e-6, True, A, None, None, None)
    mujoco.mj_getState(model, data, after, FULL)
    assert (before == after).all()


@needs("mj_copyData", "mj_copyState")
def test_copied_data_goes_on_alike():
    model, data = swinging()
    run(model, data, 0.1)
    other = mujoco.MjData(model)
    mujoco.mj_copyData(other, model, data)
    fresh = mujoco.MjData(model)
    mujoco.mj_copyState(model, data, fresh, FULL)
    for target in (data, other, fresh):
        run(model, target, 0.5)
    assert data.qpos[0] == other.qpos[0] == fresh.qpos[0]


def test_a_saved_state_restarts_exactly_while_friction_holds():
    model, data = load(friction=flat(1.0), inertia=0.01)
    data.qfrc_applied[0] = 0.9
    run(model, data, 0.1)
    state = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, state, FULL)
    run(model, data, 1)
    end = data.qpos[0]
    mujoco.mj_resetData(model, data)
    mujoco.mj_setState(model, data, state, FULL)
    run(model, data, 1)
    assert data.qpos[0] == end


def test_reset_and_keyframes_start_from_no_friction_force():
    text = scene(**EVERYTHING, extra='<keyframe><key qpos="0.7" qvel="-1"/></keyframe>')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    ends = []
    for _ in range(2):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        assert (data.plugin_state == 0).all()
        run(model, data, 0.3)
        ends.append(data.qpos[0])
    assert ends[0] == ends[1]
    assert data.plugin_state[0] != 0


@pytest.mark.parametrize("threads", [2, 4])
def test_rollout_threads_are_bit_identical(threads):
    model = mujoco.MjModel.from_xml_string(chain())
    data = [mujoco.MjData(model) for _ in range(threads)]
    random = np.random.default_rng()
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    initial = np.empty((16, size))
    for k in range(16):
        mujoco.mj_resetData(model, data[0])
        data[0].qpos[:] = random.uniform(-0.5, 0.5, model.nq)
        mujoco.mj_getState(model, data[0], initial[k], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    one, _ = rollout.rollout(model, data[:1], initial, nstep=300)
    many, _ = rollout.rollout(model, data, initial, nstep=300)
    assert (one == many).all()
    assert np.ptp(one[:, -1, 1:], axis=0).max() > 1e-3


@needs("batch")
@pytest.mark.parametrize("threads", [2, 4])
def test_batch_threads_are_bit_identical(threads):
    model = mujoco.MjModel.from_xml_string(chain())
    start = np.random.default_rng().uniform(-0.5, 0.5, (16, model.nq))
    ends = []
    for count in (1, threads):
        simulations = import_module("mujoco.batch").Batch(model, nsim=16, nthread=count)
        qpos = simulations.bind("qpos")
        qpos[:] = start
        for _ in range(300):
            simulations.step()
        ends.append(qpos.copy())
    assert (ends[0] == ends[1]).all()
    assert np.abs(ends[0] - start).max() > 1e-2


def test_the_shared_model_is_never_written():
    model = mujoco.MjModel.from_xml_string(chain())
    before = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    after = before.copy()
    mujoco.mj_saveModel(model, None, before)
    data = mujoco.MjData(model)
    run(model, data, 1)
    mujoco.mj_saveModel(model, None, after)
    assert (before == after).all()


def test_a_swapped_profile_acts_in_that_data_only():
    model, data = swinging()
    other = copy.copy(data)
    profile = random_profile(np.random.default_rng())
    joda.set_profile(model, data, "j", profile)
    texts = {name: getattr(profile.channels, name).text() for name in EVERYTHING}
    fresh, expected = load(**texts, inertia=0.05)
    expected.qvel[0] = -1.5
    for m, d in ((model, data), (fresh, expected)):
        run(m, d, 0.2)
    assert data.qpos[0] == expected.qpos[0]
    untouched, same = swinging()
    for m, d in ((model, other), (untouched, same)):
        run(m, d, 0.2)
    assert other.qpos[0] == same.qpos[0]
    copied = copy.copy(data)
    for d in (copied, data):
        run(model, d, 0.2)
    assert copied.qpos[0] == data.qpos[0]


def test_swapping_needs_a_joint_that_carries_a_profile():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(joda.JodaError, match="carries no joda\\.joint_dynamics; attach a profile"):
        joda.set_profile(model, mujoco.MjData(model), "j", random_profile(np.random.default_rng()))


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        ("k", "joint 'k' not found; .* 'j'"),
        (1, "the model has 1 joints, none with id 1"),
        (-1, "-1"),
    ],
)
def test_swapping_names_a_joint_that_does_not_exist(joint, message):
    model, data = swinging()
    with pytest.raises(joda.JodaError, match=message):
        joda.set_profile(model, data, joint, random_profile(np.random.default_rng()))


@needs(SLEEP)
def test_sleeping_and_waking():
    """A held joint falls asleep, keeps its place, and moves again when pushed."""
    model, data = load(
        friction=flat(0.5), damping=flat(1.0), inertia=0.1, flag='sleep="enable"', kind="hinge"
    )
    model.opt.sleep_tolerance = 1e-3
    data.qvel[0] = 0.5
    run(model, data, 5)
    assert data.ntree_awake == 0
    resting = data.qpos[0]
    run(model, data, 5)
    assert data.qpos[0] == resting
    data.qfrc_applied[0] = 0.8
    run(model, data, 0.2)
    assert data.ntree_awake == 1
    assert data.qpos[0] > resting + 1e-3
    assert warnings(data) == 0


@needs(SLEEP)
def test_sleep_of_one_tree_does_not_disturb_another():
    """Rows of sleeping trees vanish: the awake joint's rows are found all the same."""
    text = scene(
        friction=flat(0.5), damping=flat(1.0), inertia=0.1, flag='sleep="enable"', option=""
    )
    child = mujoco.MjSpec.from_string(text)
    parent = mujoco.MjSpec()
    parent.option.gravity = [0, 0, 0]
    parent.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    parent.option.sleep_tolerance = 1e-3
    for name in "abc":
        parent.attach(child.copy(), prefix=name, frame=parent.worldbody.add_frame())
    model = parent.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5
    data.qfrc_applied[2] = 1.5
    run(model, data, 0.5)
    assert data.qvel[2] == pytest.approx((1.5 - 0.5) / 1.0, rel=0.02)
    assert data.ntree_awake == 1
    assert data.qvel[0] == data.qvel[1] == 0


@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_attached_twice_with_prefixes(kind):
    child = mujoco.MjSpec.from_string(scene(**EVERYTHING, kind=kind, inertia=0.05, option=""))
    parent = mujoco.MjSpec()
    parent.option.gravity = [0, 0, 0]
    for name in ("left ", "right_"):
        parent.attach(child.copy(), prefix=name, frame=parent.worldbody.add_frame())
    model = parent.compile()
    assert (model.nplugin, model.neq, model.npluginstate) == (2, 2, 2)
    reloaded = mujoco.MjModel.from_xml_string(parent.to_xml())
    alone, joint_model = load(**EVERYTHING, kind=kind, inertia=0.05, option="")
    joint_model.qvel[0] = -1.5
    run(alone, joint_model, 0.5)
    for m in (model, reloaded):
        data = mujoco.MjData(m)
        data.qpos[:], data.qvel[:] = 0.5, -1.5
        run(m, data, 0.5)
        assert data.qpos == pytest.approx(np.repeat(joint_model.qpos[0], 2), abs=1e-9)


def test_binary_models_keep_the_profile(tmp_path):
    model, data = swinging()
    mujoco.mj_saveModel(model, str(tmp_path / "model.mjb"))
    other = mujoco.MjModel.from_binary_path(str(tmp_path / "model.mjb"))
    theirs = mujoco.MjData(other)
    theirs.qpos[:], theirs.qvel[:] = data.qpos, data.qvel
    run(model, data, 0.5)
    run(other, theirs, 0.5)
    assert data.qpos[0] == theirs.qpos[0]


class TestMissingRows:
    """What has no row becomes a force that at most stops the joint within the step."""

    def test_without_the_equality_damping_is_a_limited_force(self):
        h, inertia, c = 0.002, 0.01, 0.5
        model, data = load(
            damping=flat(c), inertia=inertia, h=h, equality=False, limits=(-1e3, 1e3)
        )
        data.qvel[0] = 1.0
        mujoco.mj_step(model, data)
        assert data.qvel[0] == pytest.approx(1 / (1 + h * c / inertia), rel=1e-9)
        for ratio in (1e2, 1e4):
            model, data = load(
                damping=flat(ratio * inertia / h),
                inertia=inertia,
                h=h,
                equality=False,
                limits=(-1e3, 1e3),
            )
            data.qvel[0] = 1.0
            run(model, data, 1)
            assert abs(data.qvel[0]) < 1e-6

    def test_equality_switched_off_at_run_time(self):
        model, data = swinging()
        data.eq_active[0] = 0
        other, same = swinging(equality=False)
        run(model, data, 0.3)
        run(other, same, 0.3)
        assert data.qpos[0] == pytest.approx(same.qpos[0], abs=1e-12)

    def test_friction_row_removed_at_run_time(self):
        model, data = load(friction=flat(0.5), inertia=0.01)
        model.dof_frictionloss[0] = 0
        data.qvel[0] = 1.0
        mujoco.mj_step(model, data)
        assert data.qvel[0] == pytest.approx(1 - 0.002 * 0.5 / 0.01)
        run(model, data, 1)
        assert abs(data.qvel[0]) < 1e-12

    def test_without_a_friction_row_a_friction_channel_is_refused(self):
        message = "joint 'j' has a friction channel but no friction row in the solver"
        with pytest.raises(ValueError, match=message):
            load(friction=flat(0.5), joint="")

    def test_a_friction_channel_of_zero_needs_no_row(self):
        model, data = load(friction=flat(0.0), joint="")
        run(model, data, 0.1)
        assert warnings(data) == 0


class TestDisableFlags:
    """MuJoCo's flags mean for a profile what they mean for native elements."""

    @needs(SPRING)
    def test_spring(self):
        model, data = load(flat(-3.0), flag='spring="disable"')
        mujoco.mj_forward(model, data)
        assert data.qfrc_passive[0] == 0

    @needs(SPRING)
    def test_damper(self):
        model, data = load(damping=flat(3.0), flag='damper="disable"')
        data.qvel[0] = 1
        run(model, data, 0.1)
        assert data.qvel[0] == pytest.approx(1, abs=1e-9)

    def test_frictionloss(self):
        model, data = load(friction=flat(3.0), flag='frictionloss="disable"')
        data.qvel[0] = 1
        run(model, data, 0.1)
        assert data.qvel[0] == pytest.approx(1, abs=1e-9)

    def test_all_constraints(self):
        model, data = load(damping=flat(2.0), flag='constraint="disable"', limits=(-10, 10))
        data.qvel[0] = 1
        run(model, data, 0.5)
        assert data.qvel[0] == pytest.approx(np.exp(-1), rel=2e-3)

    def test_passive_forces_off_leave_the_joint_free(self):
        both = 'spring="disable" damper="disable"' if has(SPRING) else 'passive="disable"'
        model, data = swinging(flag=both)
        before = data.qvel[0]
        run(model, data, 0.1)
        assert data.qvel[0] == pytest.approx(before, abs=1e-9)


def test_native_friction_adds_to_the_channel():
    model, data = load(friction=flat(0.5), joint='frictionloss="0.3"', inertia=0.1)
    for push, moves in ((0.79, False), (0.81, True)):
        mujoco.mj_resetData(model, data)
        data.qpos[0], data.qfrc_applied[0] = 0.2, push
        run(model, data, 1)
        assert (data.qvel[0] > 1e-4) == moves


def test_friction_couples_with_contacts():
    """A block pushed along its slide against a wall: the wall carries what friction does not."""
    wall = '<worldbody><geom type="box" size=".1 .1 .1" pos="0.75 0 0"/></worldbody>'
    text = scene(friction=flat(1.0), inertia=0.5, extra=wall).replace(
        '<plugin instance="p"/>', '<geom type="sphere" size=".1" mass="0"/><plugin instance="p"/>'
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[0] = 0.5
    data.qfrc_applied[0] = 3.0
    run(model, data, 2)
    force = np.zeros(6)
    mujoco.mj_contactForce(model, data, 0, force)
    assert 2.0 - 1e-3 <= force[0] <= 3.0 + 1.0 + 1e-3
    assert abs(data.qvel[0]) < 1e-6
