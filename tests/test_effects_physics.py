"""Effects in MuJoCo's step, against closed forms and SciPy."""

import copy

import mujoco
import numpy as np
import pytest
from mujoco import rollout
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from joda import attach
from joda.component import Component
from joda.effects import (
    AsymmetricFriction,
    Backlash,
    DirectionDependentDamping,
    GravityOffset,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.profile import Channels, Joint, Profile, Resistance

MASS, LENGTH = 0.8, 0.4
FORMS = {
    "slide": (
        '<body><joint name="j" type="slide" axis="1 0 0" range="-100 100"/>'
        f'<geom size="0.05" mass="{MASS}"/></body>'
    ),
    # a point mass on an arm; at q = 0 it hangs straight down
    "pendulum": (
        '<body><joint name="j" type="hinge" axis="0 1 0" range="-100 100"/>'
        f'<inertial pos="0 0 {-LENGTH}" mass="{MASS}" diaginertia="1e-9 1e-9 1e-9"/></body>'
    ),
}


def build(folder, *effects, friction=0.0, damping=0.0, form="slide", step=0.002, options=""):
    kind = "slide" if form == "slide" else "hinge"
    joint = Joint(name="j", type=kind, range=(-100, 100), unit="m" if kind == "slide" else "rad")
    parts = {
        name: Resistance(components=(Component(interval=(0, 1), x=(0, 1), y=(value, value)),))
        for name, value in (("friction", friction), ("damping", damping))
        if value
    }
    profile = Profile(joint=joint, channels=Channels(**parts), effects=effects)
    gravity = "0 0 0" if form == "slide" else "0 0 -9.81"
    (folder / "in.xml").write_text(
        f'<mujoco><compiler angle="radian"/><option timestep="{step}" gravity="{gravity}" '
        f'{options} tolerance="1e-14"/><worldbody>{FORMS[form]}</worldbody></mujoco>'
    )
    attach(folder / "in.xml", profile, folder / "out.xml", force=True)
    model = mujoco.MjModel.from_xml_path(str(folder / "out.xml"))
    return model, mujoco.MjData(model)


def run(model, data, seconds, force=0.0):
    """Positions, velocities and plugin states over time under a force (of time and position)."""
    steps = round(seconds / model.opt.timestep)
    path = np.empty((steps + 1, 2))
    for k in range(steps + 1):
        path[k] = data.qpos[0], data.qvel[0]
        pushed = force(data.time, data.qpos[0]) if callable(force) else force
        data.qfrc_applied[0] = pushed
        mujoco.mj_step(model, data)
    return path.T


INTEGRATORS = ('integrator="Euler"', 'integrator="implicitfast"', 'integrator="implicit"')


@pytest.mark.parametrize("options", INTEGRATORS)
@pytest.mark.parametrize("force", [0.7, 6.0, -0.7, -6.0])
def test_terminal_speed_of_viscous_and_quadratic_drag_by_direction(tmp_path, force, options):
    effects = (
        QuadraticDamping(direction="positive", y=(0.9, 0.9)),
        QuadraticDamping(direction="negative", y=(2.5, 2.5)),
        DirectionDependentDamping(direction="negative", y=(1.5, 1.5)),
    )
    model, data = build(tmp_path, *effects, damping=0.4, options=options)
    speed = run(model, data, 20, force)[1][-1]
    c, c2 = (0.4, 0.9) if force > 0 else (1.9, 2.5)
    exact = np.sign(force) * (-c + np.sqrt(c * c + 4 * c2 * abs(force))) / (2 * c2)
    assert speed == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("options", INTEGRATORS)
@pytest.mark.parametrize("push", [1.3, 1.6, 2.5])
@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_stribecks_steady_speeds(tmp_path, push, exponent, options):
    vs, extra, coulomb, viscous = 0.1, 0.5, 1.0, 0.8
    effect = StribeckFriction(velocity=vs, exponent=exponent, y=(extra, extra))
    model, data = build(tmp_path, effect, friction=coulomb, damping=viscous, options=options)
    data.qvel[0] = 1.0  # beyond the falling part

    def lacks(v):
        return coulomb + extra * np.exp(-((v / vs) ** exponent)) + viscous * v - push

    speed = run(model, data, 45, push)[1][-1]
    assert speed == pytest.approx(brentq(lacks, 0.12, 5), rel=1e-8)


@pytest.mark.parametrize("direction", [1, -1])
def test_it_breaks_away_from_true_standstill(tmp_path, direction):
    effect = StribeckFriction(velocity=0.05, y=(0.5, 0.5))
    model, data = build(tmp_path, effect, friction=1.0)
    q, v = run(model, data, 3, lambda t, q: direction * 0.6 * t)  # 1.5 N are reached at 2.5 s
    time = model.opt.timestep * np.arange(len(q))
    moved = time[np.abs(v) > 1e-6][0]
    assert moved == pytest.approx(2.5, abs=0.02)
    # it accelerates with what friction has lost at once
    assert abs(v[-1]) > 0.5 * 0.5 / MASS * (3 - moved)


def test_a_soft_drive_sticks_and_slips_below_the_critical_speed_and_not_above(tmp_path):
    """Pulled by a spring at constant speed, steady sliding is stable where C + df/dv > 0."""
    vs, extra, coulomb, viscous, k = 0.1, 0.6, 0.8, 2.0, 20.0
    effect = StribeckFriction(velocity=vs, exponent=1.0, y=(extra, extra))
    critical = vs * np.log(extra / (vs * viscous))
    for factor, sticks in ((0.7, True), (1.3, False)):
        model, data = build(tmp_path, effect, friction=coulomb, damping=viscous, step=0.001)
        speed = factor * critical
        steady = coulomb + extra * np.exp(-speed / vs) + viscous * speed
        data.qvel[0], data.qpos[0] = speed * 1.02, -steady / k
        v = run(model, data, 20, lambda t, q, w=speed: k * (w * t - q))[1]
        assert bool((np.abs(v[-5000:]) < 1e-4).any()) == sticks
        if not sticks:
            assert np.ptp(v[-5000:]) < 1e-3 * speed


@pytest.mark.parametrize("options", INTEGRATORS)
def test_prandtls_loop_has_the_stiffness_energy_and_break_away(tmp_path, options):
    sigma, bound = 400.0, 2.0
    model, data = build(
        tmp_path,
        PreslidingFriction(stiffness=sigma),
        friction=bound,
        damping=30.0,
        step=0.0005,
        options=options,
    )
    amplitude, period = 0.02, 8.0
    hold = 3e4

    def drive(t, q):
        return hold * (amplitude * np.sin(2 * np.pi * t / period) - q)

    q, force = [], []
    for _ in range(round(2 * period / 0.0005)):
        data.qfrc_applied[0] = drive(data.time, data.qpos[0])
        mujoco.mj_step(model, data)
        q.append(data.qpos[0])
        force.append(-data.plugin_state[0])
    q, force = (np.array(x)[len(q) // 2 :] for x in (q, force))
    reached = np.abs(q).max()
    assert force.max() == pytest.approx(bound, rel=1e-9)
    # parallelogram: width 2 A - 2 f / sigma, height 2 f
    energy = abs(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(q)))
    assert energy == pytest.approx(4 * bound * (reached - bound / sigma), rel=2e-3)
    turned = np.argmax(q)
    after = slice(turned + 40, turned + 200)
    slope = np.polyfit(q[after], force[after], 1)[0]
    assert slope == pytest.approx(sigma, rel=1e-3)


@pytest.mark.parametrize("direction", [1, -1])
def test_dahls_force_decays_to_its_bound_over_distance(tmp_path, direction):
    sigma, bound, speed = 300.0, 1.5, 0.02
    effect = PreslidingFriction(stiffness=sigma, breakaway=0.0)
    model, data = build(tmp_path, effect, friction=bound, step=0.0002)
    data.qvel[0] = direction * speed
    q, force = [], []
    for _ in range(2000):
        # a very stiff drive at constant speed
        data.qfrc_applied[0] = 5e4 * (direction * speed * data.time - data.qpos[0]) + 200 * (
            direction * speed - data.qvel[0]
        )
        mujoco.mj_step(model, data)
        q.append(data.qpos[0])
        force.append(-data.plugin_state[0])
    exact = direction * bound * (1 - np.exp(-sigma * np.abs(q) / bound))
    assert np.abs(np.array(force) - exact).max() < 2e-3 * bound


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.5, 0.95])
@pytest.mark.parametrize(
    "effect",
    [
        PreslidingFriction(stiffness=500),
        PreslidingFriction(stiffness=500, breakaway=0.0),
        PreslidingFriction(stiffness=500, damping=2.0, breakaway=0.5),
        StribeckFriction(velocity=0.05, y=(0.3, 0.3)),
        AsymmetricFriction(direction="positive", y=(0.5, 0.5)),
    ],
)
def test_a_held_load_does_not_creep_for_ten_minutes(tmp_path, effect, share):
    model, data = build(tmp_path, effect, friction=1.0, damping=0.5)
    run(model, data, 120, share)
    begun = data.qpos[0]
    q = run(model, data, 600, share)[0]
    assert abs(q[-1] - begun) < 1e-9
    assert np.ptp(q) < 1e-9


