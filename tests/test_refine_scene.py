"""Refining in the whole scene: the same answer as of the joint by itself, and what that cannot."""

import mujoco
import numpy as np
import pytest
from refine_table import STEP, planted, pushed, quiet_rig

from joda import JodaError, attach, read_profiles, refine
from joda.component import Component
from joda.estimation.profile_parameters import Parameters
from joda.field import evaluate
from joda.joints.joint_model import joint_model
from joda.measured.runs import Run
from joda.measured.scene_log import SceneRun, read_scene_run
from joda.mjx.shooting import Scene
from joda.profile import CHANNELS, Channel, Channels, Joint, Profile, Resistance
from joda.refining.engine import JointEngine
from joda.refining.scene import SceneEngine
from joda.refining.scene_or_joint import together
from joda.refining.shooting import Shooting

QUIET = 1e-4
"""Noise of positions, as a part of the range."""
ARM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    {table}
    <body>
      <joint name="shoulder" axis="0 1 0" range="-2 2" limited="true" damping=".1"/>
      <inertial pos="0.2 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
      <body pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" range="-2 2" limited="true" damping=".05"/>
        <inertial pos="0.15 0 0" mass="0.8" diaginertia="0.01 0.01 0.01"/>
        {tip}
      </body>
    </body>
  </worldbody>
  <actuator>{motor}</actuator>
</mujoco>
"""


def flat(value: float) -> Component:
    return Component(label="constant", interval=(0, 1), x=(0, 1), y=(value, value))


def sprung(stiffness: float, friction: float, damping: float) -> Profile:
    """The elbow with a spring, friction and damping."""
    y = tuple(stiffness * value for value in (1, 0.4, -0.5, -1))
    spring = Component(label="spring", interval=(0, 1), x=(0, 0.3, 0.6, 1), y=y)
    return Profile(
        joint=Joint(name="elbow", type="hinge", range=(-2, 2), unit="rad"),
        channels=Channels(
            conservative=Channel(components=(spring,)),
            friction=Resistance(components=(flat(friction),)),
            damping=Resistance(components=(flat(damping),)),
        ),
    )


TRUE, START = sprung(2.0, 0.08, 0.1), sprung(3.0, 0.15, 0.05)


def arm(folder, profile, name="arm.xml", table="", tip="", motor=""):
    """The scene with a profile of its elbow."""
    plain = folder / "plain.xml"
    plain.write_text(ARM.format(table=table, tip=tip, motor=motor))
    attach(plain, profile, folder / name, native="keep", force=True)
    return folder / name


def log(path, model, rng, swing=1.2, seconds=2.0, noise=1e-3):
    """The arm let go somewhere, both joints logged."""
    data, rows = mujoco.MjData(model), []
    data.qpos[:2] = rng.uniform(-swing, swing, 2)
    for _ in range(round(seconds / model.opt.timestep)):
        rows.append((data.time, *(data.qpos[:2] + rng.normal(0, noise, 2))))
        mujoco.mj_step(model, data)
    lines = (",".join(f"{x:.7f}" for x in row) for row in rows)
    path.write_text("\n".join(["time,position:shoulder,position:elbow", *lines]) + "\n")
    return path


def scaled(profile: Profile, factors: dict[str, float]) -> Profile:
    content = profile.model_dump()
    for name, factor in factors.items():
        for component in content["channels"][name]["components"]:
            component["y"] = [factor * y for y in component["y"]]
    return Profile.model_validate(content)


@pytest.fixture(scope="module")
def both():
    """A planted door from its wrong start: by itself in C++, and as a scene in MJX."""
    seed = int(np.random.default_rng().integers(2**31))
    case, rng = planted("detent_internal", seed), np.random.default_rng(seed)
    factors = dict(zip(CHANNELS, rng.uniform(0.7, 1.4, 3), strict=True))
    start = scaled(case.true, factors)
    span, model = case.found.joint.range, quiet_rig(case.found, start)
    width, force = float(np.ptp(span)), float(np.abs(case.runs[0].force).max()) / 2
    right, noise = quiet_rig(case.found, case.true), QUIET * width
    runs = []
    for pace in (2.0, 1.0):
        hand = pushed(right, width, force, rng, pace, 2.5)
        noisy = hand.position + rng.normal(0, noise, len(hand.time))
        runs.append(Run("run.csv", hand.time, noisy, None, hand.force, True))
    own = joint_model(case.found, start, model, 0)
    by_itself = JointEngine(own, span, runs, noise, STEP)
    nothing = np.zeros((len(runs[0].time), 0))
    together = [
        SceneRun(
            **vars(run),
            joints=(0,),
            positions=run.position[:, None],
            commands=nothing,
            forces=run.force[:, None],
        )
        for run in runs
    ]
    scene = Scene(model, {case.found.joint.name: start}, (0,), ("gravity_offset",))
    parameters = Parameters(start, ("strengths", "inertia"))
    engines = by_itself, SceneEngine(scene, 0, span, together, noise, own.inertia)
    return factors, [Shooting(engine, parameters) for engine in engines]


@pytest.mark.long
def test_both_engines_move_alike_and_have_the_same_slopes(both):
    _, (alone, scene) = both
    parameters = alone.parameters
    rng = np.random.default_rng()
    theta = parameters.start + 0.02 * rng.normal(size=len(parameters.start))
    found = []
    for one in (alone, scene):
        estimator = one.estimator(0.4)
        start = estimator.segments.start
        found.append(estimator.linear(one.simulator, one.unknowns(), theta, start))
    mine, theirs = found
    for name in ("r", "J", "S"):  # differences are off where a segment sticks or snaps within them
        a, b = (getattr(one, name) for one in (mine, theirs))
        assert np.median(np.abs(a - b)) < 1e-2 * np.sqrt(np.median(a**2)), name


@pytest.mark.long
def test_both_engines_find_the_same_numbers(both):
    factors, shootings = both
    found = []
    for one in shootings:
        theta = one.parameters.start
        for length in (0.1, 0.4, 0.4):
            theta = one.fit_segments(one.estimator(length), theta, one.parameters.prior_std, 20)
        found.append(theta)
    np.testing.assert_allclose(found[1], found[0], atol=1e-3)
    truth = [1 / factors[slot.channel] for slot in shootings[0].parameters.slots[:-1]]
    np.testing.assert_allclose(found[1], [*truth, 0.0], atol=0.02)


@pytest.mark.long
def test_an_arm_whose_other_joint_moves_is_refined_in_its_scene(tmp_path):
    rng = np.random.default_rng()
    right = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE, "true.xml")))
    files = [log(tmp_path / f"{k}.csv", right, rng) for k in range(3)]
    scene = arm(tmp_path, START)
    done = refine(scene, "elbow", files[:2], tmp_path / "better.xml", check=files[2:])
    (told,) = [note for note in done.notes if "whole scene" in note]
    assert "other joints push this one" in told
    assert done.after < 1.3 * done.noise and done.checked[1] < 1.5 * done.noise
    found = read_profiles(tmp_path / "better.xml")["elbow"]
    s = np.linspace(0.25, 0.75, 21)
    for name in CHANNELS:
        a, b = (evaluate(getattr(p.channels, name), s)[0] for p in (found, TRUE))
        assert np.sqrt(np.mean((a - b) ** 2)) < 0.1 * np.abs(b).max(), name


PUSHED = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.005" integrator="implicitfast" gravity="0 0 0"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body>
      <joint name="elbow" axis="0 0 1" range="-2 2" limited="true" armature="0.02"/>
      <geom name="leaf" type="capsule" fromto="0 0 0 .5 0 0" size=".02" conaffinity="1"/>
    </body>
    <body pos=".4 -.1 0">
      <joint name="finger" type="slide" axis="0 1 0" range="-1 1" damping="4"/>
      <geom name="tip" type="sphere" size=".03" contype="1"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="finger"/></actuator>
</mujoco>
"""


