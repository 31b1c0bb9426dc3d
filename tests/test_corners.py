"""The plugin in MuJoCo's corners: the discrete integrator, RK4, noslip, far beyond the range."""

import re

import mujoco
import numpy as np
import pytest
from joints import component, flat, load, run, scene
from scipy.optimize import brentq
from test_plugin import refused

from joda._core import JointSimulator

WIDE = (-1e3, 1e3)
MASS, H = 0.8, 0.002
STIFF = f'frictionloss="1e-12" solreffriction="0 {-1 / H:g}" solimpfriction="0.9999 0.9999"'
"""What attach writes under the discrete integrator."""


def slide(effects="", *, friction=0.0, damping=0.0, integrator="discrete", **options):
    """A slide of MASS that is far from its ends."""
    return load(
        friction=flat(friction) if friction else "",
        damping=flat(damping) if damping else "",
        effects=effects,
        inertia=MASS,
        limits=WIDE,
        integrator=integrator,
        **{"joint": STIFF, **options},
    )


def pushed(model, data, seconds, force):
    """Its velocity after so long under a force."""
    data.qfrc_applied[0] = force
    run(model, data, seconds)
    return data.qvel[0]


# --- the discrete integrator, which makes friction rows anew behind the plugin

COULOMB, MORE, VISCOUS = 1.0, 0.7, 0.5
ASYMMETRIC = {"positive": (COULOMB + MORE, COULOMB), "negative": (COULOMB, COULOMB + MORE)}
"""Friction while moving in positive and in negative direction, by where it is larger."""


@pytest.mark.parametrize("force", [4.0, 1.75, -4.0, -1.75])
@pytest.mark.parametrize("direction", ASYMMETRIC)
def test_discrete_asymmetric_friction_has_its_two_terminal_speeds(direction, force):
    effect = f"asymmetric_friction direction={direction}: {flat(MORE)}"
    model, data = slide(effect, friction=COULOMB, damping=VISCOUS)
    left = force - np.sign(force) * ASYMMETRIC[direction][int(force < 0)]
    exact = left / VISCOUS + H * left / MASS  # damping is a limited force there
    assert pushed(model, data, 30, force) == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize("share", [0.99, 0.5, 0, -0.5, -0.99])
@pytest.mark.parametrize("direction", ASYMMETRIC)
def test_discrete_asymmetric_friction_holds_both_ways(direction, share):
    """Creep of MuJoCo's stiffest row, as physics.md says: 2 h / (10^4 m) times its force."""
    effect = f"asymmetric_friction direction={direction}: {flat(MORE)}"
    model, data = slide(effect, friction=COULOMB)
    up, down = ASYMMETRIC[direction]
    force = share * (up if share > 0 else down)
    assert abs(pushed(model, data, 1, force)) < 1e-6
    start = data.qpos[0]
    run(model, data, 60)
    row = force + 0.5 * (down - up)  # about the constant force that is the asymmetry
    assert data.qpos[0] - start == pytest.approx(60 * 2 * H * row / (1e4 * MASS), rel=1e-3)
    assert abs(data.qpos[0] - start) < 5e-5


def stribeck(v, force=2.5):
    return 1 + 0.5 * np.exp(-((v / 0.1) ** 2)) + VISCOUS * v - force


STEADY = {  # effects, friction, force: speed where damping is VISCOUS, but for h F / m
    "stribeck": ("stribeck_friction velocity=0.1: " + flat(0.5), 1, 2.5, brentq(stribeck, 1, 9)),
    "load up": ("load_dependent_friction coefficient=0.25", 0, 2, 2 * 0.75 / VISCOUS),
    "load down": ("load_dependent_friction coefficient=0.25", 0, -2, -2 * 0.75 / VISCOUS),
    "directed": (f"direction_dependent_damping direction=negative: {flat(2)}", 0, -3, -3 / 2.5),
    "offset": ("gravity_offset force=1", 0, 1, 2 / VISCOUS),
}


@pytest.mark.parametrize(("effects", "friction", "force", "speed"), STEADY.values(), ids=STEADY)
def test_discrete_effects_have_their_steady_speeds(effects, friction, force, speed):
    model, data = slide(effects, friction=friction, damping=VISCOUS)
    data.qvel[0] = speed
    assert pushed(model, data, 30, force) == pytest.approx(speed, rel=3 * H * 2.5 / MASS)


