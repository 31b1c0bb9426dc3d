"""Families of joda.hidden: what each draws, and the laws that only they have, in closed form."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from hidden_cases import read
from hidden_model import true_profile

import joda
from joda import JodaError
from joda.diagnosis.adding import error
from joda.hidden import EFFECTS, FAMILIES, draw, friction_laws, memory, shapes, write
from joda.hidden.cases import PARTIAL, VISIBLE
from joda.hidden.drag import Orifice
from joda.hidden.laws import ForceAlong
from joda.hidden.masses import Attached, Behind, Linkage
from joda.hidden.simulator import Tape, simulate
from joda.hidden.stops import buffer, damping_ratio, pad, restitution
from joda.hidden.truth import Joint, Rebound, Truth

OTHERS = [name for name in FAMILIES if name != "laboratory"]
HIDDEN = [
    (family, name, forced)
    for family in OTHERS
    for name in (None, *FAMILIES[family].builders)
    for forced in (True, False)
    if forced or name not in FAMILIES[family].pushed
]


def digest(case):
    """Of what a case's files hold, to the seventh part of the range."""
    found, joint = hashlib.sha256(case.model.encode()), case.truth.joint
    for run in (*case.train, *case.held_out):
        for x in (run.time, run.position / joint.span, run.force / joint.force):
            found.update((np.round(x, 7) + 0.0).tobytes())
    return found.hexdigest()[:16]


@pytest.mark.sweep(1)
@pytest.mark.parametrize(
    ("args", "expected"),
    [
        ((1, None, False), "e20f844e316d81f9"),
        ((2, "detent_internal"), "2457a6a0dc94046a"),
        ((3, "presliding_friction"), "d6a0977d32d3cf2e"),
        ((4, "backlash", True, "gravity_offset"), "360888ec43329c3c"),
        ((5, "actuation_delay"), "5e3731faf6bfd949"),
        ((6, "end_stop_restitution", False), "c588d6cae0964a16"),
    ],
)
def test_the_first_family_draws_what_it_drew_before_there_were_others(args, expected):
    assert digest(draw(*args)) == expected


# --- every family
def test_every_family_hides_every_effect_and_laws_of_no_catalogue():
    for family in FAMILIES.values():
        assert tuple(family.known) == EFFECTS
        assert len(family.uncatalogued) >= 6
        assert not set(family.uncatalogued) & set(EFFECTS)


@pytest.mark.slow
@pytest.mark.sweep(4)
@pytest.mark.parametrize(("family", "effect", "forced"), HIDDEN)
def test_a_case_shows_its_effect_and_is_read(family, effect, forced):
    case = draw(1, effect, forced, family=family)
    assert case.visible >= VISIBLE
    assert case.seal["effect"] in (effect, PARTIAL.get(effect))
    assert 2 <= len(case.train) <= 12
    for run in (*case.train, *case.held_out):
        assert 0.19 <= run.time[-1] <= 61
        assert run.forced == forced
    train, held_out = read(case)
    assert (len(train.runs), len(held_out.runs)) == (len(case.train), len(case.held_out))
    assert case.achievable.together < 0.6 * case.truth.joint.span


@pytest.mark.sweep(1)
@pytest.mark.parametrize("family", OTHERS)
def test_joda_compares_a_case(family, tmp_path):
    case = draw(1, "quadratic_damping", family=family)
    write(case, tmp_path)
    found = joda.compare(tmp_path / "model.xml", case.joint, [tmp_path / case.held_out[0].name])
    assert np.isfinite(found.rmse)


def test_a_seed_gives_the_same_case_of_a_family_and_families_differ():
    cases = [draw(3, "detent_internal", False, family=name) for name in (*OTHERS, OTHERS[0])]
    digests = [digest(case) for case in cases]
    assert digests[0] == digests[-1]
    assert len(set(digests)) == len(OTHERS)


@pytest.mark.slow
def test_a_resistance_in_a_part_of_the_range_is_called_position_dependent():
    for seed in range(4):
        case = draw(seed, "constant_friction_hinge", False)
        a, b = case.seal["interval"]
        assert (case.seal["effect"] == "constant_friction_hinge") == (b - a >= 0.8)


