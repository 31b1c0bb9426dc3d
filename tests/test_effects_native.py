"""Effects beside MuJoCo's own elements: alike where both can do the same, and what one cannot.

MuJoCo 4.0.0 has polynomial joint damping, joint springs that yield, and a passive motor with LuGre
friction. Each is set up for the same slide as the effect it is compared with.
"""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq
from test_effects_physics import INTEGRATORS, MASS, build, run

from joda.effects import (
    AsymmetricFriction,
    DirectionDependentDamping,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)


def native(joint="", lugre=None, step=0.002, options=""):
    """The slide with MuJoCo's own elements; lugre: stiffness, damping, Coulomb, static, speed."""
    motor = ""
    if lugre:  # its motor constant is negligible, it takes no control
        motor = (
            '<dcmotor joint="j" input="none" motorconst="1e-9" resistance="1" '
            f'lugre="{" ".join(map(str, lugre))}"/>'
        )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{step}" gravity="0 0 0" {options} tolerance="1e-14"/>'
        f'<worldbody><body><joint name="j" type="slide" axis="1 0 0" {joint}/>'
        f'<geom size="0.05" mass="{MASS}"/></body></worldbody>'
        f"<actuator>{motor}</actuator></mujoco>"
    )
    return model, mujoco.MjData(model)


def differ(first, second):
    """Largest difference in position and in velocity, each as a share of the largest value."""
    return np.abs(first - second).max(axis=1) / np.abs(first).max(axis=1)


def drift(model, data, load, settle=5.0, watch=5.0):
    """How far the joint still moves under a constant load, after it had time to settle."""
    run(model, data, settle, load)
    return np.ptp(run(model, data, watch, load)[0])


# polynomial damping: force -(c0 + c1 |v| + c2 v^2) v


@pytest.mark.parametrize("options", INTEGRATORS)
def test_polynomial_damping_and_quadratic_drag_move_alike(tmp_path, options):
    own = native('damping="0.4 0.9"', step=2e-4, options=options)
    ours = build(tmp_path, QuadraticDamping(y=(0.9, 0.9)), damping=0.4, step=2e-4, options=options)
    paths = [run(*pair, 3, lambda t, q: 6 * np.sin(2 * t)) for pair in (own, ours)]
    assert (differ(*paths) < 3e-4).all()
    without = run(*native('damping="0.4"', step=2e-4), 3, lambda t, q: 6 * np.sin(2 * t))
    assert (differ(without, paths[1]) > 0.1).all()


@pytest.mark.parametrize("options", INTEGRATORS)
@pytest.mark.parametrize("step", [0.002, 0.05, 1.0])
def test_both_drags_have_the_same_terminal_speed_at_any_timestep(tmp_path, step, options):
    exact = (-0.4 + np.sqrt(0.4**2 + 4 * 0.9 * 6)) / (2 * 0.9)
    for model, data in (
        native('damping="0.4 0.9"', step=step, options=options),
        build(tmp_path, QuadraticDamping(y=(0.9, 0.9)), damping=0.4, step=step, options=options),
    ):
        data.qpos[0], data.qvel[0] = -95, 10  # the range ends at 100
        assert run(model, data, 70 if step == 1 else 20, 6.0)[1][-1] == pytest.approx(
            exact, rel=1e-9
        )


@pytest.mark.parametrize("step", [0.001, 0.05])
def test_free_decay_is_exact_at_any_timestep_and_first_order_with_the_polynomial(tmp_path, step):
    """v0 / (1 + c v0 t / m): m (v+ - v) = -h c |v| v+ is its exact step; MuJoCo's is tangential."""
    drag, begun = 5.0, 10.0
    errors = []
    for model, data in (
        native(f'damping="0 {drag}"', step=step),
        build(tmp_path, QuadraticDamping(y=(drag, drag)), step=step),
    ):
        data.qvel[0] = begun
        speed = run(model, data, 1)[1]
        time = step * np.arange(len(speed))
        errors.append(np.abs(speed - begun / (1 + drag * begun * time / MASS)).max())
    assert errors[0] > 0.01 * begun
    assert errors[1] < 1e-9 * begun


