"""The laws of effects in JAX: closed forms, and derivatives at rest."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from effect_cases import cases
from slopes import FAST
from tables import random_table

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
from joda.field.table import resistance

jax.config.update("jax_enable_x64", True)
from joda.field import jaxtable  # noqa: E402
from joda.field.jaxeffects import NAMES, from_effects, prepare  # noqa: E402
from joda.joints import laws  # noqa: E402


def alone(*effects):
    return prepare(from_effects(effects))


def numbers(*values):
    return [jnp.array(float(value)) for value in values]


@pytest.mark.slow
def test_damping_depends_on_the_direction_and_the_speed():
    up = {"interval": (0.0, 0.5), "y": (2.0, 4.0)}
    own = alone(
        DirectionDependentDamping(direction="positive", **up),
        QuadraticDamping(direction="negative", y=(3.0, 3.0)),
    )
    wanted = {(0.25, 0.1): 3.0, (0.25, -0.2): 0.6, (0.25, 0.0): 0.0, (0.75, 0.1): 0.0}
    for (s, v), value in wanted.items():
        assert laws.extra_damping(own, *numbers(s, v)) == pytest.approx(value, abs=1e-15)
    both = alone(QuadraticDamping(y=(3.0, 3.0)))
    for v in (-0.2, 0.2):
        assert laws.extra_damping(both, *numbers(0.5, v)) == pytest.approx(0.6)


def test_friction_is_stribecks_and_coulombs_and_of_the_direction():
    own = alone(
        StribeckFriction(velocity=0.1, exponent=2.0, y=(0.5, 0.5)),
        LoadDependentFriction(coefficient=0.2),
        AsymmetricFriction(direction="negative", y=(0.3, 0.3)),
    )
    for v, rest in ((0.0, 0.5), (0.1, 0.5 * np.exp(-1)), (-0.2, 0.5 * np.exp(-4)), (1e9, 0)):
        up, down = laws.friction_bounds(own, *numbers(0.4, v, -2.0))
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
    row, damping = laws.stiffen_friction_row(bristles, *numbers(held, 5, v, 1), h)
    assert [row, damping] == pytest.approx([h * h * 30 * left, 2 * left])


def test_bristles_that_slip_do_not_damp_and_stop_what_turns_back():
    for breakaway in (0.0, 0.4, 1.0):
        effect = PreslidingFriction(stiffness=30.0, damping=2.0, breakaway=breakaway)
        bristles = alone(effect).presliding_friction
        row, damping = laws.stiffen_friction_row(bristles, *numbers(-5, 5, 0.1, 1), 0.01)
        assert row == pytest.approx(30 * 0.01**2) and damping == 2 * laws.SLIPPING
    # r = 0.98 of Dahl's, and too stiff for the step: 0.05 - 1 / (0.01^2 4e5)
    bristles = alone(PreslidingFriction(stiffness=4e5, breakaway=0.0)).presliding_friction
    row, _ = laws.stiffen_friction_row(bristles, *numbers(-4.9, 5, 0.1, 1), 0.01)
    assert row == pytest.approx(40 * 0.025)


def test_bristles_at_rest_and_without_friction_are_whole():
    bristles = alone(PreslidingFriction(stiffness=30.0)).presliding_friction
    for held, bound, v in ((2, 5, 0), (0, 0, 0.1)):
        assert (
            laws.stiffen_friction_row(bristles, *numbers(held, bound, v, 1), 0.01)[0]
            == 30 * 0.01**2
        )
    assert laws.stiffen_friction_row(None, *numbers(0, 1, 0, 2), 0.01) == (2e4, 0)
    stiff = alone(PreslidingFriction(stiffness=1e14)).presliding_friction
    assert laws.stiffen_friction_row(stiff, *numbers(0, 1, 0, 2), 0.01)[0] == 2e4


def test_a_gravity_offset_is_a_weight_on_an_arm():
    offset = alone(GravityOffset(sin=3.0, cos=-4.0)).gravity_offset
    force, steepest = laws.gravity_force(offset, jnp.array(0.7))
    assert force == pytest.approx(3 * np.sin(0.7) - 4 * np.cos(0.7)) and steepest == 5
    assert laws.gravity_force(alone(GravityOffset(force=2.0)).gravity_offset, jnp.array(0.7)) == (
        2,
        0,
    )


def test_a_handle_flies_through_its_play_and_gives_its_momentum():
    h, J, force = 0.001, 0.02, 0.5
    handle = alone(Backlash(play=0.01, inertia=J)).backlash
    g, w, v, given = *numbers(0, 0, 0), 0.0
    for n in range(1, 40):
        on_part, g, w = laws.backlash_force(handle, g, w, v, jnp.array(force), h)
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


@pytest.mark.slow
def test_a_learned_table_is_the_plugins_and_filling_changes_nothing():
    rng = np.random.default_rng()
    for _ in range(3):
        effect = random_table(rng, 2.0, rows=6, sides=6)
        s, v = rng.uniform(-0.2, 1.2, 300), rng.uniform(-3, 3, 300)
        for size in ((2, 3), (9, 15)):
            table = jaxtable.prepare(jaxtable.from_effect(effect, size))
            found = jax.vmap(partial(jaxtable.resistance, table))(s, v)
            for part, expected in zip(found, resistance(effect, s, v), strict=True):
                np.testing.assert_allclose(part, expected, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("memory", ["position", "speed"])
def test_a_memory_forgets_as_an_exponential(memory):
    """After one time constant at 3 rad/s, and two of rest."""
    time, gain = 0.5, 0.4
    own = alone(random_table(np.random.default_rng(), 1.0, memory=memory, time=time, gain=gain))
    held, reached = jnp.array(0.0), 3 * (1 - np.exp(-1)) * (time if memory == "position" else 1)
    for _ in range(50):
        held = laws.remember(own.learned_force, jnp.array(3.0), held, 0.01)
    assert held == pytest.approx(reached)
    push, drag = laws.learned_force(own.learned_force, *numbers(0.9, 0), held, 0.01)
    lost = 1 - np.exp(-0.01 / time)
    assert push == pytest.approx(-gain * held * (1 - lost) if memory == "position" else 0)
    other = laws.learned_force(own.learned_force, *numbers(0.9, 0), 0 * held, 0.01)[1]
    factor = 1 if memory == "position" else 1 + gain * held
    viscous = gain * lost * time * (memory == "position")
    assert drag - viscous == pytest.approx(factor * (other - viscous))
    for _ in range(100):
        held = laws.remember(own.learned_force, 0 * held, held, 0.01)
    assert held == pytest.approx(reached * np.exp(-2))


def test_an_effect_that_a_joint_has_not_does_nothing():
    own, none = prepare(from_effects((), NAMES)), prepare(from_effects(()))
    place = numbers(0.3, 0.2)
    assert laws.extra_damping(own, *place) == 0
    assert laws.friction_bounds(own, *place, jnp.array(2.0)) == (0, 0)
    assert laws.gravity_force(own.gravity_offset, place[0]) == (0, 0)
    row = numbers(-1, 2, 0.3, 0.1)
    assert laws.stiffen_friction_row(
        own.presliding_friction, *row, 0.01
    ) == laws.stiffen_friction_row(none.presliding_friction, *row, 0.01)
    assert laws.backlash_force(own.backlash, *numbers(0, 0.1, 0.3, 7), 0.01) == (7, 0, 0.1)
    for learned in (own.learned_force, None):
        assert laws.learned_force(learned, *place, jnp.array(0.4), 0.01) == (0, 0)
    against = laws.Resistance(*numbers(1, 2, 3))
    for behind in (own.backlash, None):
        state = numbers(0.2, 0.1, 0.3)
        passage = laws.meet(behind, *state, *numbers(1, 7), against, *numbers(0), against, 0.01)
        assert passage[1:4] == (1, 1, 0)
        assert laws.settle(behind, passage, *state, 0.01) == (state[0], state[1])


@pytest.mark.long
def test_derivatives_at_rest_are_finite():
    both = [cases("hinge", 1.0, 1.0, 0.1)[case] for case in ("all", "backlash behind")]

    def everything(own, s, v, held, bound):
        up, down = laws.friction_bounds(own, s, v, 0 * v)
        row = laws.stiffen_friction_row(own.presliding_friction, held, bound, v, 1 + s, 0.01)
        moved = laws.backlash_force(own.backlash, 0 * v, 0 * v, v, 0 * v, 0.01)
        against = laws.resistance(own, s, s, s, v, 0 * v)
        passage = laws.meet(own.backlash, *[0 * v] * 3, 1 + s, 0 * v, against, s, against, 0.01)
        moved += laws.settle(own.backlash, passage, 0 * v, 0 * v, v, 0.01)
        moved += (*laws.learned_force(own.learned_force, s, v, held, 0.01), passage.scale)
        moved += (laws.remember(own.learned_force, v, held, 0.01),)
        parts = (laws.extra_damping(own, s, v), up, down, *row, *moved, passage.force)
        return sum(parts) + sum(laws.gravity_force(own.gravity_offset, s))

    run = jax.jit(jax.grad(everything, argnums=range(5)), compiler_options=FAST)
    for own in (*map(from_effects, both), from_effects((), NAMES)):
        slopes = run(own, *numbers(0.5, 0, 0, 0))
        assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slopes))
