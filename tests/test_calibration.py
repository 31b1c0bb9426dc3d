"""Numbers of a joint and of its measurement that are off are found, and are no effects."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hidden_cases import read

import joda
from joda import JodaError
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.calibration import Calibrator
from joda.diagnosis.correction_report import correction_of
from joda.diagnosis.hypothesis_fits import in_place_of_a_factor
from joda.diagnosis.verdict import diagnosed
from joda.estimation.nuisance import USUAL, nuisances_of
from joda.hidden import draw
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.measured.trust import read_trust, trusting

ARM = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody><body>
    <joint name="arm" type="hinge" axis="0 1 0" limited="true" range="-4 4" damping="0.1"
           frictionloss="0.15" solreffriction="0.002 1" solimpfriction="0.99 0.9999 0.001 0.5 2"/>
    <inertial pos="0.3 0 0" mass="{mass}" diaginertia="{own} {own} {own}"/>
  </body></worldbody>
</mujoco>
"""
SIGMA = 5e-4


def arm(mass=1.0):
    """The arm, all of whose mass and inertia is so many times as large."""
    return ARM.format(mass=0.5 * mass, own=0.02 * mass)


def logged(
    folder, rng, scale=1.0, offset=0.0, delay=0.0, zero=0.0, extra=lambda q, v: 0.0, noise=SIGMA
):
    """Four runs of 2 s of the arm in MuJoCo at 200 Hz, with what is wrong of what is logged."""
    model = mujoco.MjModel.from_xml_string(arm())
    ahead, names = round(delay / model.opt.timestep), []
    while len(names) < 4:
        data, rows = mujoco.MjData(model), []
        data.qpos[0] = rng.uniform(-1.5, 1.5)
        rates, phases = rng.uniform(2, 7, 3), rng.uniform(0, 6, 3)
        sizes = rng.uniform(0.5, 1.2, 3)
        held, stiff = data.qpos[0], 1.5
        for _ in range(2000 + ahead):
            push = float(sizes @ np.sin(rates * data.time + phases))
            force = push - stiff * (data.qpos[0] - held)
            rows.append((data.time, data.qpos[0], force))
            data.qfrc_applied[0] = force + extra(data.qpos[0], data.qvel[0])
            mujoco.mj_step(model, data)
        time, position, force = np.array(rows).T
        if np.abs(position).max() > 3.7:  # a knock at an end is no number's
            continue
        later = force[ahead:][:2000:5]
        at = np.arange(0, 2000, 5)
        seen = position[at] + zero + noise * rng.standard_normal(len(at))
        names.append(folder / f"run{len(names)}.csv")
        write_run(
            names[-1], Run(names[-1].name, time[at], seen, None, (later - offset) / scale, True)
        )
    return names


def found_of(folder, rng, trust=None, mass=1.0, beside=False, **wrong):
    """What is found of runs, with a model whose mass is off by a factor."""
    runs = logged(folder, rng, **wrong)
    (folder / "arm.xml").write_text(arm(1 / mass))
    measured = read_measured(folder / "arm.xml", "arm", runs)
    measured = measured.trusting(trusting(trust or {}))
    return measured, Calibrator(measured).numbers(fit_baseline(measured), beside)


def check(measured, found, name, right):
    """That this number is found, within its errors, or told as an alternative of what is."""
    assert found is not None and found.alone
    told = {one.parameter: one for one in found.corrections(measured)}
    others = {other: x for one in found.others for other, x in one}
    if name in told:
        one = told.pop(name)
        value = one.value if one.factor is None else one.factor
        assert abs(value - right) < 4 * one.error + 0.01 * abs(right)
    else:
        assert others[name] == pytest.approx(right, rel=0.05)
        told.popitem()
    assert not told