def test_the_polynomial_has_one_law_for_both_directions_and_all_places(tmp_path):
    effects = (
        QuadraticDamping(direction="negative", y=(2.5, 2.5)),
        DirectionDependentDamping(direction="negative", interval=(0.5, 1), y=(3.0, 3.0)),
    )
    speeds = {}
    for name in ("native", "ours"):
        for place, force in ((-50, 6), (-50, -6), (50, -6)):
            pair = native('damping="0.4 2.5"') if name == "native" else None
            model, data = pair or build(tmp_path, *effects, damping=0.4)
            data.qpos[0] = place
            speeds[name, place, force] = abs(run(model, data, 5, force)[1][-1])
    same = (-0.4 + np.sqrt(0.4**2 + 4 * 2.5 * 6)) / 5
    damped = (-3.4 + np.sqrt(3.4**2 + 4 * 2.5 * 6)) / 5
    for place, force, exact in ((-50, 6, 15), (-50, -6, same), (50, -6, damped)):
        assert speeds["native", place, force] == pytest.approx(same, rel=1e-6)
        # forwards only the linear damping acts: 15 m/s, reached with the time constant m / C = 2 s
        exact = exact * (1 - np.exp(-5 * 0.4 / MASS)) if force > 0 else exact
        assert speeds["ours", place, force] == pytest.approx(exact, rel=1e-3)


# springyield: force -k (q - p); p follows so that |q - p| <= springyield

BRISTLE, BOUND = 400.0, 2.0


def yields(stiffness=BRISTLE, bound=BOUND, damping=3.0, **rest):
    joint = f'damping="{damping}" stiffness="{stiffness}" springyield="{bound / stiffness}"'
    return native(joint, **rest)


@pytest.mark.parametrize("options", INTEGRATORS)
@pytest.mark.parametrize("push", [1.5, 2.5])
def test_springyield_and_prandtls_friction_move_alike(tmp_path, push, options):
    own = yields(step=1e-4, options=options)
    effect = PreslidingFriction(stiffness=BRISTLE)
    ours = build(tmp_path, effect, friction=BOUND, damping=3, step=1e-4, options=options)
    paths = [run(*pair, 4, lambda t, q: push * np.sin(3 * t)) for pair in (own, ours)]
    assert (differ(*paths) < 5e-3).all()


def test_springyield_and_prandtls_friction_have_the_same_loop(tmp_path):
    own = yields(damping=30, step=5e-4)
    ours = build(
        tmp_path, PreslidingFriction(stiffness=BRISTLE), friction=BOUND, damping=30, step=5e-4
    )
    loops = []
    for model, data in (own, ours):
        q, force = [], []
        for _ in range(16000):
            wanted = 0.02 * np.sin(np.pi / 2 * data.time)
            data.qfrc_applied[0] = 3e4 * (wanted - data.qpos[0])
            mujoco.mj_step(model, data)
            q.append(data.qpos[0])
            force.append(
                BRISTLE * (q[-1] - data.plastic[0]) if model.nplastic else -data.plugin_state[0]
            )
        q, force = np.array(q)[8000:], np.array(force)[8000:]
        energy = abs(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(q)))
        exact = 4 * BOUND * (np.abs(q).max() - BOUND / BRISTLE)
        assert energy == pytest.approx(exact, rel=3e-3)
        loops.append(force)
    assert np.abs(loops[0] - loops[1]).max() < 5e-3 * BOUND


