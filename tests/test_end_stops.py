"""An end stop with a restitution of its own: one end bounces as asked, the other as the scene's."""

import re

import mujoco
import numpy as np
import pytest
from joints import DISCRETE, EULER_LIKE, SOLVERS, load, needs, scene
from mujoco import rollout
from scenes import write
from test_split_steps import ROUNDING, STEPS, path_of, whole

from joda import attach
from joda._core import JointSimulator, stop_damping
from joda.component import Component
from joda.effects import EndStopRestitution
from joda.joints.joint_model import JointModel
from joda.profile import Channel, Channels, Joint, JointLimitHint, Profile
from joda.scenes.limits import IMPEDANCE, limit_parameters
from joda.scenes.model import load_model
from joda.scenes.scene import set_profile

LOW, HIGH = 0.7, 0.25
PAIR = f"end_stop_restitution restitution={LOW} end=low; " + (
    f"end_stop_restitution restitution={HIGH} end=high"
)
ONE = {end: f"end_stop_restitution restitution=0.6 end={end}" for end in ("low", "high")}
MASS = 1.7


def thrown_back(model, data, end, speed) -> float:
    """Speed with which an end of the range, 0 to 1, throws the joint back, per speed before."""
    away = 1 if end == "low" else -1
    mujoco.mj_resetData(model, data)
    data.qpos[0], data.qvel[0] = 0.5, -away * speed
    inside = False
    for _ in range(round(3 / speed / model.opt.timestep)):
        mujoco.mj_step(model, data)
        inside = 0 <= data.qpos[0] <= 1 and away * data.qvel[0] > 0
        if inside:
            break
    assert inside
    return away * data.qvel[0] / speed


@pytest.mark.sweep(4)
@pytest.mark.parametrize("h", [0.0005, 0.002, 0.01])
@pytest.mark.parametrize("integrator", EULER_LIKE)
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("how", ['jacobian="dense"', 'jacobian="sparse"', 'noslip_iterations="3"'])
def test_each_end_throws_back_as_it_was_asked(how, solver, integrator, h):
    fixed = dict(inertia=MASS, integrator=integrator, solver=solver, h=h)
    model, data = load(effects=PAIR, option=f'tolerance="1e-12" {how}', **fixed)
    for end, restitution, speed in (("low", LOW, 0.4), ("high", HIGH, 1.3), ("low", LOW, 3.1)):
        assert thrown_back(model, data, end, speed) == pytest.approx(restitution, abs=0.05)


@pytest.mark.parametrize("island", ["enable", "disable"])
def test_islands_have_it_too(island):
    model, data = load(effects=PAIR, flag=f'island="{island}"')
    assert thrown_back(model, data, "low", 0.7) == pytest.approx(LOW, abs=0.05)
    data.qpos[0] = -0.001
    mujoco.mj_forward(model, data)
    assert bool(data.nisland) == (island == "enable")


def test_a_changed_timestep_leaves_the_restitution():
    model, data = load(effects=PAIR)
    for model.opt.timestep in (0.0004, 0.008):
        assert thrown_back(model, data, "low", 0.7) == pytest.approx(LOW, abs=0.05)


def knocking(effects, forces, **options) -> np.ndarray:
    """Positions and velocities of the joint, from the middle of its range."""
    model, data = load(effects=effects, inertia=MASS, **options)
    path = []
    for force in forces:
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data)
        path.append([data.qpos[0], data.qvel[0]])
    return np.array(path)


@pytest.mark.sweep(4)
@pytest.mark.parametrize("integrator", [*EULER_LIKE, "RK4"])
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("joint", ["", 'solreflimit="0.01 0.2" solimplimit="0.5 0.95 0.01"'])
@pytest.mark.parametrize("end", ONE)
def test_the_other_end_is_the_scenes_bit_for_bit(end, joint, solver, integrator):
    options = dict(joint=f'frictionloss="1e-12" {joint}', solver=solver, integrator=integrator)
    away = 3.0 if end == "low" else -3.0  # from the end that has it
    forces = np.repeat([away, -0.1 * away, 2 * away], 400)
    with_it = knocking(ONE[end], forces, **options)
    without = knocking("", forces, **options)
    assert with_it[:, 0].max() > 1 if end == "low" else with_it[:, 0].min() < 0
    np.testing.assert_array_equal(with_it, without)
    back = knocking(ONE[end], -forces, **options)
    assert np.abs(back - knocking("", -forces, **options)).max() > 0.01