@pytest.mark.long
def test_a_door_that_another_body_pushes_is_refined_in_its_scene(tmp_path):
    rng, names = np.random.default_rng(), ("true.xml", "start.xml")
    (tmp_path / "plain.xml").write_text(PUSHED)
    for profile, name in zip((TRUE, START), names, strict=True):
        attach(tmp_path / "plain.xml", profile, tmp_path / name)
    right = mujoco.MjModel.from_xml_path(str(tmp_path / "true.xml"))
    files = []
    for k in range(3):
        data, rows = mujoco.MjData(right), []
        size, pace = rng.uniform(2, 4), rng.uniform(0.5, 0.8)
        for _ in range(400):
            data.ctrl[0] = size * np.sin(2 * np.pi * pace * data.time)
            rows.append((data.time, *(data.qpos + rng.normal(0, 3e-4, 2)), data.ctrl[0]))
            mujoco.mj_step(right, data)
        lines = (",".join(f"{x:.7f}" for x in row) for row in rows)
        files.append(tmp_path / f"{k}.csv")
        files[-1].write_text(
            "\n".join(["time,position:elbow,position:finger,ctrl:push", *lines]) + "\n"
        )
    done = refine(
        tmp_path / "start.xml", "elbow", files[:2], tmp_path / "better.xml",
        check=files[2:], fit=("strengths",), iterations=12,
    )  # fmt: skip
    (told,) = [note for note in done.notes if "whole scene" in note]
    assert "touches" in told
    assert done.windows[1] < 1.5 * done.noise < 0.5 * done.windows[0]
    found = read_profiles(tmp_path / "better.xml")["elbow"]
    s = np.linspace(0.4, 0.6, 21)
    a, b = (evaluate(p.channels.conservative, s)[0] for p in (found, TRUE))
    assert np.sqrt(np.mean((a - b) ** 2)) < 0.1 * np.abs(b).max()


