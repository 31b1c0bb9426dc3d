"""The joint behaves as its curves say: closed forms, for every solver and integrator."""

import itertools

import mujoco
import numpy as np
import pytest
from joints import DISCRETE, EULER_LIKE, SOLVERS, component, flat, load, needs, run, scene
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

COMBINATIONS = list(itertools.product(SOLVERS, EULER_LIKE))
WIDE = (-1e6, 1e6)
FRICTION = mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "integrator"), [*COMBINATIONS, *((s, "RK4") for s in SOLVERS)])
@pytest.mark.parametrize("ratio", 10.0 ** np.arange(-4, 5))
def test_terminal_speed_is_force_over_damping(solver, integrator, ratio):
    h, inertia, push = 0.002, 0.01, 1.0
    damping = ratio * inertia / h
    model, data = load(
        damping=flat(damping),
        inertia=inertia,
        h=h,
        limits=WIDE,
        solver=solver,
        integrator=integrator,
    )
    data.qfrc_applied[0] = push
    data.qvel[0] = 0.9 * push / damping
    mujoco.mj_step(model, data, int(np.ceil(20 / ratio)) + 50)
    assert data.qvel[0] == pytest.approx(push / damping, rel=1e-6)


@pytest.mark.parametrize(("solver", "integrator"), COMBINATIONS)
def test_terminal_speed_with_friction_and_damping(solver, integrator):
    model, data = load(
        friction=flat(0.3),
        damping=flat(5),
        inertia=0.01,
        limits=WIDE,
        solver=solver,
        integrator=integrator,
    )
    data.qfrc_applied[0] = -1
    run(model, data, 1)
    assert data.qvel[0] == pytest.approx(-(1 - 0.3) / 5, rel=1e-6)


def test_damping_is_backward_euler():
    h, inertia, damping = 0.002, 0.01, 5.0
    model, data = load(damping=flat(damping), inertia=inertia, h=h)
    data.qvel[0] = 0.1
    mujoco.mj_step(model, data)
    assert data.qvel[0] == pytest.approx(0.1 / (1 + h * damping / inertia), rel=1e-12)


@pytest.mark.parametrize(("solver", "integrator"), [*COMBINATIONS, ("Newton", "RK4")])
@pytest.mark.parametrize(("inertia", "scale"), [(1e-6, 0.01), (1e-2, 1.0), (10.0, 100.0)])
def test_breakaway_at_the_friction_curve(solver, integrator, inertia, scale):
    model, data = load(
        friction=component((0, 1), (0, 1), (scale, 3 * scale)),
        inertia=inertia,
        solver=solver,
        integrator=integrator,
    )
    for fraction, moves in ((0.999, False), (1.001, True)):
        mujoco.mj_resetData(model, data)
        data.qpos[0] = 0.25
        data.qfrc_applied[0] = fraction * 1.5 * scale
        run(model, data, 0.2)
        free = 0.5 * abs(fraction - 1) * 1.5 * scale / inertia * 0.2**2  # at constant friction
        assert (
            abs(data.qpos[0] - 0.25) > 0.1 * min(free, 1e-2) if moves else abs(data.qvel[0]) < 1e-9
        )


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "integrator"), [*COMBINATIONS, ("Newton", "RK4")])
@pytest.mark.parametrize(("inertia", "friction"), [(1e-6, 0.01), (1e-2, 1.0), (10.0, 100.0)])
def test_a_held_joint_does_not_creep(solver, integrator, inertia, friction):
    model, data = load(
        friction=flat(friction), inertia=inertia, solver=solver, integrator=integrator
    )
    data.qfrc_applied[0] = 0.95 * friction
    run(model, data, 60)
    assert abs(data.qpos[0] - 0.5) < 1e-5


def test_a_held_lid_under_gravity_does_not_creep():
    model, data = load(kind="hinge", limits=(0, 2), friction=flat(4.0), inertia=0.5)
    for start in (0.4, 1.0, 1.7):
        mujoco.mj_resetData(model, data)
        data.qpos[0] = start
        for _ in range(60 * 10):
            data.qfrc_applied[0] = -3.5 * np.cos(data.qpos[0])
            mujoco.mj_step(model, data, 50)
        assert abs(data.qpos[0] - start) < 2 * 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "integrator"), COMBINATIONS)