def test_springyield_holds_a_load_up_to_its_timestep_and_presliding_at_any(tmp_path):
    """Explicit spring: h^2 k < 4 m + 2 h C; the discrete integrator takes it implicitly."""
    stiffness, damping, load = 4e4, 20.0, 0.95 * BOUND
    limit = brentq(lambda h: 4 * MASS + 2 * h * damping - h * h * stiffness, 1e-4, 1)
    own = {
        (factor, name): drift(
            *yields(
                stiffness, damping=damping, step=factor * limit, options=f'integrator="{name}"'
            ),
            load,
        )
        for factor in (0.8, 1.2)
        for name in ("Euler", "implicit", "implicitfast", "discrete")
    }
    for name in ("Euler", "implicit", "implicitfast"):
        assert own[0.8, name] < 1e-9
        assert own[1.2, name] > 1e-3
    assert own[1.2, "discrete"] < 1e-9
    for factor in (0.8, 1.2, 10):
        effect = PreslidingFriction(stiffness=stiffness)
        pair = build(tmp_path, effect, friction=BOUND, damping=damping, step=factor * limit)
        assert drift(*pair, load) < 1e-9


def test_springyield_has_one_bound_for_both_directions_and_all_places(tmp_path):
    effects = (
        PreslidingFriction(stiffness=BRISTLE),
        AsymmetricFriction(direction="positive", interval=(0.5, 1), y=(0.7, 0.7)),
    )
    for place, push, holds in ((-50, 1.5, False), (50, 1.5, True), (50, -1.5, False)):
        model, data = yields(bound=1.0, damping=5)
        data.qpos[0] = data.plastic[0] = place
        own = run(model, data, 4, push)[1][-1]
        model, data = build(tmp_path, *effects, friction=1.0, damping=5)
        data.qpos[0] = place
        ours = run(model, data, 4, push)[1][-1]
        assert abs(own) == pytest.approx(0.1, rel=1e-3)  # (1.5 - 1.0) / 5
        assert abs(ours) == pytest.approx(0.0 if holds else 0.1, rel=1e-3, abs=1e-6)


# dcmotor with lugre: force -(s0 z + s1 dz/dt), dz/dt = v - s0 |v| z / g(v),
# g = Coulomb + (static - Coulomb) exp(-(v / speed)^2)


@pytest.mark.parametrize("bristle", [0.0, 2.0])
@pytest.mark.parametrize("static", [1.0, 1.5])
@pytest.mark.parametrize("push", [0.9, 2.5])
def test_the_motors_lugre_and_presliding_move_alike(tmp_path, push, static, bristle):
    own = native('damping="1"', (300, bristle, 1.0, static, 0.1), step=1e-4)
    effects = [PreslidingFriction(stiffness=300, damping=bristle, breakaway=0.0)]
    if static > 1:
        effects.append(StribeckFriction(velocity=0.1, exponent=2.0, y=(static - 1.0, static - 1.0)))
    ours = build(tmp_path, *effects, friction=1.0, damping=1, step=1e-4)
    paths = [run(*pair, 3, lambda t, q: push * np.sin(3 * t)) for pair in (own, ours)]
    # with Stribeck's fall 0.8 % remain at any timestep: the motor's bristle is above its bound
    # until it has moved on, the effect's is on it at once
    assert (differ(*paths) < 0.01).all()


def test_both_have_stribecks_steady_speed(tmp_path):
    own = native('damping="0.8"', (300, 0, 1.0, 1.5, 0.1))
    effects = (
        PreslidingFriction(stiffness=300, breakaway=0.0),
        StribeckFriction(velocity=0.1, exponent=2.0, y=(0.5, 0.5)),
    )
    ours = build(tmp_path, *effects, friction=1.0, damping=0.8)
    exact = brentq(lambda v: 1 + 0.5 * np.exp(-((v / 0.1) ** 2)) + 0.8 * v - 1.5, 0.12, 5)
    for model, data in (own, ours):
        data.qvel[0] = 1.0
        assert run(model, data, 45, 1.5)[1][-1] == pytest.approx(exact, rel=1e-7)


