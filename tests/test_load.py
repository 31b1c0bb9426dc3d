"""Load-dependent friction: what counts as load, and that its lag by a step does no harm."""

import mujoco
import numpy as np
import pytest
from joints import DISCRETE, EULER_LIKE, SOLVERS, needs
from mujoco import rollout
from scipy.integrate import solve_ivp
from test_split_steps import ROUNDING, STEPS, path_of, whole

from joda.scenes.scene import INERT, strip_plugin

G, MASS, ARM = 10.0, 0.8, 0.5
WEIGHT = G * MASS
MU = 0.2
FRICTION = int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF)
JOINTS = {
    "hinge": 'type="hinge" axis="0 -1 0" range="-2 2"',  # at q = 0 the arm lies along x
    "slide": 'type="slide" axis="0 0 1" range="-20 20"',
}
LEVER = {"hinge": ARM, "slide": 1.0}


def scene(
    kind="slide",
    *,
    mu=MU,
    joint="",
    body="",
    geom='contype="0" conaffinity="0"',
    world="",
    extra="",
    actuator="",
    h=0.002,
    gravity=True,
    option="",
    profile="",
):
    """A part of MASS, ARM beside its joint, with friction `mu` times its load.

    `world` and `extra` are more MJCF, within the worldbody and behind it.
    """
    driven = f"<actuator>{actuator}</actuator>" if actuator else ""
    return f"""
    <mujoco>
      <compiler angle="radian"/>
      <option timestep="{h}" gravity="0 0 {-G if gravity else 0}" {option}/>
      <extension><plugin plugin="joda.joint_dynamics"><instance name="p">
        {profile or f'<config key="effects" value="load_dependent_friction coefficient={mu}"/>'}
      </instance></plugin></extension>
      <worldbody>
        <body name="part" {body}><joint name="j" {JOINTS[kind]} frictionloss="1e-12" {joint}/>
          <geom name="part" type="sphere" size="0.05" pos="{ARM} 0 0" mass="{MASS}" {geom}/>
          <plugin instance="p"/></body>
        {world}
      </worldbody>
      <equality><joint name="joda_damping_j" joint1="j" {INERT}/></equality>
      {driven}{extra}
    </mujoco>"""


def load(*args, **kwargs):
    model = mujoco.MjModel.from_xml_string(scene(*args, **kwargs))
    return model, mujoco.MjData(model)


def run(model, data, seconds):
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))


def bound(model, data):
    """The friction's bound in the step taken last."""
    rows = (data.efc_type == FRICTION) & (data.efc_id == model.joint("j").dofadr[0])
    return data.efc_frictionloss[rows][0]


MOTOR = '<motor name="a" joint="j"/>'
SERVO = '<position name="a" joint="j" kp="400" kv="60"/>'
KINDS = pytest.mark.parametrize("kind", JOINTS)


# --- what counts


@KINDS
@pytest.mark.parametrize("integrator", EULER_LIKE)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_servo_that_holds_a_weight_loads_the_gear_twice(kind, integrator, solver):
    """|actuator - gravity|: it has sunk until friction and servo hold the weight together."""
    option = f'integrator="{integrator}" solver="{solver}" tolerance="1e-12"'
    model, data = load(kind, actuator=SERVO, option=option)
    run(model, data, 5)
    weight = WEIGHT * LEVER[kind] * np.cos(data.qpos[0] * (kind == "hinge"))
    assert data.qfrc_actuator[0] == pytest.approx(weight * (1 - MU) / (1 + MU), rel=1e-3)
    assert bound(model, data) == pytest.approx(2 * MU * weight / (1 + MU), rel=1e-3)
    assert abs(data.qvel[0]) < 1e-9


@KINDS
@pytest.mark.parametrize(("up", "share"), [(1, 2 * MU / (1 + MU)), (-1, -2 * MU / (1 - MU))])
def test_a_balanced_weight_gives_way_to_what_its_gear_does_not_hold(kind, up, share):
    """A push p moves it where |p| > MU |W - (p - W)|."""
    for part, moves in ((0.99, False), (1.01, True)):
        model, data = load(kind, actuator=MOTOR)
        weight = WEIGHT * LEVER[kind]
        data.ctrl[0] = weight
        run(model, data, 0.1)
        data.qfrc_applied[0] = part * share * weight
        run(model, data, 0.5)
        assert bool(up * data.qpos[0] > 1e-3) == moves
        assert moves or abs(data.qvel[0]) < 1e-9