def numbered(model, name="elbow"):
    return model, model.joint(name).id


def test_the_scene_is_chosen_where_other_joints_or_contacts_move_the_joint(tmp_path):
    rng = np.random.default_rng()
    model = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE)))
    low = 0.0
    while low < 0.2:  # rad, where the elbow's tip is below the table
        moving = log(tmp_path / "moving.csv", model, rng)
        low = float(np.loadtxt(moving, delimiter=",", skiprows=1)[:, 2].max())
    found, (note,) = together(*numbered(model), [moving], [], False, None)
    assert found and "other joints push" in note
    assert together(*numbered(model), [moving], [], False, False) == (None, [])
    still = tmp_path / "still.csv"
    rows = moving.read_text().splitlines()
    rows[1:] = [",".join((t, "0", q)) for t, _, q in (row.split(",") for row in rows[1:])]
    still.write_text("\n".join(rows) + "\n")
    assert together(*numbered(model), [still], [], False, None) == (None, [])
    table = '<geom name="table" type="plane" pos="0 0 -.02" size="2 2 .1"/>'
    tip = '<geom name="tip" type="sphere" size=".02" pos=".3 0 0" mass="0"/>'
    touched = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE, table=table, tip=tip)))
    found, (note,) = together(*numbered(touched), [still], [], False, None)
    assert found and "'tip' touches 'table' in still.csv" in note


def test_where_the_scene_cannot_be_simulated_it_is_said(tmp_path):
    rng = np.random.default_rng()
    model = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE)))
    moving = log(tmp_path / "moving.csv", model, rng)
    driven = '<motor name="m" joint="elbow"/>'
    other = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE, motor=driven)))
    with pytest.raises(JodaError, match=r"moving\.csv: no column 'ctrl:m'; what moves the scene's"):
        together(*numbered(other), [moving], [], False, True)
    found, (note,) = together(*numbered(other), [moving], [], False, None)
    assert not found and "fitted by itself, not in its scene: " in note and "'ctrl:m'" in note
    assert together(*numbered(other), [moving], [], True, True)[0]  # --passive
    alone = tmp_path / "alone.csv"
    alone.write_text(moving.read_text().replace("position:elbow", "elsewhere"))
    with pytest.raises(JodaError, match=r"alone\.csv: no column 'position:elbow' beside "):
        together(*numbered(other), [alone], [], True, True)
    slow = '<general name="m" joint="shoulder" dyntype="filter" dynprm="0.1"/>'
    other = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE, motor=slow)))
    with pytest.raises(JodaError, match=r"actuators have a state \(dyntype\), which no run tells"):
        together(*numbered(other), [moving], [], True, True)
    tip = '<geom type="box" size=".02 .03 .04" pos=".3 0 0" mass="0"/>'
    table = '<geom type="cylinder" pos="0 0 -.3" size=".1 .1"/>'
    other = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE, table=table, tip=tip)))
    with pytest.raises(JodaError, match=r"^MJX cannot simulate this scene: "):
        together(*numbered(other), [moving], [], False, True)
    curve = tmp_path / "curve.csv"
    curve.write_text("position,force\n" + "".join(f"{k / 10},1\n" for k in range(9)))
    with pytest.raises(JodaError, match="a curve has no time, and a scene cannot be moved along"):
        together(*numbered(model), [curve], [], False, True)
    short = tmp_path / "short.csv"
    short.write_text("time,position\n" + "".join(f"{k / 10},{k / 50}\n" for k in range(9)))
    with pytest.raises(JodaError, match=r"short\.csv: the logs must be of the same joints,"):
        together(*numbered(model), [moving, short], [], False, True)


def test_a_run_of_a_scene_has_all_that_is_put_into_it(tmp_path):
    motor = '<motor name="m" joint="shoulder"/>'
    model = mujoco.MjModel.from_xml_path(str(arm(tmp_path, TRUE, motor=motor)))
    rng, n = np.random.default_rng(), 20
    time, (p, q, u, f) = np.arange(n) / 100, rng.normal(size=(4, n))
    table = np.stack([time, p, q, u, f], axis=1)
    names = "time,position:shoulder,position:elbow,ctrl:m,force:elbow"
    (tmp_path / "log.csv").write_text(
        "\n".join([names, *(",".join(map(repr, map(float, row))) for row in table)]) + "\n"
    )
    run = read_scene_run(model, tmp_path / "log.csv", model.joint("elbow").id)
    np.testing.assert_allclose(run.positions, np.stack([q, p], axis=1))
    np.testing.assert_allclose(run.position, q)
    put = run.inputs(time[:6])
    np.testing.assert_allclose(put[:, 0], u[:5])
    np.testing.assert_allclose(put[:, 1 + model.joint("elbow").dofadr[0]], f[:5])
    assert not put[:, 1 + model.joint("shoulder").dofadr[0]].any()
    half = run.part(slice(5, 15))
    assert len(half.commands) == len(half.positions) == len(half.time) == 10
