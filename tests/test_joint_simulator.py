"""The joint by itself in C++: MuJoCo's motion with the plugin, starts anew, and mistakes."""

import mujoco
import numpy as np
import pytest
from effect_cases import KINDS, MODELS, cases, found_of, profile_for, profile_of, pushes, quiet

from joda import context, templates
from joda._core import JointSimulator
from joda.effects import Backlash, PreslidingFriction
from joda.joints.joint_model import ONLY_SLIDES, friction_row
from joda.joints.rig import gravity_factors
from joda.profile import ATTRIBUTES

PLAIN = ("", "sum", "0 1 | 0 1 | 1 1", "sum", "0 1 | 0 1 | 0.1 0.1", "sum", "")
"""Dry friction of 1 N and a damping of 0.1 N s/m."""
BODY = {
    "inertia": 1.0,
    "row_inertia": 0.0,
    "weight": (0.0, 0.0),
    "hinge": False,
    "solref": (0.02, 1.0),
    "solimp": (0.9, 0.95, 0.001, 0.5, 2.0),
}


def core(found, profile, model):
    """The joint of a rig with a profile."""
    texts = profile.attributes()
    hinge = found.joint.type == "hinge"
    slides = model.body_simple[model.jnt_bodyid[0]] == ONLY_SLIDES
    return JointSimulator(
        *profile.joint.range,
        texts=[texts.get(key, "") for key in ATTRIBUTES if key != "range"],
        inertia=found.equivalent_inertia,
        row_inertia=1 / model.dof_invweight0[0] if slides else 0,
        weight=gravity_factors(found) if hinge else (found.gravity_force[0], 0),
        hinge=hinge,
        solref=model.jnt_solref[0],
        solimp=model.jnt_solimp[0],
    )


def joint(effects="", **changes):
    """A joint of 1 kg, free of weight unless the changes say otherwise."""
    return JointSimulator(0, 1, [*PLAIN[:-1], effects], **BODY | changes)


def engine(model, q, forces):
    """Positions in MuJoCo before the first step and after each."""
    data, path = mujoco.MjData(model), [q]
    data.qpos[0] = q
    for force in forces:
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data)
        path.append(data.qpos[0])
    return np.array(path)


def assert_same(found, profile, model, forces, within=1e-7):
    """From rest in the middle the joint moves as in MuJoCo; returns the positions there."""
    lo, hi = found.joint.range
    start = 0.5 * (lo + hi)
    visited = engine(model, start, forces)
    before, after = core(found, profile, model).replay(
        forces, [0], [(start, 0)], [True], model.opt.timestep
    )
    assert np.abs(after - visited[1:]).max() < within * (hi - lo)
    np.testing.assert_array_equal(before, [start, *after[:-1]])
    return visited


# --- the engine


@pytest.mark.slow
@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
@pytest.mark.parametrize("number", range(len(templates())), ids=sorted(templates()))
def test_a_template_moves_under_random_forces_as_in_the_engine(number, path):
    found = context(path, "#0")
    lo, hi = found.joint.range
    profile, force = profile_for(found, number)
    # of joints of some grams the engine's solver leaves more
    within = 1e-7 if found.equivalent_inertia > 1e-5 else 1e-5
    for h in (0.002, 0.005):
        pushed = np.random.default_rng(number).normal(0, 2 * force, 20)
        forces = np.repeat(pushed, round(0.1 / h))
        visited = assert_same(found, profile, quiet(found, profile, h), forces, within)
        assert np.ptp(visited) > 0.1 * (hi - lo)


@pytest.mark.slow
@pytest.mark.parametrize("case", list(cases("hinge", 1, 1, 1)))
@pytest.mark.parametrize("kind", KINDS)
def test_effects_act_as_in_the_engine(kind, case):
    found, force = found_of(kind)
    lo, hi = found.joint.range
    effects = cases(kind, force, found.equivalent_inertia, 0.03 * (hi - lo))[case]
    profile = profile_of(found.joint, effects, force)
    model = quiet(found, profile, 0.005)
    visited = assert_same(found, profile, model, pushes(force, 2, 0.005))
    assert np.ptp(visited) > 0.3 * (hi - lo)