def test_discrete_stribeck_friction_breaks_away_at_the_static_friction():
    for force, moves in ((1.49, False), (1.51, True)):
        model, data = slide(f"stribeck_friction velocity=0.05: {flat(0.5)}", friction=1)
        assert bool(pushed(model, data, 2, force) > 1e-3) == moves


@pytest.mark.parametrize("integrator", ["discrete", "Euler", "implicitfast"])
def test_a_handle_crosses_its_play_and_takes_the_part_along(integrator):
    inertia, force, play = 0.3, 4.0, 0.1
    model, data = slide(f"backlash play={play} inertia={inertia}", integrator=integrator)
    crossing = np.sqrt(play * inertia / force)
    pushed(model, data, 0.98 * crossing, force)
    assert abs(data.qpos[0]) < 1e-12
    before = pushed(model, data, 1, force)
    after = pushed(model, data, 0.5, force)
    assert after - before == pytest.approx(0.5 * force / (MASS + inertia), rel=1e-3)


@pytest.mark.parametrize("integrator", ["discrete", "Euler", "implicitfast"])
def test_a_part_crosses_the_play_before_its_load_and_takes_that_along(integrator):
    inertia, force, play = 0.6, 4.0, 0.1
    effect = f"backlash play={play} inertia={inertia} side=motor share=0.8"
    model, data = slide(effect, integrator=integrator)
    crossing = np.sqrt(play * (MASS - inertia) / force)
    before = pushed(model, data, 0.9 * crossing, force)
    assert before == pytest.approx(0.9 * crossing * force / (MASS - inertia), rel=0.02)
    before = pushed(model, data, 1, force)
    assert pushed(model, data, 0.5, force) - before == pytest.approx(0.5 * force / MASS, rel=1e-3)


REFUSED = {  # options of the scene: what the plugin says at load
    "backlash": (
        dict(effects="backlash play=0.1 inertia=0.1", integrator="RK4"),
        'the effect "backlash", whose handle would have half its inertia with integrator="RK4"; '
        'choose integrator="implicitfast"',
    ),
    "backlash behind": (
        dict(effects="backlash play=0.1 inertia=0.1 side=motor", integrator="RK4"),
        'the effect "backlash", whose load would have half its inertia with integrator="RK4"; '
        'choose integrator="implicitfast"',
    ),
    "presliding discrete": (
        dict(effects="presliding_friction stiffness=100", integrator="discrete"),
        'the effect "presliding_friction", which does nothing with integrator="discrete"; choose '
        'integrator="implicitfast"',
    ),
    "presliding noslip": (
        dict(effects="presliding_friction stiffness=100", option='noslip_iterations="3"'),
        'the effect "presliding_friction", which does nothing with noslip_iterations; set them to '
        "0",
    ),
    "one end stop": (
        dict(effects="end_stop_restitution restitution=0.5 end=low", integrator="discrete"),
        'the effect "end_stop_restitution", which at one end alone does nothing with '
        'integrator="discrete"; choose integrator="implicitfast"',
    ),
    "asymmetric": (
        dict(
            effects=f"asymmetric_friction direction=positive: {flat(1)}", integrator="discrete"
        ),
        'the effect "asymmetric_friction", which makes it creep at rest with '
        'integrator="discrete"; write solreffriction="0 -500" solimpfriction="0.9999 0.9999" on '
        "the joint",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("options", "sentence"), REFUSED.values(), ids=REFUSED)
def test_what_an_integrator_cannot_do_is_refused_at_load(options, sentence):
    said = refused(scene(**options))
    assert said == f"joda.joint_dynamics: instance 'p': joint 'j' has {sentence}"


def test_what_the_refusal_says_to_write_loads():
    said = REFUSED["asymmetric"][1]
    written = " ".join(re.findall(r'sol\w+="[^"]*"', said))
    options = REFUSED["asymmetric"][0] | {"joint": f'frictionloss="1e-12" {written}'}
    mujoco.MjData(mujoco.MjModel.from_xml_string(scene(**options)))


@pytest.mark.parametrize("stiffness", [300.0, 1e4, 1e6])
def test_rk4_presliding_carries_a_slow_load_on_its_spring(stiffness):
    effect = f"presliding_friction stiffness={stiffness} damping=20"
    model, data = slide(effect, friction=1, integrator="RK4", damping=VISCOUS)
    for first, last in ((0.0, 0.9), (0.9, -0.6), (-0.6, 0.0)):
        for force in np.linspace(first, last, 400):
            pushed(model, data, 5 * H, force)
        pushed(model, data, 2, last)
        assert data.qpos[0] == pytest.approx(last / stiffness, abs=1e-3 / stiffness)


# --- far beyond the range


def spring(k, width, mass, **options):
    """A slide on a linear spring about the middle of its range, which nothing else limits."""
    ends = (0.5 * k * width, -0.5 * k * width)
    return load(
        component((0, 1), (0, 1), ends),
        inertia=mass,
        limits=(0.0, width),
        joint='frictionloss="1e-12" limited="false"',
        **options,
    )


@pytest.mark.parametrize("far", [20.0, 100.0, 1e4, -20.0, -1e4])
@pytest.mark.parametrize(("k", "width", "mass"), [(2500, 0.004, 0.01), (1e5, 0.01, 2.0)])
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "discrete"])
def test_beyond_the_range_a_stiff_spring_accelerates_by_the_force_at_its_end(
    integrator, k, width, mass, far
):
    """Exactly as a constant force does in MuJoCo's step, until a step would enter the range."""
    model, data = spring(k, width, mass, integrator=integrator)
    # there the inert row of the damping takes 1e-4 of the acceleration, its least impedance
    tolerance = 1.1e-4 if integrator == "discrete" else 1e-6
    force, start = -np.sign(far) * 0.5 * k * width, far * width
    data.qpos[0], q, v = start, start, 0.0
    while (q + H * v + H**2 * force / mass - (0 if far < 0 else width)) * far > 0:
        mujoco.mj_step(model, data)
        v += H * force / mass
        q += H * v
        assert data.qvel[0] == pytest.approx(v, rel=tolerance)
    assert data.qpos[0] == pytest.approx(q, abs=tolerance * abs(start))
    # it arrives with the speed of all the work that was done, to a step's
    arrival = np.sqrt(2 * abs(force * (q - start)) / mass)
    assert abs(data.qvel[0]) == pytest.approx(arrival, abs=H * abs(force) / mass)