def test_a_motor_moves_a_slide_as_the_law_says():
    """And as the same friction does, written as a number: the load is constant."""
    force = 3 * WEIGHT
    friction = MU * (force + WEIGHT)
    number = f'<config key="friction" value="0 1 | 0 1 | {friction} {friction}"/>'
    ends = []
    for profile in ("", number):
        model, data = load(actuator=MOTOR, profile=profile)
        data.ctrl[0] = force
        run(model, data, 0.1)
        before = data.qvel[0]
        run(model, data, 0.1)
        ends.append(data.qvel[0] - before)
    assert ends[0] == pytest.approx(0.1 * (force - WEIGHT - friction) / MASS, rel=1e-9)
    assert ends[0] == pytest.approx(ends[1], rel=1e-10)


def test_mujocos_own_friction_of_that_size_moves_alike():
    force = 3 * WEIGHT
    model, data = load(actuator=MOTOR)
    spec = mujoco.MjSpec.from_string(scene(actuator=MOTOR))
    strip_plugin(spec)
    spec.joint("j").frictionloss = MU * (force + WEIGHT)
    native = spec.compile()
    other = mujoco.MjData(native)
    data.ctrl[0] = other.ctrl[0] = force
    speeds = []
    for m, d in ((model, data), (native, other)):
        run(m, d, 0.1)
        begun = d.qvel[0]
        run(m, d, 0.4)
        speeds.append(d.qvel[0] - begun)
    assert speeds[0] == pytest.approx(speeds[1], rel=2e-4)  # the inert row is still there


def test_a_driven_pendulum_swings_as_scipys():
    """A servo follows a sine; what its gear transmits changes its sign on the way."""
    h, inertia = 0.0002, MASS * ARM**2 + 0.4 * MASS * 0.05**2
    kp, kv = 30.0, 0.5
    servo = f'<position name="a" joint="j" kp="{kp}" kv="{kv}"/>'
    model, data = load("hinge", actuator=servo, h=h, option='tolerance="1e-12"')
    time, path = h * np.arange(10000), []
    for t in time:
        path.append(data.qpos[0])
        data.ctrl[0] = np.sin(3 * t)
        mujoco.mj_step(model, data)

    def law(t, y):
        actuator, gravity = kp * (np.sin(3 * t) - y[0]) - kv * y[1], -WEIGHT * ARM * np.cos(y[0])
        friction = MU * abs(actuator - gravity) * np.tanh(y[1] / 1e-4)
        return y[1], (actuator + gravity - friction) / inertia

    exact = solve_ivp(law, (0, time[-1]), (0, 0), method="LSODA", t_eval=time, rtol=1e-8)
    assert np.abs(path - exact.y[0]).max() < 2e-3 * np.ptp(exact.y[0])


BOX = (
    '<body name="box" pos="0.5 0 0.1001"><joint name="box" type="slide" axis="0 0 1"/>'
    '<geom type="sphere" size="0.05" mass="0.4" contype="1" solref="0.004 1"/></body>'
)


@KINDS
def test_what_lies_on_a_joint_counts(kind):
    """The part sinks under a heavy box that presses on it by N: (1 - mu) (W + N) accelerates it.

    The box tells N: n (v + g t) is its part of the momentum, where n is its mass.
    """
    mu, n = 0.6, 4.0
    box = BOX.replace('mass="0.4"', f'mass="{n}" condim="1"')
    geom = 'contype="1" conaffinity="1" condim="1"'
    model, data = load(kind, mu=mu, world=box, geom=geom, h=0.0005)
    run(model, data, 0.06)
    pressed = n * (data.qvel[1] + G * data.time)
    assert pressed > 0.8 * WEIGHT * data.time
    momentum = -model.dof_M0[0] * data.qvel[0] / LEVER[kind]
    assert momentum == pytest.approx((1 - mu) * (WEIGHT * data.time + pressed), rel=0.01)


def test_a_knock_leaves_what_friction_lets_through():
    """m v = (1 - MU) times the knock, however long that lasts: every step's part comes, once."""
    ball = (
        '<body pos="0.5 0 -0.3"><joint name="ball" type="slide" axis="0 0 1"/>'
        '<geom type="sphere" size="0.05" mass="0.3" contype="1"/></body>'
    )
    for h in (0.0005, 0.002, 0.005):
        geom = 'contype="1" conaffinity="1"'
        model, data = load(world=ball, geom=geom, gravity=False, h=h)
        data.qvel[1] = 2.0
        run(model, data, 0.5)
        knock = 0.3 * (2.0 - data.qvel[1])
        assert knock > 0.4
        assert MASS * data.qvel[0] == pytest.approx((1 - MU) * knock, rel=1e-3)