@pytest.mark.slow
def test_a_mass_that_is_off_is_told(tmp_path, rng):
    factor = float(rng.choice([rng.uniform(0.5, 0.75), rng.uniform(1.3, 1.6)]))
    check(*found_of(tmp_path, rng, mass=factor), "mass", factor)


@pytest.mark.sweep(2, "one number")
def test_a_force_of_another_scale_is_told(tmp_path, rng):
    factor = float(rng.choice([rng.uniform(0.6, 0.8), rng.uniform(1.25, 1.5)]))
    check(*found_of(tmp_path, rng, scale=factor), "force_scale", factor)


@pytest.mark.sweep(2, "one number")
def test_a_late_log_is_told(tmp_path, rng):
    late = round(float(rng.uniform(0.005, 0.04)), 3)
    check(*found_of(tmp_path, rng, delay=late), "time_delay", late)


@pytest.mark.slow
def test_what_is_smaller_than_the_noise_is_told_too(tmp_path, rng):
    late = round(float(rng.uniform(0.010, 0.014)), 3)
    measured, found = found_of(tmp_path, rng, beside=True, delay=late, noise=20 * SIGMA)
    assert found is not None and found.names == ("time_delay",)
    (told,) = found.corrections(measured)
    assert abs(told.value - late) < 4 * told.error
    assert fit_baseline(measured).fit.loss < 1.8 * found.loss  # most of what is missed is noise


@pytest.mark.sweep(2, "one number")
def test_an_encoders_zero_is_told(tmp_path, rng):
    zero = float(rng.choice([-1, 1]) * rng.uniform(0.04, 0.15))
    check(*found_of(tmp_path, rng, zero=zero), "position_offset", zero)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [446043723, 1545949229])
def test_a_zero_is_told_by_where_an_end_stopped_the_joint(seed):
    """Of a drawer whose force nowhere depends on the position: until the end is where the joint was
    stopped, a small step of the zero changes nothing."""
    case = draw(seed, None, forced=True, family="field")
    measured, right = read(case)[0], case.seal["wrong"]["position_offset"]
    found = Calibrator(measured).numbers(fit_baseline(measured), beside=True)
    assert found is not None
    told = {one.parameter: one for one in found.corrections(measured)}["position_offset"]
    assert abs(told.value - right) < 3 * told.error < 0.2 * abs(right)


@pytest.mark.slow
def test_a_zero_that_was_held_first_is_exchanged_for_what_stood_in_for_it(seed=1801374956):
    """A constant force stands in for the zero of a joint that gravity pulls, but worse."""
    case = draw(seed, None, forced=True, family="field")
    measured, right = read(case)[0], case.seal["wrong"]["position_offset"]
    found = Calibrator(measured).numbers(fit_baseline(measured))
    assert found is not None and found.names == ("position_offset",)
    assert found.fit.x[-1] == pytest.approx(right, rel=0.05)


@pytest.mark.slow
@pytest.mark.sweep(2, "one number")
def test_an_offset_of_the_force_is_told(tmp_path, rng):
    offset = float(rng.choice([-1, 1]) * rng.uniform(0.05, 0.12))
    measured, found = found_of(tmp_path, rng, offset=offset)
    check(measured, found, "force_offset", offset)
    said = diagnosed(measured).diagnosis
    assert said.verdict == "adequate"
    if "force_offset" in {one.parameter for one in said.corrections}:  # an effect would do the same
        assert "A constant force that the model lacks would do the same, and so" in said.summary
        assert "No effect is missing" not in said.summary
        assert not said.summary.startswith("The model is adequate")