@pytest.mark.parametrize(
    "flag", ["", pytest.param('diagexact="enable"', marks=needs("mjtEnableBit.mjENBL_DIAGEXACT"))]
)
def test_one_for_each_end_is_as_one_for_both(flag):
    """Up to the six digits that the scene has of the one for both."""
    words = zip(("solreflimit", "solimplimit"), limit_parameters(0.6, 0.002), strict=True)
    written = " ".join(f'{key}="{value}"' for key, value in words)
    forces = np.repeat([4.0, -6.0, 7.0], 300)
    both = knocking("", forces, joint=f'frictionloss="1e-12" {written}', flag=flag)
    apart = knocking("; ".join(ONE.values()), forces, flag=flag)
    assert np.abs(apart - both)[:, 0].max() < 1e-5
    assert both[:, 0].max() > 1 and both[:, 0].min() < 0


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("solver", SOLVERS)
def test_however_a_step_is_taken_it_is_the_same(solver, step):
    model, _ = load(effects=PAIR, limits=(-0.05, 0.05), solver=solver)
    expected = path_of(model, whole)
    assert expected[:, 0].min() < -0.05 and expected[:, 0].max() > 0.05
    np.testing.assert_allclose(path_of(model, step), expected, rtol=0, atol=ROUNDING)


def test_inverse_dynamics_know_the_stop():
    model, data = load(effects=PAIR)
    data.qpos[0], data.qvel[0], data.qfrc_applied[0] = -0.002, -0.3, 4.0
    mujoco.mj_forward(model, data)
    assert data.qfrc_constraint[0] > 1
    mujoco.mj_inverse(model, data)
    assert data.qfrc_inverse[0] == pytest.approx(4.0, abs=1e-8)


def test_threads_are_bit_identical():
    model, data = load(effects=PAIR)
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.empty((16, mujoco.mj_stateSize(model, full)))
    for k in range(16):
        data.qpos[0], data.qvel[0] = 0.06 * k, (-1) ** k * (1 + 0.2 * k)
        mujoco.mj_getState(model, data, initial[k], full)
    ends = []
    for count in (1, 4):
        every = [mujoco.MjData(model) for _ in range(count)]
        ends.append(rollout.rollout(model, every, initial, nstep=2000)[0])
    np.testing.assert_array_equal(*ends)
    assert (np.diff(np.sign(ends[0][:, :, 2]), axis=1) != 0).any(axis=1).all()  # all came back


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
def test_only_the_rows_of_that_end_are_set(jacobian):
    """Three joints near all their ends at once, of which the middle one has it at its low end."""
    joint = '<body pos="0 {k} 0"><joint name="j{k}" type="slide" axis="1 0 0" range="0 0.1"'
    other = f'{joint} margin="1"/><geom size="0.1" contype="0"/></body>'
    text = scene(effects=ONE["low"], limits=(0.0, 0.1), joint='frictionloss="1e-12" margin="1"')
    text = text.replace("<worldbody>", "<worldbody>" + other.format(k=1))
    text = text.replace("</worldbody>", other.format(k=2) + "</worldbody>")
    text = text.replace("<flag />", "").replace("<option", f'<option jacobian="{jacobian}"', 1)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    limits = data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
    assert data.efc_id[limits].tolist() == [0, 0, 1, 1, 2, 2]
    own = IMPEDANCE / (1 - IMPEDANCE) * 1.0
    strength = data.efc_D[limits] * model.dof_invweight0[data.efc_id[limits]]
    assert strength[2] == pytest.approx(own)
    assert (np.delete(strength, 2) < 0.9 * own).all()


def test_a_profile_that_is_swapped_in_brings_it():
    model, data = load()
    profile = Profile(
        joint=Joint(name="j", type="slide", range=(0, 1), unit="m"),
        effects=(EndStopRestitution(restitution=LOW, end="low"),),
    )
    set_profile(model, data, "j", profile)
    assert thrown_back(model, data, "low", 1.0) == pytest.approx(LOW, abs=0.05)


# --- the joint by itself


