"""The independent simulator against closed forms, and the cases that are drawn from it."""

import json

import mujoco
import numpy as np
import pytest

from joda import JodaError
from joda.hidden import EFFECTS, UNCATALOGUED, draw, friction_laws, laws, write
from joda.hidden.cases import PARTIAL, VISIBLE
from joda.hidden.joint import base_model, draw_truth
from joda.hidden.simulator import Tape, simulate
from joda.hidden.truth import Bounce, Bristle, Delay, Inertia, Joint, Maxwell, Play, Truth
from joda.measured.run_files import read_run

H = 1e-4


def joint(inertia=1.0, cos=0.0, sin=0.0, lo=-100.0, hi=100.0, kind="hinge"):
    return Joint(kind, lo, hi, inertia, cos, sin, 1.0, 1.0)


def move(truth, q=0.0, v=0.0, force=0.0, seconds=1.0, h=H):
    """One lane; force is a number or a function of time."""
    steps = round(seconds / h)
    t = np.arange(steps + 1) * h
    pushes = force(t) if callable(force) else np.full(steps + 1, force)
    trace = simulate(truth, Tape(pushes[:, None]), np.array([q]), np.array([v]), steps, h)
    return t, trace.position[:, 0], trace.velocity[:, 0]


def test_a_pendulum_keeps_its_energy_and_small_swings_last_two_pi():
    _, q, v = move(Truth(joint(sin=-1.0), 0.0, 0.0), q=2.0, seconds=8, h=5e-4)
    np.testing.assert_allclose(0.5 * v**2 - np.cos(q), -np.cos(2.0), atol=1e-6)
    _, q, v = move(Truth(joint(sin=-1.0), 0.0, 0.0), q=1e-3, seconds=2 * np.pi, h=1e-3)
    assert q[-1] == pytest.approx(1e-3, rel=1e-5)


def test_damped_free_motion_runs_out_exponentially():
    t, q, _ = move(Truth(joint(inertia=2.0), 0.0, 3.0), v=1.5)
    np.testing.assert_allclose(q, 1.5 * (2 / 3) * (1 - np.exp(-1.5 * t)), atol=1e-8)


def test_dry_friction_stops_after_the_way_of_the_lost_energy_and_holds():
    _, q, v = move(Truth(joint(inertia=2.0), 0.7, 0.0), v=0.3)
    assert q[-1] == pytest.approx(0.3**2 / (2 * 0.7 / 2.0), rel=1e-9)
    assert v[-1] == 0


@pytest.mark.parametrize("sign", [1, -1])
def test_breakaway_is_exactly_at_static_friction(sign):
    held = move(Truth(joint(), 0.7, 0.0), force=sign * 0.7)[1]
    assert (held == 0).all()
    t, q, _ = move(Truth(joint(), 0.7, 0.0), force=sign * (0.7 + 1e-6))
    assert q[-1] == pytest.approx(sign * 0.5e-6, rel=1e-3)
    t, q, _ = move(Truth(joint(), 0.7, 0.0), force=lambda t: sign * t)
    assert t[np.argmax(q != 0)] == pytest.approx(0.7, abs=2.5 * H)


def test_it_reverses_at_once_where_the_force_exceeds_friction():
    t, q, _ = move(Truth(joint(), 0.2, 0.0), v=0.5, force=-1.0)
    turn = 0.5 / 1.2
    expected = np.where(
        t < turn, 0.5 * t - 0.6 * t**2, 0.5 * turn - 0.6 * turn**2 - 0.4 * (t - turn) ** 2
    )
    np.testing.assert_allclose(q, expected, atol=1e-10)


def test_terminal_velocities():
    assert move(Truth(joint(), 0.2, 2.0), force=1.0, seconds=12, h=1e-3)[2][-1] == pytest.approx(
        0.4
    )
    drag = Truth(joint(), 0.2, 0.0, (laws.Drag(0.2),))
    assert move(drag, force=1.0, seconds=30, h=1e-2)[2][-1] == pytest.approx(2.0)
    root = Truth(joint(hi=1000.0), 0.0, 0.0, (friction_laws.RootDamping(0.5),))
    assert move(root, force=1.0, seconds=120, h=1e-2)[2][-1] == pytest.approx(4.0)


def test_stribeck_friction_in_steady_motion():
    truth = Truth(joint(), 0.2, 1.0, (friction_laws.Stribeck(0.5, 0.3),))
    v = move(truth, v=0.5, force=1.0, seconds=20, h=1e-3)[2][-1]
    assert 0.2 + v + 0.5 * np.exp(-((v / 0.3) ** 2)) == pytest.approx(1.0)


def test_a_bristle_is_a_spring_before_it_slides_and_friction_after():
    truth = Truth(joint(), 0.5, 0.0, (Bristle(0.5, 1000.0, 10.0),))
    q = move(truth, force=lambda t: 0.01 * t)[1]
    assert 0.01 / q[-1] == pytest.approx(1000, rel=0.03)
    _, _, v = move(truth, v=0.5, force=0.5)
    assert v[-1] == pytest.approx(v[-1000], rel=1e-6)


def test_a_maxwell_element_relaxes():
    truth = Truth(joint(inertia=1e6), 0.0, 0.0, (Maxwell(3.0, 0.5),))
    _, _, v = move(truth, v=1.0, seconds=2)
    lost = 3.0 * 0.5 * (2 - 0.5 * (1 - np.exp(-4)))
    assert 1e6 * (1 - v[-1]) == pytest.approx(lost, rel=1e-4)