@pytest.mark.parametrize(
    ("solref", "h"),
    [
        ((0.05, 0.3), 0.002),
        ((-3e3, -20.0), 0.002),
        ((0.02, 1.0), 0.02),  # too stiff for the step: the engine softens it
    ],
)
@pytest.mark.parametrize("solimp", [(0.5, 0.9, 0.1, 0.3, 3), (0.2, 0.8, 0.05, 0.5, 1), (0.9, 1)])
@pytest.mark.parametrize("kind", KINDS)
def test_the_ends_of_the_range_give_as_in_the_engine(kind, solimp, solref, h):
    found, force = found_of(kind)
    lo, hi = found.joint.range
    profile = profile_of(found.joint, (), force)
    model = quiet(found, profile, h)
    model.jnt_solref[0], model.jnt_solimp[0, : len(solimp)] = solref, solimp
    forces = np.repeat(force * np.array([4.0, -6, 5, -3]), round(0.5 / h))
    visited = assert_same(found, profile, model, forces)
    assert visited.min() < lo and visited.max() > hi


# --- starts


def test_a_fresh_start_is_a_replay_of_its_own():
    found, force = found_of("hinge")
    lo, hi = found.joint.range
    effects = cases("hinge", force, found.equivalent_inertia, 0.03 * (hi - lo))["all"]
    profile = profile_of(found.joint, effects, force)
    simulator = core(found, profile, quiet(found, profile, 0.005))
    forces, starts = pushes(force, 2, 0.005), [(lo + 0.3 * (hi - lo), 0.2), (lo, -0.1)]
    n = len(forces) // 3
    before, after = simulator.replay(forces, [0, n], starts, [True, True], 0.005)
    for part, start in ((slice(n), starts[0]), (slice(n, None), starts[1])):
        own = simulator.replay(
            forces[part], [0], [start], [False], 0.005
        )  # the first is fresh anyway
        np.testing.assert_array_equal([before[part], after[part]], own)
    assert [before[0], before[n]] == [start[0] for start in starts]
    kept = simulator.replay(forces, [0, n], starts, [True, False], 0.005)
    assert kept[1][n] != after[n]


def test_a_start_where_the_joint_is_changes_nothing():
    found, force = found_of("slide")
    lo, hi = found.joint.range
    effects = cases("slide", force, found.equivalent_inertia, 0.03 * (hi - lo))["all"]
    profile = profile_of(found.joint, effects, force)
    simulator, h = core(found, profile, quiet(found, profile, 0.005)), 0.005
    forces = pushes(force, 2, h)
    before, after = simulator.replay(forces, [0], [(0.5 * (lo + hi), 0)], [True], h)
    n = 130
    start = (before[n], (before[n] - before[n - 1]) / h)
    again = simulator.replay(forces, [0, n], [(before[0], 0), start], [True, False], h)
    np.testing.assert_allclose(again[1], after, atol=1e-9 * (hi - lo))


def test_a_joint_held_by_friction_stays_across_a_start():
    simulator = joint()
    forces = np.full(1000, 0.9)
    starts = ([0, 500], [(0.5, 0), (0.6, 0)])
    kept = simulator.replay(forces, *starts, [True, False], 0.002)[1][500:] - 0.6
    fresh = simulator.replay(forces, *starts, [True, True], 0.002)[1][500:] - 0.6
    assert np.abs(kept).max() < 1e-12
    assert fresh[-1] > 1e3 * np.abs(kept).max()  # the row must take up the force anew


def test_bristles_keep_their_force_across_a_start():
    effect = PreslidingFriction(stiffness=100, damping=20)
    simulator, forces = joint(effect_text(effect)), np.full(4000, 0.5)
    starts = ([0, 2000], [(0.5, 0), (0.7, 0)])
    kept = simulator.replay(forces, *starts, [True, False], 0.002)[1]
    fresh = simulator.replay(forces, *starts, [True, True], 0.002)[1]
    assert kept[1999] - 0.5 == pytest.approx(0.005, rel=1e-3)  # the force bends them
    assert np.abs(kept[2000:] - 0.7).max() < 1e-6
    assert fresh[-1] - 0.7 == pytest.approx(0.005, rel=1e-3)


def test_the_handle_keeps_its_place_and_motion_beside_the_part():
    effect = Backlash(play=0.02, inertia=0.1)
    simulator, h, n = joint(effect_text(effect)), 0.001, 10
    forces = np.full(100, 5.0)

    def steps_to_the_part(starts, fresh):
        after = simulator.replay(forces, [0, n], starts, fresh, h)[1][n:]
        return int(np.argmax(np.diff(after) > 1.5e-4))

    # 0.1 kg pushed by 5 N flies through 0.01 m within 20 steps of 1 ms
    plain = steps_to_the_part([(0.5, 0), (0.5, 0)], [True, False])
    assert plain == steps_to_the_part([(0.5, 0), (0.3, 0)], [True, False])
    assert steps_to_the_part([(0.5, 0), (0.5, 0)], [True, True]) == plain + n
    moving = joint(effect_text(effect), weight=(1.0, 0.0))  # as large as friction
    for fresh in (True, False):  # the handle starts with the part, so that neither gains
        run = moving.replay(np.zeros(3), [0, 1], [(0.5, 0), (0.5, 0.1)], [True, fresh], h)[1]
        assert run[1] == pytest.approx(0.5 + 0.1 * h, rel=1e-3)