def test_under_a_constant_load_friction_by_load_is_constant_friction():
    rng = np.random.default_rng()
    slides = (
        draw(int(rng.integers(1 << 31)), "load_dependent_friction", False, family="switches")
        for _ in range(60)
    )
    case = next(one for one in slides if one.truth.joint.kind == "slide")
    assert case.seal["also_right"] == ["constant_friction_hinge"]
    truth, joint = case.truth, case.truth.joint
    (law,) = truth.hidden
    load = np.array([joint.gravity_cos])
    constant = truth.friction + float(law.limit(None, None, None, load, None)[0])
    still, h = np.zeros((2001, 1)), joint.time / 1000
    start = np.array([0.5 * (joint.lo + joint.hi)]), np.array([joint.span / joint.time])
    paths = [
        simulate(one, Tape(still), *start, 2000, h).position
        for one in (truth, replace(truth, hidden=(), friction=constant))
    ]
    assert np.ptp(paths[0]) > 0.01 * joint.span
    np.testing.assert_allclose(*paths, atol=1e-9 * joint.span)


def test_the_true_joint_misses_a_quiet_run_by_the_noise():
    case = draw(6, None, False, family="switches")
    assert case.achievable.together >= 0.9 * case.noise
    assert len(case.achievable.runs) == len(case.held_out)
    assert case.achievable is case.achievable


@pytest.mark.slow
@pytest.mark.sweep(1)
@pytest.mark.parametrize(("family", "seed"), [("household", 1), ("switches", 1), ("machinery", 2)])
def test_in_mujoco_the_true_numbers_move_as_in_the_simulator(family, seed):
    """Masses, return springs and stops of the base model against the simulator's."""
    case = draw(seed, None, family=family)
    _, held_out = read(case)
    true = true_profile(case, held_out.profile)
    assert error(held_out, true).whole < 1.5 * case.achievable.together


def test_mistakes_are_named():
    with pytest.raises(JodaError, match="no family 'ghost'; there are laboratory, household"):
        draw(0, None, family="ghost")
    with pytest.raises(JodaError, match="no hidden effect 'cogging'; there are constant_friction"):
        draw(0, "cogging", family="machinery")
    with pytest.raises(JodaError, match="backlash does not show without a recorded force"):
        draw(0, "backlash", forced=False, family="switches")


# --- laws in closed form
H = 1e-4


def joint(lo=-100.0, hi=100.0):
    return Joint("hinge", lo, hi, 1.0, 0.0, 0.0, 1.0, 1.0)


def move(truth, q=0.0, v=0.0, force=0.0, seconds=1.0, h=H):
    """One lane; force is a number or a function of time."""
    steps = round(seconds / h)
    t = np.arange(steps + 1) * h
    pushes = force(t) if callable(force) else np.full(steps + 1, force)
    trace = simulate(truth, Tape(pushes[:, None]), np.array([q]), np.array([v]), steps, h)
    return t, trace.position[:, 0], trace.velocity[:, 0]


def stopped(stop, v):
    """Velocity after a flight into the high stop."""
    truth = Truth(joint(hi=1.0), 0.0, 0.0, (Rebound(True, stop),), stops=(stop, stop))
    return move(truth, q=0.99, v=v, seconds=0.5 / v, h=1e-4 / v)[2][-1]


@pytest.mark.parametrize("coefficient", [0.05, np.exp(-2), 0.4, 0.8])
def test_a_buffer_throws_back_with_the_restitution_asked_for(coefficient):
    ratio = damping_ratio(coefficient)
    assert restitution(ratio) == pytest.approx(coefficient, abs=1e-6)
    for v in (0.5, 2.0):
        back = -stopped(buffer(1.0, 100.0, ratio), v) / v
        assert back == pytest.approx(coefficient, abs=0.01)
    assert damping_ratio(np.exp(-2)) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("coefficient", [0.4, 0.8])