@KINDS
@pytest.mark.parametrize("away", [1, -1])
def test_a_stop_carries_what_presses_on_it_not_the_gear(kind, away):
    """A motor that pushes into a stop loads the gear by its own force; so does gravity alone."""
    limits = 'limited="true" solreflimit="0.005 1"'
    text = scene(kind, actuator=MOTOR, joint=limits).replace('range="-2 2"', 'range="-0.1 0.1"')
    model = mujoco.MjModel.from_xml_string(text.replace('range="-20 20"', 'range="-0.1 0.1"'))
    data = mujoco.MjData(model)
    data.ctrl[0] = away * 3 * WEIGHT
    run(model, data, 3)
    weight = WEIGHT * LEVER[kind] * np.cos(data.qpos[0] * (kind == "hinge"))
    assert away * data.qpos[0] > 0.1
    assert abs(data.qvel[0]) < 1e-9
    assert bound(model, data) == pytest.approx(MU * abs(data.ctrl[0] + weight), rel=1e-9)
    data.ctrl[0] = 0
    run(model, data, 3)
    weight = WEIGHT * LEVER[kind] * np.cos(data.qpos[0] * (kind == "hinge"))
    assert bound(model, data) == pytest.approx(MU * weight, rel=1e-9)


def test_a_motor_that_pushes_on_an_obstacle_loads_the_gear_by_both():
    wall = '<geom type="sphere" size="0.05" pos="0.5 0 0.15" contype="1"/>'
    geom = 'contype="1" conaffinity="1"'
    model, data = load(world=wall, geom=geom, actuator=MOTOR, gravity=False)
    data.ctrl[0] = force = 20.0
    run(model, data, 3)
    contact, friction = -force - data.plugin_state[0], data.plugin_state[0]
    assert data.qfrc_constraint[0] == pytest.approx(contact + friction, rel=1e-9)
    assert bound(model, data) == pytest.approx(MU * (force - contact), rel=1e-6)
    assert abs(data.qvel[0]) < 1e-9


@KINDS
@pytest.mark.parametrize("place", ["part", "tip"])
def test_forces_on_bodies_count_as_applied_ones(kind, place):
    """Those of `xfrc_applied`, on the part and on what it carries."""
    tip = '<body name="tip" pos="0.7 0 0"><geom size="0.01" mass="0.1" contype="0"/></body>'
    text = scene(kind, gravity=False).replace("<plugin inst", tip + "<plugin inst")
    model = mujoco.MjModel.from_xml_string(text)
    force = np.array([3.0, -2.0, 5.0, 0.3, 0.4, -0.5])
    loads = []
    for by_body in (True, False):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        body = model.body(place).id
        if by_body:
            data.xfrc_applied[body] = force
        else:
            mujoco.mj_applyFT(
                model, data, force[:3], force[3:], data.xipos[body], body, data.qfrc_applied
            )
        mujoco.mj_step(model, data)
        loads.append(bound(model, data))
    assert loads[0] == pytest.approx(loads[1], rel=1e-12)
    assert loads[0] > 0.1


@pytest.mark.parametrize("by_actuator", [False, True])
def test_compensated_gravity_loads_the_gear_where_an_actuator_does_it(by_actuator):
    joint = 'actuatorgravcomp="true"' if by_actuator else ""
    model, data = load(body='gravcomp="1"', joint=joint, actuator=MOTOR)
    run(model, data, 0.1)
    assert abs(data.qpos[0]) < 1e-4
    expected = 2 * MU * WEIGHT if by_actuator else 0
    assert bound(model, data) == pytest.approx(expected, rel=1e-9, abs=1e-9)


RICH = {
    "world": BOX.replace("0.1001", "0.05")
    + '<geom type="plane" size="1 1 .1" pos="0 0 -0.1" contype="1"/>'
    '<body pos="0 1 0"><joint name="other" type="slide" axis="1 0 0" frictionloss="0.3"/>'
    '<geom size="0.1" mass="0.5" contype="0" conaffinity="0"/></body>',
    "extra": '<equality><joint joint1="j" joint2="other" polycoef="0 2 0 0 0"/></equality><tendon>'
    '<fixed range="-0.2 0.2" limited="true" frictionloss="0.4"><joint joint="j" coef="1.5"/>'
    "</fixed></tendon>",
    "geom": 'contype="1" conaffinity="1"',
    "actuator": SERVO,
    "joint": 'limited="true" margin="0.01"',
}
"""A contact with a box and one with the floor, a coupled joint, a tendon, a servo, and a limit."""
WAYS = {
    **{f"{solver} {integrator}": f'solver="{solver}" integrator="{integrator}"'
       for solver in SOLVERS for integrator in (*EULER_LIKE, "RK4")},
    "sparse": 'jacobian="sparse"',
    "elliptic": 'cone="elliptic"',
    "noslip": 'noslip_iterations="3"',
}  # fmt: skip


