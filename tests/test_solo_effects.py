"""Effects beyond the three channels in JAX: their laws, the plugin's motion, and derivatives."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from slopes import FAST, check_slopes

from joda import context
from joda.effects import (
    AddedInertia,
    AsymmetricFriction,
    Backlash,
    DirectionDependentDamping,
    EndStopRestitution,
    GravityOffset,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.joints.rig import rig
from joda.profile import Profile

jax.config.update("jax_enable_x64", True)
from joda.field.jaxeffects import NAMES, from_effects, prepare  # noqa: E402
from joda.joints import laws, solo  # noqa: E402

MODELS = Path(__file__).parents[1] / "models"
KINDS = {"hinge": "cabinet.xml", "slide": "drawer.xml"}


def cases(kind, force, inertia, play):
    """Each effect at a size that matters beside a force and an inertia, and all of them.

    Args:
        kind: hinge or slide.
        force: N·m or N.
        inertia: of the joint.
        play: of backlash, rad or m.
    """
    offset = {"sin": 0.3, "cos": -0.2} if kind == "hinge" else {"force": 0.3}
    curve = {"interval": (0.0, 1.0), "x": (0.0, 0.3, 1.0)}

    def y(*values):
        return {"y": tuple(value * force for value in values)}

    out = {
        "direction_dependent_damping": (
            DirectionDependentDamping(direction="positive", **curve, **y(0.1, 0.4, 0.2)),
            DirectionDependentDamping(direction="negative", **curve, **y(0.3, 0.1, 0.05)),
        ),
        "quadratic_damping": (QuadraticDamping(**curve, **y(0.1, 0.3, 0.2)),),
        "quadratic_damping down": (
            QuadraticDamping(direction="negative", **curve, **y(0.1, 0.3, 0.2)),
        ),
        "asymmetric_friction": (
            AsymmetricFriction(direction="positive", **curve, **y(0.2, 0.5, 0.3)),
            AsymmetricFriction(direction="negative", **curve, **y(0.1, 0.15, 0.05)),
        ),
        "stribeck_friction": (
            StribeckFriction(velocity=0.4, exponent=1.3, **curve, **y(0.3, 0.6, 0.4)),
        ),
        "load_dependent_friction": (LoadDependentFriction(coefficient=0.2),),
        "presliding_friction": (
            PreslidingFriction(stiffness=8 * force, damping=0.05 * force, breakaway=0.6),
        ),
        "dahl": (PreslidingFriction(stiffness=20 * force, breakaway=0.0),),
        "prandtl": (PreslidingFriction(stiffness=12 * force),),
        "gravity_offset": (GravityOffset(**{k: x * force for k, x in offset.items()}),),
        "backlash": (Backlash(play=play, inertia=0.2 * inertia),),
        "backlash behind": (Backlash(play=play, inertia=0.6 * inertia, side="motor", share=0.7),),
        "added_inertia": (AddedInertia(inertia=0.4 * inertia),),
        "end_stop_restitution": (EndStopRestitution(restitution=0.4),),
        "end_stop_restitution low": (EndStopRestitution(restitution=0.7, end="low"),),
        "end_stop_restitution each": (
            EndStopRestitution(restitution=0.2, end="low"),
            EndStopRestitution(restitution=0.8, end="high"),
        ),
    }
    left_out = ("quadratic_damping down", "dahl", "prandtl", "backlash behind")
    left_out += ("end_stop_restitution low", "end_stop_restitution each")
    every = tuple(e for name, own in out.items() if name not in left_out for e in own)
    return {**out, "all": every}


def profile_of(joint, effects, force):
    """A spring, friction and damping besides the effects."""
    parts = {"conservative": (0.3, -0.2), "friction": (0.15, 0.25), "damping": (0.05, 0.05)}
    channels = {
        name: {"components": [{"interval": (0, 1), "x": (0, 1), "y": [y * force for y in ys]}]}
        for name, ys in parts.items()
    }
    return Profile.model_validate({"joint": joint, "channels": channels, "effects": effects})


def pushes(force, seconds, h, seed=0):
    """Random forces, each for a twentieth of a second per second, with reversals."""
    n = round(seconds / h)
    values = np.random.default_rng(seed).normal(0, 2 * force, 20)
    return np.repeat(values, n // 20)


@partial(jax.jit, static_argnames="h", compiler_options=FAST)
def run(joint, start, forces, h):
    """States after each step."""
    prepared = solo.prepare(joint)

    def advance(state, force):
        after = solo.step(prepared, state, force, h)
        return after, after

    return jax.lax.scan(advance, start, forces)[1]


def found_of(kind):
    """The context of a joint, and what is a strong force on it."""
    found = context(MODELS / KINDS[kind], "#0")
    lo, hi = found.joint.range
    return found, max(found.gravity_scale, 20 * found.equivalent_inertia * (hi - lo))


def joint_of(kind, case, h):
    """Its model on the rig and the joint in JAX, with the effects of a case."""
    found, force = found_of(kind)
    lo, hi = found.joint.range
    effects = cases(kind, force, found.equivalent_inertia, 0.03 * (hi - lo))[case]
    profile = profile_of(found.joint, effects, force)
    model = rig(found, profile)
    model.opt.timestep, model.opt.tolerance = h, 1e-14
    return model, solo.from_context(found, profile, model, 0), profile


# --- laws


def alone(*effects):
    return prepare(from_effects(effects))


def numbers(*values):
    return [jnp.array(float(value)) for value in values]


def test_damping_depends_on_the_direction_and_the_speed():
    up = {"interval": (0.0, 0.5), "y": (2.0, 4.0)}
    own = alone(
        DirectionDependentDamping(direction="positive", **up),
        QuadraticDamping(direction="negative", y=(3.0, 3.0)),
    )
    wanted = {(0.25, 0.1): 3.0, (0.25, -0.2): 0.6, (0.25, 0.0): 0.0, (0.75, 0.1): 0.0}
    for (s, v), value in wanted.items():
        assert laws.damping(own, *numbers(s, v)) == pytest.approx(value, abs=1e-15)
    both = alone(QuadraticDamping(y=(3.0, 3.0)))
    for v in (-0.2, 0.2):
        assert laws.damping(both, *numbers(0.5, v)) == pytest.approx(0.6)


def test_friction_is_stribecks_and_coulombs_and_of_the_direction():
    own = alone(
        StribeckFriction(velocity=0.1, exponent=2.0, y=(0.5, 0.5)),
        LoadDependentFriction(coefficient=0.2),
        AsymmetricFriction(direction="negative", y=(0.3, 0.3)),
    )
    for v, rest in ((0.0, 0.5), (0.1, 0.5 * np.exp(-1)), (-0.2, 0.5 * np.exp(-4)), (1e9, 0)):
        up, down = laws.friction(own, *numbers(0.4, v, -2.0))
        assert up == pytest.approx(rest + 0.4, rel=1e-14)
        assert down == pytest.approx(rest + 0.7, rel=1e-14)


@pytest.mark.parametrize(
    ("breakaway", "r", "left"),
    [
        *((0.0, r, 1 - r) for r in (-1.0, -0.3, 0.0, 0.5)),
        *((1.0, r, 1.0) for r in (-1.0, 0.0, 0.999)),
        (0.4, 0.4, 1.0),
        (0.4, 0.7, 1 - 0.5 * 0.7),
        (0.4, 0.55, 1 - (0.5 - 0.5 * np.sqrt(0.5)) * 0.55),
    ],
)
@pytest.mark.parametrize("v", [0.2, -0.2])
def test_bristles_slip_as_they_are_loaded(breakaway, r, left, v):
    effect = PreslidingFriction(stiffness=30.0, damping=2.0, breakaway=breakaway)
    bristles, h = alone(effect).presliding_friction, 0.01
    held = -r * np.sign(v) * 5
    row, damping = laws.friction_row(bristles, *numbers(held, 5, v, 1), h)
    assert [row, damping] == pytest.approx([h * h * 30 * left, 2 * left])


def test_bristles_that_slip_do_not_damp_and_stop_what_turns_back():
    for breakaway in (0.0, 0.4, 1.0):
        effect = PreslidingFriction(stiffness=30.0, damping=2.0, breakaway=breakaway)
        bristles = alone(effect).presliding_friction
        row, damping = laws.friction_row(bristles, *numbers(-5, 5, 0.1, 1), 0.01)
        assert row == pytest.approx(30 * 0.01**2) and damping == 2 * laws.SLIPPING
    # r = 0.98 of Dahl's, and too stiff for the step: 0.05 - 1 / (0.01^2 4e5)
    bristles = alone(PreslidingFriction(stiffness=4e5, breakaway=0.0)).presliding_friction
    row, _ = laws.friction_row(bristles, *numbers(-4.9, 5, 0.1, 1), 0.01)
    assert row == pytest.approx(40 * 0.025)


def test_bristles_at_rest_and_without_friction_are_whole():
    bristles = alone(PreslidingFriction(stiffness=30.0)).presliding_friction
    for held, bound, v in ((2, 5, 0), (0, 0, 0.1)):
        assert laws.friction_row(bristles, *numbers(held, bound, v, 1), 0.01)[0] == 30 * 0.01**2
    assert laws.friction_row(None, *numbers(0, 1, 0, 2), 0.01) == (2e4, 0)
    stiff = alone(PreslidingFriction(stiffness=1e14)).presliding_friction
    assert laws.friction_row(stiff, *numbers(0, 1, 0, 2), 0.01)[0] == 2e4


def test_a_gravity_offset_is_a_weight_on_an_arm():
    offset = alone(GravityOffset(sin=3.0, cos=-4.0)).gravity_offset
    force, steepest = laws.gravity(offset, jnp.array(0.7))
    assert force == pytest.approx(3 * np.sin(0.7) - 4 * np.cos(0.7)) and steepest == 5
    assert laws.gravity(alone(GravityOffset(force=2.0)).gravity_offset, jnp.array(0.7)) == (2, 0)


def test_a_handle_flies_through_its_play_and_gives_its_momentum():
    h, J, force = 0.001, 0.02, 0.5
    handle = alone(Backlash(play=0.01, inertia=J)).backlash
    g, w, v, given = *numbers(0, 0, 0), 0.0
    for n in range(1, 40):
        on_part, g, w = laws.backlash(handle, g, w, v, jnp.array(force), h)
        given += h * float(on_part)
        flown = 0.5 * n * (n + 1) * h * h * force / J
        assert g == pytest.approx(min(flown, 0.005))
        assert on_part == pytest.approx(0, abs=1e-12) or flown > 0.005
        assert given == pytest.approx(n * h * force - J * float(w), abs=1e-12)
    assert w == 0 and on_part == pytest.approx(force)


def test_a_joint_flies_through_its_play_and_shares_its_momentum_with_the_load():
    h, J, force, none = 0.001, 0.06, 0.5, laws.Resistance(*numbers(0, 0, 0))
    load = alone(Backlash(play=0.01, inertia=J, side="motor")).backlash
    g, w, v, flown = *numbers(0, 0, 0), 0.0
    for n in range(1, 60):
        passage = laws.meet(load, g, w, v, jnp.array(0.08), jnp.array(force), none, w * 0, none, h)
        v = v + h * (passage.scale * force + passage.force) / 0.08
        flown += h * float(v)
        g, w = laws.settle(load, passage, g, w, v, h)
        if abs(passage.side) == 0:
            assert v == pytest.approx(n * h * force / 0.02)
            assert g == pytest.approx(-flown) and flown <= 0.005
        else:
            assert 0.08 * v == pytest.approx(n * h * force)
            assert g == -0.005 and w == 0
    assert passage.side == -1


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_added_inertia_slows_the_start(kind):
    joint = replace(joint_of(kind, "added_inertia", 0.001)[1], gravity=jnp.zeros(2))
    none = replace(joint.friction, y=0 * joint.friction.y)
    pull = joint.conservative.y[0, 0]  # at the low end
    joint = replace(joint, friction=none, damping=none)
    start = solo.State(joint.range[0], *numbers(0, 0))
    after = solo.step(solo.prepare(joint), start, jnp.array(1.0), 0.001)
    assert after.v == pytest.approx(0.001 * (1 + pull) / (1.4 * joint.inertia))


def test_a_context_of_the_attached_scene_holds_the_added_inertia():
    model, joint, profile = joint_of("hinge", "added_inertia", 0.001)
    found, _ = found_of("hinge")
    with_it = found.model_copy(update={"equivalent_inertia": 1.4 * found.equivalent_inertia})
    again = solo.from_context(with_it, profile, model, 0, attached=True)
    assert again.inertia == pytest.approx(found.equivalent_inertia)
    assert joint.inertia == found.equivalent_inertia


def test_an_effect_that_a_joint_has_not_does_nothing():
    own, none = prepare(from_effects((), NAMES)), prepare(from_effects(()))
    place = numbers(0.3, 0.2)
    assert laws.damping(own, *place) == 0
    assert laws.friction(own, *place, jnp.array(2.0)) == (0, 0)
    assert laws.gravity(own.gravity_offset, place[0]) == (0, 0)
    row = numbers(-1, 2, 0.3, 0.1)
    assert laws.friction_row(own.presliding_friction, *row, 0.01) == laws.friction_row(
        none.presliding_friction, *row, 0.01
    )
    assert laws.backlash(own.backlash, *numbers(0, 0.1, 0.3, 7), 0.01) == (7, 0, 0.1)
    against = laws.Resistance(*numbers(1, 2, 3))
    for behind in (own.backlash, None):
        state = numbers(0.2, 0.1, 0.3)
        passage = laws.meet(behind, *state, *numbers(1, 7), against, *numbers(0), against, 0.01)
        assert passage[1:4] == (1, 1, 0)
        assert laws.settle(behind, passage, *state, 0.01) == (state[0], state[1])


# --- the plugin


@pytest.mark.long
@pytest.mark.parametrize("case", list(cases("hinge", 1, 1, 1)))
@pytest.mark.parametrize("kind", KINDS)
def test_two_seconds_under_random_forces_are_the_plugins(kind, case):
    h = 0.005
    model, joint, profile = joint_of(kind, case, h)
    if case != "all":  # compiled once: effects that do nothing besides
        joint = replace(joint, effects=from_effects(profile.effects, NAMES))
    (lo, hi), force = profile.joint.range, found_of(kind)[1]
    data, q, state = mujoco.MjData(model), [], []
    data.qpos[0] = 0.5 * (lo + hi)
    forces = pushes(force, 2, h)
    for push in forces:
        data.qfrc_applied[0] = push
        mujoco.mj_step(model, data)
        q.append(data.qpos[0])
        state.append(data.plugin_state.copy())
    start = solo.State(*numbers(0.5 * (lo + hi), 0, 0))
    path = run(joint, start, jnp.array(forces), h)
    assert np.abs(path.q - np.array(q)).max() < 1e-8 * (hi - lo)
    assert np.ptp(q) > 0.3 * (hi - lo)
    held, *handle = np.array(state).T
    # the stiffest friction row makes much force of little motion
    assert np.abs(path.held - held).max() < 1e-5 * force
    if len(handle) > 1:
        assert np.abs(path.g - handle[0]).max() < 1e-8 * (hi - lo)
        assert np.abs(path.w - handle[1]).max() < 1e-8 * (hi - lo) / h


# --- derivatives

STOPS = ("end_stop_restitution.low[]", "end_stop_restitution.high[]")
"""Numbers of joints that do not come to their ends."""
BEHIND = ("backlash.load[]", "backlash.share[]")
"""Numbers of a load behind a play, which does not go together with a handle."""
SWINGS = {"hinge": (5.0, -0.3, 1.3), "slide": (2.0, 0.0, 0.8)}
"""Amplitude and mean of a force that swings the joint through its range, and its period, s."""


@pytest.mark.sweep(1)
@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_by_all_numbers_are_those_of_central_differences(kind):
    h = 0.004
    _, joint, profile = joint_of(kind, "all", h)
    (lo, hi), force = profile.joint.range, found_of(kind)[1]
    amplitude, mean, period = SWINGS[kind]
    swing = amplitude * np.sin(2 * np.pi * h * np.arange(400) / period) + mean
    start = solo.State(*numbers(lo + 0.05 * (hi - lo), 0, 0))

    def positions(effects):
        return solo.rollout(replace(joint, effects=effects), start, jnp.array(force * swing), h)

    path = check_slopes(positions, joint.effects, skip=(*STOPS, *BEHIND))
    assert path.min() > lo and path.max() < hi and np.ptp(path) > 0.8 * (hi - lo)


def test_derivatives_by_the_numbers_of_a_load_are_those_of_central_differences():
    """From the middle of its play through it and on, under a force that never lets go."""
    _, joint, profile = joint_of("slide", "backlash behind", 0.004)
    (lo, hi), force = profile.joint.range, found_of("slide")[1]
    start = solo.State(*numbers(lo + 0.1 * (hi - lo), 0, 0))

    def positions(effects):
        push = jnp.full(60, 0.6 * force)
        return solo.rollout(replace(joint, effects=effects), start, push, 0.004)

    path = check_slopes(positions, joint.effects, skip=("backlash.handle[]", "backlash.play[]"))
    assert path.max() > lo + 0.3 * (hi - lo)


@pytest.mark.sweep(1)
@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_by_the_stops_are_those_of_central_differences(kind):
    _, joint, profile = joint_of(kind, "end_stop_restitution each", 0.004)
    (lo, hi), force = profile.joint.range, found_of(kind)[1]
    push = np.repeat(np.array([-4.0, 4.0, 4.0, -4.0]), 60) * force
    start = solo.State(*numbers(lo + 0.3 * (hi - lo), 0, 0))

    def positions(effects):
        return solo.rollout(replace(joint, effects=effects), start, jnp.array(push), 0.004)

    path = check_slopes(positions, joint.effects)
    assert path.min() < lo and path.max() > hi


@pytest.mark.long
def test_derivatives_at_rest_are_finite():
    both = [cases("hinge", 1.0, 1.0, 0.1)[case] for case in ("all", "backlash behind")]

    def everything(own, s, v, held, bound):
        up, down = laws.friction(own, s, v, 0 * v)
        row = laws.friction_row(own.presliding_friction, held, bound, v, 1 + s, 0.01)
        moved = laws.backlash(own.backlash, 0 * v, 0 * v, v, 0 * v, 0.01)
        against = laws.resistance(own, s, s, s, v, 0 * v)
        passage = laws.meet(own.backlash, *[0 * v] * 3, 1 + s, 0 * v, against, s, against, 0.01)
        moved += laws.settle(own.backlash, passage, 0 * v, 0 * v, v, 0.01)
        parts = (laws.damping(own, s, v), up, down, *row, *moved, passage.scale, passage.force)
        return sum(parts) + sum(laws.gravity(own.gravity_offset, s))

    run = jax.jit(jax.grad(everything, argnums=range(5)), compiler_options=FAST)
    for own in (*map(from_effects, both), from_effects((), NAMES)):
        slopes = run(own, *numbers(0.5, 0, 0, 0))
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))