def test_a_pad_throws_back_less_of_what_is_faster(coefficient):
    one = pad(1.0, 100.0, 2.0, coefficient)
    assert stopped(one, 2.0) == pytest.approx(-2 * coefficient, rel=0.01)
    assert -stopped(one, 0.5) / 0.5 > coefficient + 0.05


def test_a_joint_rests_in_its_stop_where_the_spring_holds_the_push():
    stops = (buffer(1.0, 50.0, 1.0),) * 2
    _, q, v = move(Truth(joint(hi=1.0), 0.0, 0.0, stops=stops), q=0.9, force=5.0, seconds=3)
    assert q[-1] == pytest.approx(1 + 5 / 2500, rel=1e-6)
    assert abs(v[-1]) < 1e-9


COURSES = [
    shapes.Well(shapes.windowed_sine, 0.5, 0.2),
    shapes.Well(shapes.triangle, 0.5, 0.2, 0.6),
    shapes.Well(shapes.quartic, 0.5, 0.2),
    shapes.Cubic(0.5, 0.45),
    shapes.Sine(0.5, 1.5),
    shapes.Strut(0.5, 0.4, 2.0, 1.6),
    shapes.Strut(0.5, 0.4, 2.0, 0.0),
    shapes.ToEnd(shapes.Gap(0.1, 4.0), True),
    shapes.ToEnd(shapes.Decay(0.1), False),
    shapes.ToEnd(shapes.Lever(0.3, 1.2), True),
    shapes.ToEnd(shapes.TwoRate(0.2, 0.5, 1.0), False),
    shapes.ToEnd(shapes.Progressive(0.2, 1.5), True),
]


@pytest.mark.slow
@pytest.mark.sweep(4)
@pytest.mark.parametrize("course", COURSES, ids=lambda course: type(course).__name__)
def test_a_conservative_law_takes_no_energy_around_a_loop(course):
    law = ForceAlong(0.5, course)
    stop = buffer(1.0, 200.0, 0.0)
    truth = Truth(joint(0.0, 1.0), 0.0, 0.0, (law,), stops=(stop, stop))
    _, q, v = move(truth, q=0.3, v=2.0, seconds=3.0, h=5e-5)
    here = np.flatnonzero(np.diff(q > 0.3))[1:]
    assert len(here) >= 3
    np.testing.assert_allclose(np.abs(v[here]), 2.0, rtol=5e-3)


def test_a_dead_centre_is_left_and_a_well_is_not():
    for course in (shapes.Cubic(0.5, 0.6), shapes.Strut(0.5, 0.4, 2.0, 1.6)):
        assert course(np.array([0.6]))[0] > 0 > course(np.array([0.4]))[0]
    for lobe in (shapes.windowed_sine, shapes.triangle, shapes.quartic, shapes.gaussian):
        assert lobe(np.array([0.2]))[0] < 0 < lobe(np.array([-0.2]))[0]


@pytest.mark.slow
def test_springs_and_frictions_of_a_joint_hold_below_their_limit():
    laws = [friction_laws.PowerStribeck(0.5, 0.3, 1.0), friction_laws.RationalStribeck(0.5, 0.3)]
    laws += [
        memory.RunningIn(0.5, 1.0),
        friction_laws.PositionFriction(0.5, shapes.Trapezoid(0, 1, 0.1)),
    ]
    for law in laws:
        truth = Truth(joint(), 0.2, 0.0, (law,))
        assert (move(truth, force=0.69)[1] == 0).all()
        assert move(truth, force=0.72)[1][-1] > 0
    loaded = Truth(joint(), 0.2, 0.0, (friction_laws.LoadedContact(0.5, 1.0),))
    assert (move(loaded, force=0.3)[1] == 0).all()
    bearing = Truth(joint(), 0.0, 0.0, (friction_laws.LoadedBearing(0.5, 0.3),))
    v = move(bearing, force=1.0)[2][-1]
    assert v == pytest.approx(1 - 0.5 * (np.hypot(1, 0.3) - 0.3), rel=1e-6)