@pytest.mark.slow
def test_an_offset_of_a_tenth_of_the_strongest_push_is_one():
    """Beside a mass that is off: neither a spring nor a constant force."""
    case = draw(21264798, None, family="field")
    found = diagnosed(read(case)[0]).diagnosis
    told = {one.parameter: one for one in found.corrections}
    offset, right = told["force_offset"], case.seal["wrong"]["force_offset"]
    assert found.verdict == "adequate" and abs(offset.value - right) < 2 * offset.error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "effect"),
    [
        (1759789885, "gravity_offset"),
        (1573506733, "spring_loaded_snap_detent_to_high_end"),
        (1200207190, "spring_return_to_high_end"),
        (616137927, "constant_negative_conservative_hinge"),
    ],
)
def test_an_effect_is_found_with_all_numbers_free_beside_it(seed, effect):
    """What was said without: a mechanism with two stable sides, in place of a tilt and an offset;
    nothing that explains all, of a latch; no effect but four numbers, of a spring and a mass; a
    force over the rest of the range and an offset, of one over its part."""
    case = draw(seed, effect, family="field")
    found = diagnosed(read(case)[0]).diagnosis
    wrong = case.seal.get("wrong", {})
    told = {one.parameter: one for one in found.corrections}
    assert found.effects[0].effect == effect and found.effects[0].probability > 0.8
    if "mass" in wrong or "force_scale" in wrong:
        heavier = wrong.get("mass", 1.0) / wrong.get("force_scale", 1.0)
        assert abs(told["mass"].factor - heavier) < 3 * told["mass"].error
    assert ("force_offset" in told) == (seed == 1759789885)


@pytest.mark.slow
def test_a_constant_force_may_be_an_offset_also_where_it_is_too_strong_for_most(tmp_path, rng):
    measured, _ = found_of(tmp_path, rng, offset=float(rng.choice([-1, 1]) * 0.6))
    said = diagnosed(measured).diagnosis
    assert said.effects[0].effect.startswith("constant_") and said.effects[0].interval == (0, 1)
    assert "An offset of the recorded force would do the same" in said.summary


@pytest.mark.slow
def test_where_only_an_offset_may_be_off_a_force_is_named_or_that(tmp_path, rng):
    trust = dict.fromkeys(set(USUAL) - {"force_offset"}, 0.0)
    measured, _ = found_of(tmp_path, rng, trust, offset=0.6)
    said = diagnosed(measured).diagnosis
    told = {one.parameter for one in said.corrections} | {one.effect for one in said.effects}
    assert told & {"force_offset", "constant_positive_conservative_hinge", "gravity_offset"}


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("time_delay", -0.018, "The recorded force acts 18 ± 1e+02 ms earlier."),
        ("time_delay", 0.018, "The recorded force acts 18 ± 1e+02 ms later."),
        ("position_offset", -0.05, "The recorded position is 0.05 ± 0.1 rad too small."),
        ("force_offset", -0.1, "The force is 0.1 ± 0.1 N·m less than what was recorded."),
        ("force_offset", -0.1, " the same, and so would more friction in one direction than in"),
        ("force_offset", 0.2, "A constant force that the model lacks would do the same."),
    ],
)
def test_a_number_is_told_by_its_sign_and_with_what_is_the_same(tmp_path, rng, name, value, told):
    """An offset that is less than the friction, of 0.15 N·m, may be a friction of one direction."""
    (tmp_path / "arm.xml").write_text(arm())
    measured = read_measured(tmp_path / "arm.xml", "arm", logged(tmp_path, rng)[:1])
    assert told in correction_of(measured, name, value, 0.1, []).explanation


@pytest.mark.parametrize(("pushed", "share"), [(1.0, 0.1), (3.0, 0.05), (20.0, 0.25)])
def test_how_far_off_a_forces_offset_may_be(tmp_path, pushed, share):
    """A tenth of what was recorded, or 5 % of the strongest push; but what is about all that was
    recorded was held against, however strong a push besides."""
    time, force = np.arange(400) * 0.005, np.full(400, -1.0)
    force[7] = pushed
    path = tmp_path / "run.csv"
    write_run(path, Run(path.name, time, 0.1 * np.sin(time), None, force, True))
    (tmp_path / "arm.xml").write_text(arm())
    measured = read_measured(tmp_path / "arm.xml", "arm", [path])
    numbers = nuisances_of(measured, fit_baseline(measured).base)
    width = dict(zip(numbers.names, numbers.prior_stds, strict=True))["force_offset"]
    mean = np.sqrt(np.mean(force**2))
    assert width == pytest.approx(share * (pushed if share == 0.05 else mean), rel=1e-3)