def simulator(effects, **changes) -> JointSimulator:
    body = dict(inertia=MASS, row_inertia=0, weight=(0, 0), hinge=False)
    ends = dict(solref=(0.02, 1.0), solimp=(0.9, 0.95, 0.001, 0.5, 2.0))
    return JointSimulator(0, 1, ["", "sum"] * 3 + [effects], **body | ends | changes)


@pytest.mark.parametrize("effects", [PAIR, *ONE.values()])
def test_the_joint_by_itself_knocks_as_in_the_engine(effects):
    forces = np.repeat([4.0, -9.0, 7.0, -2.0], 300)
    visited = knocking(effects, forces)[:, 0]
    assert visited.max() > 1 and visited.min() < 0
    _, after = simulator(effects).replay(forces, [0], [(0.5, 0)], [True], 0.002)
    np.testing.assert_allclose(after, visited, rtol=0, atol=1e-6)


def test_only_a_restitution_of_both_ends_is_in_the_solver_parameters():
    joint_model = JointModel(1.0, 0.0, (0, 0), False, (0.05, 0.7), (0.8, 0.9, 0.01, 0.5, 2.0))
    joint = Joint(name="j", type="slide", range=(0, 1), unit="m")

    def limits(end):
        effect = EndStopRestitution(restitution=0.5, end=end)
        return joint_model.limits(Profile(joint=joint, effects=(effect,)), 0.002)

    assert limits("low") == limits("high") == (joint_model.solref, joint_model.solimp)
    solref, solimp = limits("both")
    assert solref[1] == pytest.approx(-stop_damping(0.5) / 0.002, rel=1e-5)
    assert solimp == (IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0)


# --- what attach writes

XML = """
<mujoco><compiler angle="radian"/><option gravity="0 0 0" {option}/><worldbody><body>
  <joint name="j" axis="0 1 0" range="0 0.4" solreflimit="0.03 0.8"/>
  <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/></body></worldbody>
</mujoco>"""


def attached(folder, *effects, force=0.0, inertia=0.01, option="", **more):
    """The scene and what attach notes; the profile presses with `force` (N·m) against an end."""
    push = Component(interval=(0, 1), x=(0, 1), y=(force, force))
    profile = Profile(
        joint=Joint(name="j", type="hinge", range=(0, 0.4), unit="rad"),
        channels=Channels(conservative=Channel(components=(push,) if force else ())),
        effects=effects,
        **more,
    )
    write(folder, XML.format(inertia=inertia, option=option))
    notes = attach(folder / "in.xml", profile, folder / "out.xml", force=True)
    return load_model(folder / "out.xml"), notes


def test_the_scenes_solver_parameters_stay(tmp_path):
    low = EndStopRestitution(restitution=LOW, end="low")
    model, notes = attached(tmp_path, low)
    assert model.jnt_solref[0] == pytest.approx([0.03, 0.8]) and notes == []
    hint = JointLimitHint(selected_side="high_end", elasticity="medium")
    model, _ = attached(tmp_path, low, joint_limit_hint=hint)
    assert model.jnt_solref[0, 1] == pytest.approx(0.25)
    high = EndStopRestitution(restitution=HIGH, end="high")
    data = mujoco.MjData(attached(tmp_path, low, high)[0])
    assert data.model.jnt_solref[0] == pytest.approx([0.03, 0.8])


@pytest.mark.parametrize(("end", "force"), [("low", 0.2), ("high", -0.2)])
def test_only_the_scenes_end_is_made_firm(tmp_path, end, force):
    """A light rocker is pressed against one end or the other."""
    own = EndStopRestitution(restitution=LOW, end=end)
    firm = "has firmer limits now"
    assert any(firm in note for note in attached(tmp_path, own, force=force, inertia=1e-5)[1])
    assert not any(firm in n for n in attached(tmp_path, own, force=-force, inertia=1e-5)[1])
    assert any(firm in n for n in attached(tmp_path, force=-force, inertia=1e-5)[1])


@needs(DISCRETE)
def test_attach_says_that_the_discrete_integrator_has_no_place_for_it(tmp_path):
    one = EndStopRestitution(restitution=LOW, end="low")
    said = 'one end alone does nothing with integrator="discrete"'
    with pytest.raises(ValueError, match=re.escape(said)):
        attached(tmp_path, one, option='integrator="discrete"')
    attached(tmp_path, EndStopRestitution(restitution=LOW), option='integrator="discrete"')