def test_stribeck_frictions_fall_as_their_formulas():
    for law, left in (
        (friction_laws.PowerStribeck(0.5, 0.3, 1.0), lambda v: 0.5 * np.exp(-v / 0.3)),
        (friction_laws.RationalStribeck(0.5, 0.3), lambda v: 0.5 / (1 + (v / 0.3) ** 2)),
    ):
        v = move(Truth(joint(), 0.2, 1.0, (law,)), v=0.8, force=1.0, seconds=20, h=1e-3)[2][-1]
        assert 0.2 + v + left(v) == pytest.approx(1.0)


def test_an_orifice_brakes_as_its_formula():
    v = move(Truth(joint(), 0.0, 0.0, (Orifice(0.5, 1.0),)), force=1.0, seconds=20, h=1e-3)[2][-1]
    assert 0.5 * v * np.hypot(v, 1.0) == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("law", [memory.slips(0.5, 1e3, 4), memory.BrittleBristle(0.5, 1e3, 0.5)])
def test_presliding_is_a_spring_first_and_friction_at_last(law):
    truth = Truth(joint(), 0.5, 5.0, (law,))
    q = move(truth, force=lambda t: 0.01 * t)[1][-1]
    assert 0.01 / q == pytest.approx(law.stiffness, rel=0.05)
    v = move(truth, v=0.1, force=1.0, seconds=3)[2][-1]
    assert 0.5 + 5 * v == pytest.approx(1.0, rel=1e-3)


def test_slips_keep_a_loop_that_is_as_wide_as_masing_says():
    law = memory.slips(1.0, 100.0, 5)
    path = np.concatenate([np.linspace(0, 0.01, 2000), np.linspace(0.01, -0.01, 4000)])
    z, force = law.start(np.zeros(1), np.zeros(1)), []
    for step in np.diff(path):
        z = law.advance(z, np.zeros(1), np.array([step]), 1.0)
        force.append(law.force(z, np.zeros(1), np.zeros(1))[0])
    first = np.interp(0.005, path[1:2000], force[:1999])
    back = np.interp(-0.0, -path[2000:], force[1999:])
    assert back - force[1998] == pytest.approx(-2 * first, rel=1e-2)


@pytest.mark.long
def test_backlash_lets_the_measured_part_move_alone_until_it_has_crossed():
    law = Behind(0.02, 0.8, 0.3, 0.0, 0.16 * 200.0**2, 2 * 0.5 * 0.16 * 200)
    truth = Truth(joint(), 0.3, 0.0, (law,))
    t, q, v = move(truth, force=0.2, h=2e-5)
    alone = q < 0.009
    np.testing.assert_allclose(q[alone], 0.5 * t[alone] ** 2, rtol=1e-3, atol=1e-9)
    assert 0.0099 < q[-1] < 0.02  # beyond, as far as the blow moves the part
    assert abs(v[-1]) < 1e-3
    v = move(truth, force=1.3, h=2e-5, seconds=2)[2]
    assert (v[-1] - v[-5001]) / 0.1 == pytest.approx(1.0, rel=0.01)


@pytest.mark.slow
def test_masses_move_along():
    linked = Truth(joint(0.0, 1.0), 0.0, 0.0, (Linkage(1.0, 0.3, 1.0),))
    _, q, v = move(linked, v=0.5)
    energy = (1 + 1 + 0.3 * np.cos(np.pi * q)) * v**2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-6)
    attached = Truth(joint(), 0.0, 0.0, (Attached(0.5, 0.5 * 100.0**2, 2 * 0.3 * 0.5 * 100),))
    v = move(attached, force=1.5, h=2e-5)[2]
    assert v[-1] == pytest.approx(1.0, rel=0.01)


def test_air_is_caught_before_the_high_end_only_and_leaks():
    law, z = memory.Cushion(10.0, 0.5, 0.2), np.zeros(1)
    for s in (0.4, 0.6, 0.7):
        z = law.advance(z, np.array([s]), np.array([1.0]), 0.1)
        assert (z[0] > 0) == (s > 0.5)
    assert law.advance(z, np.array([0.7]), np.zeros(1), 0.2)[0] == pytest.approx(z[0] / np.e)