@pytest.mark.slow
def test_of_runs_of_which_nothing_is_wrong_nothing_is_told(tmp_path, rng):
    assert found_of(tmp_path, rng)[1] is None


@pytest.mark.slow
def test_a_force_along_the_way_is_not_explained_by_numbers(tmp_path, rng):
    place = rng.uniform(-0.5, 0.5)
    _, found = found_of(
        tmp_path, rng, extra=lambda q, v: 0.5 * np.sin(6 * (q - place)) * (abs(q - place) < 0.5)
    )
    assert found is None or not found.alone


@pytest.mark.slow
def test_a_friction_of_one_direction_is_no_offset_and_no_mass(tmp_path, rng):
    """With a damping that is off it is nearly the same as a constant force, a mass, the scale of
    the force and another friction, three numbers that are off for one effect."""
    measured, found = found_of(
        tmp_path, rng, extra=lambda q, v: -0.3 * np.tanh(np.maximum(v, 0) / 0.02) - 0.02 * v
    )
    assert found is None or not found.alone
    said = diagnosed(measured).diagnosis
    assert "asymmetric_friction" in {one.effect for one in said.effects}
    assert not {one.parameter for one in said.corrections} & {"mass", "force_scale", "force_offset"}


@pytest.mark.slow
def test_a_number_that_is_trusted_fully_stays(tmp_path, rng):
    trust = {"mass": 0.0, "force_scale": 0.0}
    measured, found = found_of(tmp_path, rng, trust, mass=1.4)
    every = nuisances_of(measured, fit_baseline(measured).base)
    assert not {"mass", "force_scale"} & set(every.names)
    assert found is None or not {"mass", "force_scale"} & set(found.names)


@pytest.mark.slow
def test_widths_are_those_told(tmp_path, rng):
    trust = {"mass": 0.05, "center_of_mass": 0.2, "frictionloss": 0.01, "damping": 0.0}
    measured, _ = found_of(tmp_path, rng, trust)
    base = fit_baseline(measured).base
    every = nuisances_of(measured, base)
    widths = dict(zip(every.names, every.prior_stds, strict=True))
    assert (widths["mass"], widths["center_of_mass"]) == (0.05, 0.2)
    strengths = dict(zip((name for name, _ in base.places), base.unknowns.prior_std, strict=False))
    assert strengths["friction"] == 0.01 and strengths["damping"] < 1e-5


@pytest.mark.long
def test_a_joint_of_the_field_with_wrong_numbers_lacks_no_effect():
    rng = np.random.default_rng()
    while not (case := draw(int(rng.integers(2**31)), None, family="field")).seal.get("wrong"):
        pass
    print(case.seed, case.seal["wrong"])  # shown where the test fails
    measured, _ = read(case)
    found = Calibrator(measured).numbers(fit_baseline(measured))
    assert found is None or found.alone


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["ghost=1"], "trust: no number 'ghost'; there are mass, inertia"),
        (["mass=-1"], "trust: mass=-1 is no width; give a standard deviation"),
        (["mass=inf"], "trust: mass=inf is no width"),
        (["mass"], "--trust 'mass': give NAME=WIDTH, as in mass=0.05"),
        (["mass=much"], "--trust 'mass=much': give NAME=WIDTH"),
    ],
)
def test_trust_that_says_nothing_is_named(words, said):
    with pytest.raises(JodaError) as raised:
        trusting(read_trust(words))
    assert said in str(raised.value)