def test_asymmetric_friction_breaks_away_at_two_forces(tmp_path):
    effect = AsymmetricFriction(direction="negative", y=(0.7, 0.7))
    for force, moves in ((0.99, False), (1.01, True), (-1.69, False), (-1.71, True)):
        model, data = build(tmp_path, effect, friction=1.0)
        v = run(model, data, 2, force)[1]
        assert bool(abs(v[-1]) > 1e-3) == moves
        if moves:
            bound = 1.0 if force > 0 else 1.7
            assert v[-1] == pytest.approx(
                np.sign(force) * (abs(force) - bound) * 2 / MASS, rel=0.02
            )


def test_a_pendulum_with_load_dependent_friction_decays_as_scipys(tmp_path):
    mu, coulomb = 0.12, 0.05
    inertia, weight = MASS * LENGTH**2 + 1e-9, MASS * 9.81 * LENGTH
    effect = LoadDependentFriction(coefficient=mu)
    model, data = build(
        tmp_path, effect, friction=coulomb, damping=0.02, form="pendulum", step=0.0005
    )
    data.qpos[0] = 1.4
    q = run(model, data, 3)[0]
    time = 0.0005 * np.arange(len(q))

    def law(t, y, sign):
        load = -weight * np.sin(y[0])
        return y[1], (load - 0.02 * y[1] - sign * (coulomb + mu * abs(load))) / inertia

    # between reversals the law is smooth; each swing is integrated by itself
    t, y, exact, sign = 0.0, np.array([1.4, 0.0]), np.full(len(q), np.nan), -1.0
    while t < time[-1]:
        stop = lambda t, y: y[1]  # noqa: E731
        stop.terminal, stop.direction = True, -sign
        part = solve_ivp(
            lambda t, y, sign=sign: law(t, y, sign), (t, time[-1]), y,
            events=stop if t == 0 or abs(y[1]) < 1e-9 else None,
            rtol=1e-10, atol=1e-12, dense_output=True, first_step=1e-5,
        )  # fmt: skip
        inside = (time >= t) & (time <= part.t[-1])
        exact[inside] = part.sol(time[inside])[0]
        t, y, sign = part.t[-1], part.y[:, -1] * np.array([1, 0]), -sign
        load = weight * abs(np.sin(y[0]))
        if load <= coulomb + mu * load:
            exact[time > t] = y[0]
            break
    assert np.nanmax(np.abs(q - exact)) < 1e-3 * 1.4
    assert not np.isnan(exact).any()