@pytest.mark.parametrize("inertia", [1e-6, 1e-2, 1.0])
def test_a_detent_settles_where_its_energy_is_least(solver, integrator, inertia):
    x, y = np.array([0, 0.2, 0.55, 0.8, 1]), np.array([0, 1.0, 0.2, -1.5, 0])
    bottom = 0.3 + 0.2 * brentq(PchipInterpolator(x, y), 0.5, 0.7)
    model, data = load(
        component((0.3, 0.5), x, y),
        damping=flat(2 * np.sqrt(inertia * 10)),
        inertia=inertia,
        solver=solver,
        integrator=integrator,
    )
    for start in (0.34, bottom + 0.03, 0.47):
        mujoco.mj_resetData(model, data)
        data.qpos[0] = start
        run(model, data, 20)
        assert data.qpos[0] == pytest.approx(bottom, abs=1e-6)


@pytest.mark.parametrize("inertia", [1e-5, 1e-2, 1.0])
def test_a_bistable_joint_settles_on_the_side_where_it_is_let_go(inertia):
    x, y = np.linspace(0, 1, 9), np.array([0.5, 1, 0, -1.2, 0, 1.2, 0, -1, -0.5])
    model, data = load(
        component((0, 1), x, y), damping=flat(2 * np.sqrt(inertia * 5)), inertia=inertia
    )
    for start, well in ((0.1, 0.25), (0.45, 0.25), (0.55, 0.75), (0.9, 0.75)):
        mujoco.mj_resetData(model, data)
        data.qpos[0] = start
        run(model, data, 20)
        assert data.qpos[0] == pytest.approx(well, abs=1e-6)


@pytest.mark.parametrize("integrator", EULER_LIKE)
def test_a_smooth_spring_keeps_its_energy_as_mujocos_own_does(integrator):
    stiffness, inertia, h = 40.0, 0.5, 0.002
    line = component((0, 1), (0, 1), (0.5 * stiffness, -0.5 * stiffness))
    ours, mine = load(line, inertia=inertia, h=h, integrator=integrator)
    native = mujoco.MjModel.from_xml_string(
        scene(
            inertia=inertia,
            h=h,
            integrator=integrator,
            joint=f'frictionloss="1e-12" stiffness="{stiffness}" springref="0.5"',
        )
    )
    theirs = mujoco.MjData(native)
    mine.qpos[0] = theirs.qpos[0] = 0.9

    def energy(data):
        return 0.5 * inertia * data.qvel[0] ** 2 + 0.5 * stiffness * (data.qpos[0] - 0.5) ** 2

    start = energy(mine)
    for _ in range(100):
        run(ours, mine, 0.1)
        run(native, theirs, 0.1)
        assert mine.qpos[0] == pytest.approx(theirs.qpos[0], abs=1e-8)
    assert abs(energy(mine) - start) <= abs(energy(theirs) - start) + 1e-9


@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_equals_the_native_joint_step_for_step(kind):
    """Constant friction and damping and a linear spring, from 500 random states, under Euler."""
    stiffness, friction, damping, inertia = 3.0, 0.4, 0.7, 0.05
    line = component((0, 1), (0, 1), (0.5 * stiffness, -0.5 * stiffness))
    ours, mine = load(line, flat(friction), flat(damping), kind=kind, inertia=inertia)
    h = ours.opt.timestep
    hard = f'solreffriction="0 {-1 / h}" solimpfriction="0.9999 0.9999"'
    attributes = (
        f'stiffness="{stiffness}" springref="0.5" frictionloss="{friction}" damping="{damping}"'
    )
    text = scene(kind=kind, inertia=inertia, joint=f"{attributes} {hard}", equality=False)
    native = mujoco.MjModel.from_xml_string(text)
    theirs = mujoco.MjData(native)
    random = np.random.default_rng()
    sliding = 0
    for _ in range(500):
        for model, data in ((ours, mine), (native, theirs)):
            mujoco.mj_resetData(model, data)
        mine.qpos[0] = theirs.qpos[0] = random.uniform(0.1, 0.9)
        mine.qvel[0] = theirs.qvel[0] = random.normal() * 2
        mine.qfrc_applied[0] = theirs.qfrc_applied[0] = random.normal() * 2
        mujoco.mj_step(ours, mine)
        mujoco.mj_step(native, theirs)
        forces = [d.efc_force[d.efc_type == FRICTION][0] for d in (mine, theirs)]
        if np.abs(forces) == pytest.approx(friction, rel=1e-12):
            sliding += 1  # else one of them stops within the step, where the native joint's damping
            assert mine.qvel[0] == pytest.approx(theirs.qvel[0], abs=1e-9)  # ignores the stop
            assert mine.qpos[0] == pytest.approx(theirs.qpos[0], abs=1e-9)
    assert sliding > 450