def test_lugre_walks_under_a_vibrating_load_and_break_away_does_not(tmp_path):
    """Load between 10 % and 90 % of the friction: Dahl's and LuGre's models move on and on."""
    period = 2 * np.pi / 40
    step = period / 160
    walked = {}
    for name in ("lugre", "springyield", 0.0, 0.7, 1.0):
        if name == "lugre":
            model, data = native('damping="20"', (300, 0, 1.0, 1.0, 0.1), step=step)
        elif name == "springyield":
            model, data = yields(300, 1.0, damping=20, step=step)
        else:
            effect = PreslidingFriction(stiffness=300, breakaway=name)
            model, data = build(tmp_path, effect, friction=1.0, damping=20, step=step)
        q = run(model, data, 70 * period, lambda t, q: 0.5 + 0.4 * np.sin(40 * t))[0]
        walked[name] = q[160 * 70] - q[160 * 20]
    assert walked["lugre"] > 0.02
    assert walked[0.0] == pytest.approx(walked["lugre"], rel=0.03)
    for name in ("springyield", 0.7, 1.0):
        assert abs(walked[name]) < 1e-6


@pytest.mark.parametrize("options", INTEGRATORS)
def test_lugre_creeps_where_the_timestep_exceeds_damping_by_stiffness(tmp_path, options):
    """The motor's bristle takes the velocity of before the step: stuck, it rings for h > C / s0."""
    stiffness, damping = 4e4, 20.0
    limit = damping / stiffness
    lugre = (stiffness, 0, 1.0, 1.0, 0.1)
    joint = f'damping="{damping}"'
    own = [
        drift(*native(joint, lugre, step=factor * limit, options=options), 0.95, 1.5, 3)
        for factor in (0.7, 4)
    ]
    assert own[0] < 1e-9
    assert own[1] > 3e-4  # 2 ms
    for factor in (4, 100):
        effect = PreslidingFriction(stiffness=stiffness, breakaway=0.0)
        pair = build(
            tmp_path, effect, friction=1.0, damping=damping, step=factor * limit, options=options
        )
        assert drift(*pair, 0.95, 3, 3) < 1e-9


def test_damping_of_lugres_bristles_is_explicit_in_euler(tmp_path, monkeypatch):
    """Unstable for h > 2 m / s1, 32 ms here; the implicit integrators and the effect take it."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warning to a file
    step, lugre = 0.05, (4e4, 50, 2.0, 2.0, 0.1)
    blown = {}
    for options in INTEGRATORS:
        model, data = native('damping="1"', lugre, step=step, options=options)
        run(model, data, 4, 1.5)
        blown[options] = bool(data.warning.number.any()) or abs(data.qvel[0]) > 10
        effect = PreslidingFriction(stiffness=4e4, damping=50, breakaway=0.0)
        model, data = build(tmp_path, effect, friction=2.0, damping=1, step=step, options=options)
        assert drift(model, data, 1.5, 20) < 1e-9
    assert list(blown.values()) == [True, False, False]


# frictionloss


def test_frictionloss_does_not_spring_back(tmp_path):
    """A row's solreffriction damps, its stiffness has no position to act on."""

    def push(t, q):
        return 0.5 if t < 2 else 0.0

    moved = {}
    for name in ("-300 -1e4", "-1e6 -1e4", "ours"):
        if name == "ours":
            effect = PreslidingFriction(stiffness=300)
            model, data = build(tmp_path, effect, friction=1.0, damping=20)
        else:
            joint = f'damping="20" frictionloss="1" solreffriction="{name}"'
            model, data = native(joint)
        q = run(model, data, 4, push)[0]
        moved[name] = q[999], q[-1]
    assert moved["ours"] == pytest.approx((0.5 / 300, 0.0), abs=1e-6)
    assert moved["-300 -1e4"] == moved["-1e6 -1e4"]
    assert moved["-300 -1e4"][1] >= moved["-300 -1e4"][0] > 1e-4