def test_a_load_keeps_its_place_and_motion_beside_the_part():
    effect = Backlash(play=0.02, inertia=0.5, side="motor", share=1.0)
    simulator, h, n = joint(effect_text(effect)), 0.001, 10
    forces = np.full(100, 5.0)

    def steps_to_the_load(starts, fresh):
        after = simulator.replay(forces, [0, n], starts, fresh, h)[1][n:]
        return int(np.argmin(np.diff(after, 2)))

    plain = steps_to_the_load([(0.5, 0), (0.5, 0)], [True, False])
    assert plain == steps_to_the_load([(0.5, 0), (0.3, 0)], [True, False])
    assert steps_to_the_load([(0.5, 0), (0.5, 0)], [True, True]) > plain
    for fresh in (True, False):  # the load starts with the part
        run = simulator.replay(np.zeros(3), [0, 1], [(0.5, 0), (0.5, 0.1)], [True, fresh], h)[1]
        assert run[1] == pytest.approx(0.5 + 0.1 * h, rel=1e-3)


def effect_text(effect):
    """An effect as in the plugin's attribute."""
    found, _ = found_of("slide")
    return profile_of(found.joint, (effect,), 1.0).attributes()["effects"]


# --- what is wrong


def test_what_is_not_finite_ends_at_the_next_start():
    forces = np.zeros(30)
    forces[7] = np.inf
    starts = ([0, 20], [(0.5, 0.1), (0.4, 0.1)])
    before, after = joint().replay(forces, *starts, [True, False], 0.002)
    np.testing.assert_array_equal(np.isnan(after), (np.arange(30) >= 7) & (np.arange(30) < 20))
    np.testing.assert_array_equal(np.isnan(before), (np.arange(30) > 7) & (np.arange(30) < 20))
    alone = joint().replay(forces[20:], [0], [(0.4, 0.1)], [True], 0.002)
    np.testing.assert_array_equal([before[20:], after[20:]], alone)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"force": np.zeros((5, 1))}, "force must have"),
        ({"at": [[0]]}, "shapes"),
        ({"start": [(0, 0), (0, 0)]}, "shapes"),
        ({"start": [0.0]}, "shapes"),
        ({"fresh": []}, "shapes"),
        ({"at": [1]}, "begin with 0"),
        ({"at": [], "start": np.zeros((0, 2)), "fresh": []}, "begin with 0"),
        ({"at": [0, 0], "start": np.zeros((2, 2)), "fresh": [True, True]}, "increase"),
        ({"at": [0, 5], "start": np.zeros((2, 2)), "fresh": [True, True]}, "below"),
        ({"h": 0.0}, "h must be positive"),
    ],
)
def test_a_mistake_in_a_replay_is_told(changes, message):
    good = {"force": np.zeros(5), "at": [0], "start": [(0.5, 0)], "fresh": [True], "h": 0.002}
    assert len(joint().replay(**good)[1]) == 5
    with pytest.raises(ValueError, match=message):
        joint().replay(**good | changes)


def test_a_mistake_in_a_joint_is_told():
    with pytest.raises(ValueError, match='attribute "effects"'):
        joint("nonsense 3")
    with pytest.raises(ValueError, match="inertia must be positive"):
        joint(inertia=0.0)
    with pytest.raises(ValueError, match="increasing"):
        JointSimulator(1, 1, PLAIN, **BODY)