def test_rk4_is_right_in_the_limit():
    """Halving the step halves the error against SciPy's integration, damping varying with s."""
    from scipy.integrate import solve_ivp

    x = np.array([0, 0.3, 0.6, 1])
    force, damping = np.array([2.0, 0.5, -1, -2]), np.array([0.1, 1.0, 0.2, 0.5])
    F, C = PchipInterpolator(x, force), PchipInterpolator(x, damping)
    fine = solve_ivp(
        lambda t, z: [z[1], (F(z[0]) - C(z[0]) * z[1]) / 0.2],
        (0, 1),
        [0.15, 0.0],
        rtol=1e-11,
        atol=1e-12,
    ).y[0, -1]
    errors = []
    for h in (0.004, 0.002, 0.001):
        model, data = load(
            component((0, 1), x, force),
            "",
            component((0, 1), x, damping),
            inertia=0.2,
            h=h,
            integrator="RK4",
        )
        data.qpos[0] = 0.15
        run(model, data, 1)
        errors.append(abs(data.qpos[0] - fine))
    assert errors[2] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", EULER_LIKE)
def test_trajectory_converges_to_scipys(integrator):
    """Conservative force, friction and damping varying with s, against a fine-step integration."""
    x = np.array([0, 0.3, 0.6, 1])
    values = {"F": [3.0, 0.8, -1, -3], "f": [0.1, 0.3, 0.2, 0.1], "C": [0.1, 1.0, 0.2, 0.5]}
    curve = {name: PchipInterpolator(x, y) for name, y in values.items()}
    q, v, fine = 0.15, 0.0, 1e-5
    for _ in range(round(0.4 / fine)):  # slides in one direction: friction keeps its sign
        a = (curve["F"](q) - curve["f"](q) - curve["C"](q) * v) / 0.2
        v += fine * a
        q += fine * v
        if v < 0:
            break
    errors = []
    for h in (0.002, 0.001):
        model, data = load(
            *(component((0, 1), x, y) for y in values.values()),
            inertia=0.2,
            h=h,
            integrator=integrator,
        )
        data.qpos[0] = 0.15
        run(model, data, 0.4)
        errors.append(abs(data.qpos[0] - q))
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.3)


def test_beyond_the_range_the_force_of_the_end_is_held():
    model, data = load(
        component((0, 1), (0, 1), (-2.0, 1.0)), joint='frictionloss="1e-12" limited="false"'
    )
    for position, force in ((-5.0, -2.0), (0.0, -2.0), (1.0, 1.0), (5.0, 1.0)):
        data.qpos[0] = position
        mujoco.mj_forward(model, data)
        assert data.qfrc_passive[0] == pytest.approx(force)


@needs(DISCRETE)
class TestDiscrete:
    """The discrete integrator makes the rows anew: documented limits, never unstable."""

    @pytest.mark.parametrize("ratio", 10.0 ** np.arange(-4, 5))
    def test_damping_is_stable_and_right_for_small_steps(self, ratio):
        h, inertia, push = 0.002, 0.01, 1.0
        damping = ratio * inertia / h
        model, data = load(
            damping=flat(damping), inertia=inertia, h=h, limits=WIDE, integrator="discrete"
        )
        data.qfrc_applied[0] = push
        mujoco.mj_step(model, data, int(np.ceil(20 / ratio)) + 200)
        terminal = push / damping + push * h / inertia  # what the explicit, limited force gives
        assert data.qvel[0] == pytest.approx(terminal, rel=1e-6)

    def test_a_stiff_spring_is_bounded(self):
        model, data = load(
            component((0, 1), (0, 1), (5e5, -5e5)), inertia=0.01, integrator="discrete"
        )
        data.qpos[0] = 0.7
        run(model, data, 10)
        assert data.qpos[0] == pytest.approx(0.5, abs=1e-3)


def test_noslip_does_not_lock_the_damping():
    model, data = load(
        friction=flat(0.3),
        damping=flat(0.5),
        inertia=0.1,
        limits=WIDE,
        option='tolerance="1e-12" noslip_iterations="5"',
    )
    data.qfrc_applied[0] = 1
    run(model, data, 5)
    assert data.qvel[0] == pytest.approx((1 - 0.3) / 0.5, rel=0.02)
    data.qfrc_applied[0] = 0.29
    data.qvel[0] = 0
    start = data.qpos[0]
    run(model, data, 10)
    assert abs(data.qpos[0] - start) < 1e-5


@pytest.mark.parametrize("inertia", [1e-6, 1e-3, 1.0])
def test_a_stiff_spring_is_bounded(inertia):
    model, data = load(component((0, 1), (0, 1), (5e5, -5e5)), inertia=inertia)
    data.qpos[0] = 0.7
    run(model, data, 1)
    assert data.qpos[0] == pytest.approx(0.5, abs=1e-6)
    assert abs(data.qvel[0]) < 1e-3