@pytest.mark.parametrize("force", [0.0, 0.7])
def test_gravitys_offset_is_a_sine_of_position(tmp_path, force):
    model, data = build(
        tmp_path, GravityOffset(sin=0.5, cos=-0.3), form="pendulum", damping=0.5, step=0.001
    )
    q = run(model, data, 60, force)[0][-1]
    weight = MASS * 9.81 * LENGTH
    assert (0.5 - weight) * np.sin(q) - 0.3 * np.cos(q) + force == pytest.approx(0, abs=1e-9)


def test_within_the_play_the_part_feels_nothing(tmp_path):
    play, inertia, push = 0.02, 0.05, 0.5
    model, data = build(tmp_path, Backlash(play=play, inertia=inertia), damping=0.3, step=0.0005)
    run(model, data, 0.5, -0.1)  # to one side
    run(model, data, 60)
    still = data.qpos[0]
    assert data.qvel[0] == pytest.approx(0, abs=1e-6)
    q, v = run(model, data, 1.0, push)
    time = 0.0005 * np.arange(len(q))
    crossing = np.sqrt(2 * play * inertia / push)
    assert np.ptp(q[time < 0.97 * crossing]) < 1e-6
    assert q[-1] > still + 0.01
    # then both move: a plastic knock, and the force on both inertias
    begun = np.searchsorted(time, crossing)
    knock = push * crossing / (MASS + inertia)
    rate = 0.3 / (MASS + inertia)
    late = time[begun:] - crossing
    both = knock * np.exp(-rate * late) + push / 0.3 * (1 - np.exp(-rate * late))
    assert np.abs(v[begun + 20 :] - both[20:]).max() < 0.02 * both.max()


# --- a load behind the play, against an integration with compliant flanks


def behind(play=0.05, part=0.5, share=0.5):
    return Backlash(play=play, inertia=(1 - part) * MASS, side="motor", share=share)


def wobble(t, q=0.0):
    return 3 * np.sin(7 * t) + 2 * np.sin(17 * t)