@pytest.mark.parametrize("ratio", [2.0, 30.0, 1e3, 1e6])
@pytest.mark.parametrize("far", [0.6, 1.05, 3.0, 30.0, 1e4])
def test_a_stiff_spring_from_beyond_the_range_never_gains_energy(ratio, far):
    """h^2 k / m is the ratio; the spring's own energy grows linearly beyond the range."""
    width, mass = 0.1, 0.05
    k = ratio * mass / H**2
    model, data = spring(k, width, mass)

    def energy():
        x, half = abs(data.qpos[0] - 0.5 * width), 0.5 * width
        inside = 0.5 * k * min(x, half) ** 2
        return inside + k * half * max(x - half, 0) + 0.5 * mass * data.qvel[0] ** 2

    data.qpos[0] = far * width
    first, most = energy(), 0.0
    for _ in range(2000):
        mujoco.mj_step(model, data)
        most = max(most, energy())
    assert most <= first * (1 + 1e-9)


def test_the_joint_by_itself_has_the_same_motion_beyond_its_range():
    """Soft limits, so that it goes there; the solver's own limit acts besides."""
    k, width, mass = 2500.0, 0.004, 0.01
    limit = 'solreflimit="-40 -1" solimplimit="0.9 0.95 0.001 0.5 2"'
    ends = (0.5 * k * width, -0.5 * k * width)
    model, data = load(
        component((0, 1), (0, 1), ends),
        damping=flat(0.02),
        inertia=mass,
        limits=(0.0, width),
        joint=f'frictionloss="1e-12" limited="true" {limit}',
    )
    texts = [component((0, 1), (0, 1), ends), "sum", "", "sum", flat(0.02), "sum", ""]
    alone = JointSimulator(
        0, width, texts, inertia=mass, row_inertia=mass, weight=(0, 0), hinge=False,
        solref=model.jnt_solref[0], solimp=model.jnt_solimp[0],
    )  # fmt: skip
    data.qpos[0] = 100 * width
    forces = np.repeat([0.0, 20.0, -30.0, 0.0], 50)
    expected = []
    for force in forces:
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data)
        expected.append(data.qpos[0])
    after = alone.replay(forces, [0], [(100 * width, 0)], [True], H)[1]
    assert np.abs(after - expected).max() < 1e-7 * np.ptp(expected)
    assert np.ptp(expected) > 100 * width