def test_trust_is_an_option_of_what_finds_and_mends(tmp_path, rng):
    run = logged(tmp_path, rng)[0]
    (tmp_path / "arm.xml").write_text(arm())
    with pytest.raises(JodaError, match="no number 'ghost'"):
        joda.diagnose(tmp_path / "arm.xml", "arm", [run], trust={"ghost": 1.0})
    with pytest.raises(JodaError, match="no number 'ghost'"):
        joda.improve(tmp_path / "arm.xml", "arm", [run], tmp_path / "new.xml", trust={"ghost": 1.0})


@pytest.mark.long
def test_improve_writes_what_is_wrong_and_compare_reads_it(tmp_path, rng):
    runs = logged(tmp_path, rng, offset=0.1, delay=0.02, zero=0.08)
    (tmp_path / "arm.xml").write_text(arm(1 / 1.4))
    *learnt, unseen = runs
    new = tmp_path / "new.xml"
    done = joda.improve(tmp_path / "arm.xml", "arm", learnt, new)
    assert done.corrections == tmp_path / "new.corrections.json"
    assert not any(step.effect for step in done.steps)
    heavier = mujoco.MjModel.from_xml_path(str(new)).body_mass[1]
    assert heavier == pytest.approx(0.5, rel=0.03)
    before = joda.compare(tmp_path / "arm.xml", "arm", [unseen]).rmse_window
    after = joda.compare(new, "arm", [unseen], corrections=done.corrections).rmse_window
    assert after < 2 * SIGMA < 0.2 * before


def test_a_strength_that_stands_in_for_an_effect_is_where_that_is_begun(tmp_path, rng):
    """Thrice the model's friction, of which no more than a half is usual: as it is given, with the
    friction that is missing in its place."""
    runs = logged(tmp_path, rng, extra=lambda q, v: -0.3 * np.tanh(v / 0.005))
    (tmp_path / "arm.xml").write_text(arm())
    baseline = fit_baseline(read_measured(tmp_path / "arm.xml", "arm", runs))
    estimator, base = baseline.estimator.coarser, baseline.base.coarser()
    own = estimator, base, baseline.initial_points[0]
    assert own[2].fit.x[0] == pytest.approx(3, rel=0.15)
    kinds = {}
    for one in baseline.hypotheses:
        kinds.setdefault(one.effect, one)
    friction = kinds["constant_friction_hinge"]
    (begin,) = in_place_of_a_factor(*own, friction)
    assert begin[0] == 1.0
    assert friction.magnitude(begin[base.count :]) == pytest.approx(0.3, rel=0.15)
    assert not in_place_of_a_factor(*own, kinds["gravity_offset"])
    near = replace(own[2], fit=replace(own[2].fit, x=base.unknowns.mean))
    assert not in_place_of_a_factor(*own[:2], near, friction)


@pytest.mark.long
def test_a_friction_and_an_offset_are_no_friction_of_one_direction(seed=44305711):
    """Which explains the runs alone as well as an offset does, but not as well as both."""
    case = draw(seed, "constant_friction_hinge", True, None, "field")
    found = diagnosed(read(case)[0]).diagnosis
    assert found.effects[0].effect == case.seal["effect"]
    (offset,) = [one for one in found.corrections if one.parameter == "force_offset"]
    assert abs(offset.value - case.seal["wrong"]["force_offset"]) < 2 * offset.error


@pytest.mark.long
def test_a_number_and_an_effect_that_hide_each_other_are_told_together(seed=286989642):
    """A delay beside which no effect explains the runs, nor the delay without that effect."""
    case = draw(seed, "constant_friction_hinge", True, None, "field")
    found = diagnosed(read(case)[0]).diagnosis
    assert found.effects[0].effect == case.seal["effect"] and found.effects[0].probability > 0.8
    late = next(one for one in found.corrections if one.parameter == "time_delay")
    assert abs(late.value - case.seal["wrong"]["time_delay"]) < 3 * late.error