def reference(load, friction, damping, seconds, h=1e-5):
    """Positions of the part every ms under `wobble`; flanks give way, damp and never pull."""
    J, part = load.inertia, MASS - load.inertia
    stiffness = J * part / MASS * 3000.0**2
    own, other = 1 - load.share, load.share
    q = v = there = w = 0.0
    path = []

    def slowed(speed, mass, share):
        speed /= 1 + h * share * damping / mass
        return np.sign(speed) * max(abs(speed) - h * share * friction / mass, 0.0)

    for n in range(round(seconds / h)):
        if n % round(1e-3 / h) == 0:
            path.append(q)
        gap = there - q
        over = gap - min(max(gap, -0.5 * load.play), 0.5 * load.play)
        rate = 4 / 3000.0 * (w - v)
        push = np.sign(over) * max(stiffness * np.sign(over) * (over + rate), 0.0)
        v = slowed(v + h * (wobble(n * h) + push) / part, part, own)
        w = slowed(w - h * push / J, J, other)
        q, there = q + h * v, there + h * w
    return np.array(path)


LOADS = {"light": behind(0.02, 0.87, 0.8), "heavy": behind(0.05, 0.25, 0.5)}


@pytest.mark.slow
@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
def test_a_load_behind_the_play_moves_as_compliant_flanks_let_it(tmp_path, load):
    expected = reference(load, 0.5, 0.3, 3.0)
    for step, within in ((0.0001, 5e-4), (0.0005, 2e-3), (0.002, 0.01), (0.01, 0.05)):
        model, data = build(tmp_path, load, friction=0.5, damping=0.3, step=step)
        q, _ = run(model, data, 3.0, wobble)
        found = np.interp(1e-3 * np.arange(3000), step * np.arange(len(q)), q)
        assert np.abs(found - expected).max() < within * np.ptp(expected), step


@pytest.mark.parametrize("options", INTEGRATORS)
def test_within_the_play_the_part_is_light_and_then_shares_its_momentum(tmp_path, options):
    load, push, h = behind(0.1, 0.25), 4.0, 0.0005
    model, data = build(tmp_path, load, step=h, options=options)
    _, v = run(model, data, 1.0, push)
    rate, crossing = push / (0.25 * MASS), np.sqrt(0.1 * 0.25 * MASS / push)
    time = h * np.arange(len(v))
    flight, late = time < crossing - 2 * h, time > crossing + 2 * h
    np.testing.assert_allclose(v[flight], rate * time[flight], atol=1e-12)
    np.testing.assert_allclose(v[late] * MASS, push * time[late], rtol=1e-8)


def test_a_part_that_presses_its_load_moves_as_without_play(tmp_path):
    """Bit for bit, until it sticks."""
    paths = []
    for effects in ((), (behind(),)):
        model, data = build(tmp_path, *effects, friction=0.5, damping=0.3)
        run(model, data, 1.0, 2.0)
        data.qpos[0], data.qvel[0] = 0.3, 0.2
        pressed = run(model, data, 2.0, lambda t, q: 1.2 + np.sin(3 * t))
        paths.append((pressed, run(model, data, 6.0, 0.3)))
    (moves, sticks), (moves_too, sticks_too) = paths
    np.testing.assert_array_equal(moves, moves_too)
    np.testing.assert_allclose(sticks, sticks_too, atol=1e-11)
    assert np.abs(sticks[1, -1]) < 1e-9 < moves[1].max()


def test_a_load_holds_the_part_only_one_way_while_it_sticks(tmp_path):
    model, data = build(tmp_path, behind(0.05, 0.5, 0.8), friction=1.0)
    run(model, data, 0.3, 2.0)
    run(model, data, 1.0, 0.5)  # comes to rest, pressed on
    for push, moves in ((0.9, False), (-0.19, False), (-0.25, True)):
        before = data.qpos[0]
        run(model, data, 2.0, push)
        assert (abs(data.qpos[0] - before) > 0.04) == moves
    assert 0.05 < before - data.qpos[0] < 0.053  # as far as the load, and what the knock moves it


def test_a_load_goes_on_where_an_end_stops_the_part(tmp_path):
    model, data = build(tmp_path, behind(0.1, 0.5))
    run(model, data, 0.3, 2.0)
    model.jnt_range[0, 1] = data.qpos[0] + 0.02
    run(model, data, 0.1)
    assert data.qvel[0] < 0.5
    assert data.plugin_state[2] > 0.3  # it is faster than the part
    assert -0.05 < data.plugin_state[1] <= 0.05