@pytest.mark.parametrize("way", [pytest.param("discrete", marks=needs(DISCRETE)), *WAYS])
@KINDS
def test_what_is_known_after_a_step_is_of_all_others_constraints_and_the_actuator(kind, way):
    option = WAYS.get(way, 'integrator="discrete"')
    text = scene(kind, **RICH, option=option).replace('range="-2 2"', 'range="-0.12 0.12"')
    model = mujoco.MjModel.from_xml_string(text.replace('range="-20 20"', 'range="-0.12 0.12"'))
    data, largest = mujoco.MjData(model), 0.0
    data.plugin_state[1] = 7  # is not looked at
    for k in range(300):
        data.ctrl[0] = 0.3 * np.sin(0.05 * k)
        mujoco.mj_step(model, data)
        rows = np.arange(data.nefc)
        kinds, ids = data.efc_type, data.efc_id
        constraint = mujoco.mjtConstraint
        own = (
            ((kinds == constraint.mjCNSTR_FRICTION_DOF) & (ids == 0))
            | ((kinds == constraint.mjCNSTR_LIMIT_JOINT) & (ids == 0))
            | ((kinds == constraint.mjCNSTR_EQUALITY) & (ids == 0))
        )
        forces = np.where(own, 0, data.efc_force)
        others = np.zeros(model.nv)
        mujoco.mj_mulJacTVec(model, data, others, forces)
        expected = others[0] - data.qfrc_actuator[0]
        assert data.plugin_state[1] == pytest.approx(expected, rel=1e-9, abs=1e-8 * len(rows))
        largest = max(largest, abs(others[0]))
    assert largest > 1


# --- the lag does no harm


@pytest.mark.parametrize("mu", [0.1, 0.5, 0.95, 2.0])
@pytest.mark.parametrize("h", [0.002, 0.02, 0.05])
@KINDS
def test_friction_never_drives(kind, h, mu):
    """At any timestep, and where it locks itself: it takes energy, but for what its row stores."""
    servo = '<position name="a" joint="j" kp="20" kv="1"/>'
    text = scene(kind, **RICH | {"actuator": servo}, h=h, mu=mu, option='iterations="200"')
    model = mujoco.MjModel.from_xml_string(text)
    data, friction, work = mujoco.MjData(model), [], []
    for k in range(1500):
        data.ctrl[0] = 0.3 * np.sign(np.sin(3 * k * h))
        mujoco.mj_step(model, data)
        friction.append(data.plugin_state[0])
        work.append(h * data.plugin_state[0] * data.qvel[0])
    stiffness = 1e4 / model.dof_invweight0[0] / h**2
    stored = 0.5 * np.max(np.abs(friction)) ** 2 / stiffness
    assert np.max(np.cumsum(work)) < stored + 1e-9
    assert np.cumsum(work)[-1] < -0.05
    data.ctrl[0] = -0.3  # onto the floor
    run(model, data, 20)
    rest = []
    for _ in range(200):
        mujoco.mj_step(model, data)
        rest.append((data.qpos[0], bound(model, data)))
    assert (np.ptp(rest, axis=0) < (1e-11, 1e-6)).all()


# --- the state


DRIVEN = {**RICH, "mu": 0.3}


@pytest.mark.slow
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("integrator", EULER_LIKE)
def test_however_a_step_is_taken_a_driven_joint_moves_the_same(integrator, step):
    model = mujoco.MjModel.from_xml_string(scene(**DRIVEN, option=f'integrator="{integrator}"'))
    expected = path_of(model, whole)
    assert np.ptp(expected[:, 0]) > 0.015
    assert np.ptp(expected[:, -1]) > 1
    np.testing.assert_allclose(path_of(model, step), expected, rtol=0, atol=ROUNDING)


def test_rollouts_on_several_threads_are_the_same():
    """And go on in the middle from the state that was saved."""
    model = mujoco.MjModel.from_xml_string(scene(**DRIVEN))
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.empty(size)
    mujoco.mj_getState(model, mujoco.MjData(model), start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    ctrl = 0.3 * np.sin(0.05 * np.arange(300) + np.arange(8)[:, None])[:, :, None]
    several = [mujoco.MjData(model) for _ in range(4)]
    one = rollout.rollout(model, several[:1], np.tile(start, (8, 1)), ctrl)[0]
    four = rollout.rollout(model, several, np.tile(start, (8, 1)), ctrl)[0]
    np.testing.assert_array_equal(one, four)
    assert np.ptp(one[:, -1, 1]) > 0.01
    rest = rollout.rollout(model, several[:1], one[:, 149], ctrl[:, 150:])[0]
    np.testing.assert_allclose(rest, one[:, 150:], rtol=0, atol=1e-9)