def test_load_and_direction_decide_friction():
    held = Truth(joint(cos=0.5, kind="slide"), 0.1, 0.0, (friction_laws.LoadFriction(0.5),))
    assert move(held, force=-0.7)[2][-1] == 0
    assert move(held, force=-0.71)[2][-1] < 0.02
    one_way = Truth(joint(), 0.1, 0.0, (friction_laws.IntervalFriction(0.5, -1.0, 2.0, 0.0, -1),))
    assert move(one_way, force=1.0)[2][-1] == pytest.approx(0.9)
    assert move(one_way, force=-1.0)[2][-1] == pytest.approx(-0.4)


def test_inertia_and_delay():
    assert move(Truth(joint(), 0.0, 0.0, (Inertia(1.0),)), force=1.0)[1][-1] == pytest.approx(0.25)
    late = Truth(joint(), 0.0, 0.0, (Delay(0.05),))
    _, q, _ = move(late, force=lambda t: 1.0 * (t > 1e-9))
    assert q[-1] == pytest.approx(0.95**2 / 2, rel=1e-3)


def test_a_handle_crosses_its_play_before_the_part_moves():
    truth = Truth(joint(), 0.0, 0.0, (Play(0.02, 0.1),))
    t, q, v = move(truth, force=0.5)
    dead = np.sqrt(2 * 0.01 * 0.1 / 0.5)
    start = np.argmax(q > 0)
    assert t[start] == pytest.approx(dead, abs=3 * H)
    assert v[start] == pytest.approx(0.1 * (0.5 / 0.1) * dead / 1.1, rel=0.02)
    assert np.diff(v[-100:]).mean() / H == pytest.approx(0.5 / 1.1)


def test_ends_throw_back_with_the_coefficient_of_restitution():
    end = joint(lo=-1.0, hi=1.0)
    _, q, v = move(Truth(end, 0.0, 0.0, (Bounce(0.6),)), v=2.0)
    assert v[-1] == pytest.approx(-1.2)
    assert q[-1] == pytest.approx(1 - 0.5 * 1.2, abs=1e-9)
    _, q, v = move(Truth(end, 0.0, 0.0, (Bounce(0.6),)), force=-1.0, seconds=12, h=1e-3)
    assert (q[-1], v[-1]) == (-1.0, 0.0)


@pytest.mark.parametrize("seed", range(20))
def test_the_base_model_has_the_inertia_and_gravity_of_the_joint(seed):
    truth = draw_truth(
        np.random.default_rng(seed), heavy=False, gravity=True, friction=True, damping=True
    )
    model = mujoco.MjModel.from_xml_string(base_model(truth, "joint"))
    data = mujoco.MjData(model)
    base, inertia = truth.joint, np.empty(1)
    np.testing.assert_allclose(model.jnt_range[0], [base.lo, base.hi], rtol=1e-12)
    assert model.dof_damping[0] == pytest.approx(truth.damping_model)
    assert model.dof_frictionloss[0] == pytest.approx(truth.friction_model)
    for q in np.linspace(base.lo, base.hi, 5):
        data.qpos[0] = q
        mujoco.mj_forward(model, data)
        turn = q if base.kind == "hinge" else 0.0
        gravity = base.gravity_cos * np.cos(turn) + base.gravity_sin * np.sin(turn)
        assert data.qfrc_bias[0] == pytest.approx(-gravity, rel=1e-6, abs=1e-9 * base.force)
        mujoco.mj_mulM(model, data, inertia, np.ones(1))
        assert inertia[0] == pytest.approx(base.inertia, rel=1e-6)


@pytest.mark.slow
def test_a_seed_gives_the_same_case():
    one, other = draw(1, "bistable_mechanism"), draw(1, "bistable_mechanism")
    assert one.seal == other.seal
    assert one.model == other.model
    np.testing.assert_array_equal(one.train[2].position, other.train[2].position)
    assert draw(2, None, forced=False).model != one.model


NAMES = [*EFFECTS, *UNCATALOGUED, "added_inertia"]


@pytest.mark.slow
@pytest.mark.sweep(5)
@pytest.mark.parametrize(("effect", "second"), list(zip(NAMES[::2], NAMES[1::2], strict=True)))
def test_what_is_hidden_shows(effect, second):
    case = draw(1, effect, second=second)
    assert len(case.train) == 8
    assert len(case.held_out) == len(case.held_out_clean) == 4
    for seal, name in ((case.seal, effect), (case.seal["second"], second)):
        assert seal["effect"] in (name, PARTIAL.get(name))
        assert seal["visible"] >= VISIBLE
        low, high = seal["interval"]
        assert 0 <= low < high <= 1


def test_a_written_case_is_read_again(tmp_path):
    case = draw(5, "gravity_offset", forced=False, second="quadratic_damping")
    write(case, tmp_path / "case")
    run = read_run(tmp_path / "case" / "run3.csv")
    np.testing.assert_allclose(run.position, case.train[2].position, rtol=1e-8)
    assert not run.forced
    assert run.velocity is None
    seal = json.loads((tmp_path / "case" / "sealed.json").read_text())
    assert (seal["effect"], seal["second"]["effect"]) == ("gravity_offset", "quadratic_damping")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "case" / "model.xml")).njnt == 1


def test_mistakes_are_named():
    with pytest.raises(JodaError, match="no hidden effect 'ghost'; there are constant_friction"):
        draw(0, "ghost")
    with pytest.raises(JodaError, match="backlash does not show without a recorded force"):
        draw(0, "backlash", forced=False)