@pytest.mark.parametrize("step", [0.0001, 0.02])
def test_a_knocking_load_gains_no_energy(tmp_path, step):
    load = behind(0.05, 0.1, 0.0)
    model, data = build(tmp_path, load, step=step)
    run(model, data, 0.5, 2.0)
    run(model, data, 0.1, -9.0)
    data.qfrc_applied[0] = 0
    least = np.inf
    for _ in range(round(5 / step)):
        mujoco.mj_step(model, data)
        v, ahead = data.qvel[0], data.plugin_state[2]
        energy = (MASS - load.inertia) * v**2 + load.inertia * (v + ahead) ** 2
        assert energy < least * (1 + 1e-9)
        least = min(least, energy)


# --- states

STATES = (
    PreslidingFriction(stiffness=300, damping=0.4, breakaway=0.5),
    Backlash(play=0.02, inertia=0.05),
    StribeckFriction(velocity=0.05, y=(0.4, 0.4)),
    AsymmetricFriction(direction="negative", y=(0.2, 0.2)),
    DirectionDependentDamping(direction="positive", y=(1.0, 1.0)),
    QuadraticDamping(y=(0.5, 0.5)),
    LoadDependentFriction(coefficient=0.1),
    GravityOffset(sin=0.5),
)


WITH_LOAD = (STATES[0], Backlash(play=0.02, inertia=0.05, side="motor", share=0.7), *STATES[2:])
BOTH = pytest.mark.parametrize("states", [STATES, WITH_LOAD], ids=["handle", "load"])


@BOTH
@pytest.mark.parametrize("options", INTEGRATORS)
def test_a_saved_state_restarts_exactly(tmp_path, options, states):
    model, data = build(tmp_path, *states, form="pendulum", friction=0.5, options=options)
    run(model, data, 0.5, wobble)
    full = mujoco.mjtState.mjSTATE_INTEGRATION
    saved = np.empty(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, saved, full)
    copied = copy.copy(data)
    first = run(model, data, 0.5, wobble)
    fresh = mujoco.MjData(model)
    mujoco.mj_setState(model, fresh, saved, full)
    np.testing.assert_array_equal(run(model, fresh, 0.5, wobble), first)
    np.testing.assert_array_equal(run(model, copied, 0.5, wobble), first)
    assert model.npluginstate == 5


@BOTH
@pytest.mark.parametrize("threads", [2, 4])
def test_threads_are_bit_identical(tmp_path, threads, states):
    model, data = build(tmp_path, *states, form="pendulum", friction=0.5)
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.empty((16, mujoco.mj_stateSize(model, full)))
    pushes = np.random.default_rng().normal(0, 3, (16, 300, model.nv))
    for k in range(16):
        data.qpos[0] = 0.1 * k
        mujoco.mj_getState(model, data, initial[k], full)
    applied = mujoco.mjtState.mjSTATE_QFRC_APPLIED
    ends = []
    for count in (1, threads):
        every = [mujoco.MjData(model) for _ in range(count)]
        ends.append(rollout.rollout(model, every, initial, pushes, control_spec=int(applied))[0])
    np.testing.assert_array_equal(*ends)
    assert np.ptp(ends[0][:, -1, 1]) > 1e-3


@BOTH
def test_forward_does_not_move_the_states(tmp_path, states):
    model, data = build(tmp_path, *states, form="pendulum", friction=0.5)
    run(model, data, 0.5, wobble)
    before = data.plugin_state.copy()
    for _ in range(3):
        mujoco.mj_forward(model, data)
    np.testing.assert_array_equal(data.plugin_state, before)


@pytest.mark.parametrize("side", ["load", "motor"])
@pytest.mark.parametrize("step", [0.0005, 0.01, 0.05])
def test_all_effects_at_once_stay_bounded_at_any_timestep(tmp_path, step, side):
    strong = (
        PreslidingFriction(stiffness=1e6, damping=1e3, breakaway=0.3),
        Backlash(play=0.05, inertia=0.05, side=side),
        StribeckFriction(velocity=1e-4, y=(50, 50)),
        AsymmetricFriction(direction="positive", y=(30, 30)),
        DirectionDependentDamping(direction="negative", y=(1e4, 1e4)),
        QuadraticDamping(y=(1e4, 1e4)),
        LoadDependentFriction(coefficient=5),
    )
    model, data = build(tmp_path, *strong, form="pendulum", friction=1.0, step=step)
    rng = np.random.default_rng()
    pushes = rng.normal(0, 100, 64)
    v = run(model, data, 20, lambda t, q: pushes[int(7 * t) % 64])[1]
    assert np.isfinite(v).all()
    assert np.abs(v).max() < 50
    assert not data.warning.number.any()