@pytest.mark.parametrize(
    ("solref", "solimp"),
    [("0.02 1", "0.9 0.95"), ("0.05 0.7", "0.8 0.9"), ("-100 -50", "0.95 0.99")],
)
def test_the_engines_own_friction_row_yields_as_in_the_engine(solref, solimp):
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="0.001" gravity="0 0 0"/>
      <worldbody><body>
        <joint name="j" type="slide" axis="1 0 0" frictionloss="0.2" solreffriction="{solref}"
               solimpfriction="{solimp}"/>
        <geom size="0.1" mass="0.14"/>
      </body></worldbody></mujoco>""")
    own = friction_row(tuple(model.dof_solref[0]), tuple(model.dof_solimp[0]), 1e-3)
    forces = 0.5 * np.sin(5e-3 * np.arange(4000))
    forces[2000:2600] = 0.1  # it all but rests
    friction = "0 1 | 0 1 | 0.2 0.2"
    body = BODY | {"inertia": 0.14}
    alone = JointSimulator(
        -5, 5, ["", "sum", friction, "sum", "", "sum", ""], **body, friction_row=own
    )
    _, after = alone.replay(forces, [0], [(0.0, 0.0)], [True], 1e-3)
    expected = engine(model, 0.0, forces)[1:]
    np.testing.assert_allclose(after, expected, rtol=0, atol=1e-10)
    assert np.ptp(expected[2200:2590]) > 1e-4  # it creeps


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast"])
@pytest.mark.parametrize("damping", [0.02, 2.0, 200.0])
def test_without_the_plugin_damping_acts_after_the_rows_as_in_the_engine(integrator, damping):
    """A slide that is pushed to and fro between its ends, which throw it back a little."""
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="0.002" gravity="0 0 0" integrator="{integrator}"/>
      <worldbody><body>
        <joint name="j" type="slide" axis="1 0 0" frictionloss="0.2" damping="{damping}"
               range="-0.3 0.3" solreflimit="0.02 0.3"/>
        <geom size="0.1" mass="0.14"/>
      </body></worldbody></mujoco>""")
    own = friction_row(tuple(model.dof_solref[0]), tuple(model.dof_solimp[0]), 2e-3)
    forces = (1.5 + 3.0 * damping) * np.cos(8e-3 * np.arange(3000))
    texts = ["", "sum", "0 1 | 0 1 | 0.2 0.2", "sum", f"0 1 | 0 1 | {damping} {damping}", "sum", ""]
    body = BODY | {"inertia": 0.14, "solref": model.jnt_solref[0], "solimp": model.jnt_solimp[0]}
    alone = JointSimulator(-0.3, 0.3, texts, **body, friction_row=own)
    _, after = alone.replay(forces, [0], [(0.0, 0.0)], [True], 2e-3)
    expected = engine(model, 0.0, forces)[1:]
    np.testing.assert_allclose(after, expected, rtol=0, atol=1e-5)
    assert expected.min() < -0.3 and expected.max() > 0.3


# --- steps of second order


def far_off(h, exact, v, force, texts=PLAIN, **scheme):
    """How far a joint of 1 kg is from where it is after 0.6 s; its start is half a step back."""
    n = round(0.6 / h)
    alone = JointSimulator(-5, 5, texts, **BODY, **scheme)
    forces = np.full(n, force)
    _, after = alone.replay(forces, [0], [(0.0, v - 0.5 * h * exact.first)], [True], h)
    return abs(after[-1] - exact.last)


class Damped:
    """1 kg with a damping of 4 N s/m, from 1 m/s, under 2 N."""

    first = 2 - 4 * 1.0
    last = 0.5 * 0.6 + (1 - 0.5) / 4 * (1 - np.exp(-4 * 0.6))
    texts = ("", "sum", "", "sum", "0 1 | 0 1 | 4 4", "sum", "")


class Turning:
    """1 kg with a friction of 1 N, from 1 m/s, under -3 N: it turns after 0.25 s."""

    first = -4.0
    last = 0.125 - 0.5 * 2 * 0.35**2
    texts = ("", "sum", "0 1 | 0 1 | 1 1", "sum", "", "sum", "")


@pytest.mark.parametrize(("exact", "force"), [(Damped, 2.0), (Turning, -3.0)])
def test_steps_of_second_order_are_nearer_to_the_law(exact, force):
    """At steps that no turn falls upon; a third of them leaves some ninth, of the engine's a third.
    The friction row yields a little."""
    h = 0.6 / 43
    tried = exact, 1.0, force, exact.texts
    engines, own = (far_off(h, *tried, trapezoidal=way) for way in (False, True))
    assert own < engines / 8
    assert far_off(h / 3, *tried, trapezoidal=True) < max(own / 4, 2e-6)
    assert far_off(h / 3, *tried) > engines / 6


def test_steps_of_second_order_damp_no_joint_beyond_rest():
    stiff = ("", "sum", "", "sum", "0 1 | 0 1 | 1e5 1e5", "sum", "")
    alone = JointSimulator(-5, 5, stiff, **BODY, trapezoidal=True)
    _, after = alone.replay(np.zeros(200), [0], [(0.0, 1.0)], [True], 0.01)
    assert np.all(np.diff(after) >= 0) and np.ptp(after) < 1e-3
