"""Laws of no catalogue are learned from runs: planted truths are recovered, and noise is not."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from gauging import SPAN, gauged

from joda import add
from joda.commands.add import sentences
from joda.commands.hidden_effect import _judged_law
from joda.diagnosis.adding import error
from joda.diagnosis.learning.ensemble import Number, drawn, of_memory
from joda.diagnosis.learning.fitting import Learner
from joda.diagnosis.learning.formula import _period, _sets, _solved
from joda.diagnosis.learning.gaussian_process import modes_of, nearness
from joda.diagnosis.learning.law import Law, Terms
from joda.diagnosis.learning.library import of_speed
from joda.diagnosis.learning.nearest import Nearest
from joda.diagnosis.learning.report import Account, account
from joda.diagnosis.learning.report import sentences as account_sentences
from joda.diagnosis.learning.term_selection import Learning, learn
from joda.diagnosis.phrases import named
from joda.diagnosis.split import parted
from joda.hidden import draw, write
from joda.measured.reading import read_measured


def diagnosed(verdict, *effects):
    """A diagnosis, as far as the demo looks at it."""
    return SimpleNamespace(
        verdict=verdict,
        effects=[SimpleNamespace(effect=effect, name=named(effect)) for effect in effects],
    )


def planted(folder, effect):
    """A fresh joint that hides a law: the case, its runs to learn from, and those nobody sees."""
    case = draw(int(np.random.default_rng().integers(1_000_000)), effect)
    write(case, folder)
    train, unseen = (
        read_measured(folder / "model.xml", case.joint, [folder / run.name for run in runs])
        for runs in (case.train, case.held_out)
    )
    return case, train, unseen


def learned(measured, terms):
    """A law with some terms, fitted to three quarters of the runs."""
    train, held = parted(measured)
    return Learning(train, held, lambda what: None).tried(terms).learned


def numbers(found):
    """Of the law, without the model's own factors."""
    return found.fit.x[-len(found.law.unknowns.mean) :]


def test_modes_have_the_covariance_they_are_made_of():
    covariance = nearness(np.linspace(0, 1, 40), 0.2)
    L = modes_of(covariance)
    assert L.shape[1] < 20
    assert np.abs(L @ L.T - covariance).max() < 0.01


@pytest.mark.sweep(1, "learned")
@pytest.mark.flaky(reruns=3)
def test_a_drag_by_the_root_of_the_speed_is_learned(tmp_path):
    """In one of three draws another bend does as well as the root, and the formula has that."""
    case, measured, unseen = planted(tmp_path, "square_root_damping")
    (law,) = case.truth.hidden
    found = learned(measured, Terms(speed=True))
    profile, v = found.profile, found.law.speeds[-6:-1]
    rubs, drag = (
        sum(c.y[0] for c in getattr(profile.channels, name).components if "native" in c.label)
        for name in ("friction", "damping")
    )
    resists = rubs + drag * v + found.law.resistance(numbers(found))[-6:-1]
    true = case.truth.friction + case.truth.damping * v + law.size * np.sqrt(v)
    assert resists == pytest.approx(true, rel=0.1)
    assert error(unseen, profile).window < 0.3 * error(unseen).window
    train, held = parted(measured)
    told = account(train, held, found, error(held, profile).window)
    assert told.position is None
    if told.formula:  # where two terms are as good as a root, none is stable
        resists = [one for one in told.formula.terms if one.term == "sign(v) √|v|"]
        assert [-one.factor for one in resists] == pytest.approx([law.size], rel=0.3)
    at, error_there = np.array(told.speed.at), np.array(told.speed.error)
    assert np.all(error_there[np.abs(at) > 0.05 * at.max()] > 0)


@pytest.mark.sweep(1, "learned")
def test_a_period_over_position_is_learned(tmp_path):
    case, measured, _ = planted(tmp_path, "cogging")
    (law,) = case.truth.hidden
    found = learned(measured, Terms(position=0.025))
    s = found.law.places[3:-3]
    true = law.force(s, s, 0 * s, 0 * s)
    force = found.law.force_at(numbers(found))[3:-3]
    assert np.sqrt(np.mean((force - true) ** 2)) < 0.35 * np.sqrt(np.mean(true**2))


@pytest.mark.sweep(1, "learned")
def test_a_spring_whose_end_follows_is_learned(tmp_path):
    case, measured, unseen = planted(tmp_path, "maxwell_relaxation")
    (law,) = case.truth.hidden
    found = learned(measured, Terms(memory="position", time=0.12 * np.ptp(measured.runs[0].time)))
    assert found.law.gain(numbers(found)) == pytest.approx(law.stiffness, rel=0.15)
    assert found.law.time(numbers(found)) == pytest.approx(law.time, rel=0.3)
    draws, h = drawn(Learner(measured), found), found.estimator.segments.h
    told = of_memory(found.law, numbers(found), draws, h)
    for number, right in zip(told, (law.stiffness, law.time), strict=True):
        assert abs(number.value - right) < 4 * number.error
    assert error(unseen, found.profile).window < 0.3 * error(unseen).window


@pytest.mark.sweep(1, "learned")
def test_what_falls_as_a_joint_warms_up_is_learned_in_part(tmp_path):
    _, measured, unseen = planted(tmp_path, "warming_up")
    longest = max(np.ptp(run.time) for run in measured.runs)
    found = learned(measured, Terms(speed=True, memory="speed", time=0.3 * longest))
    assert found.law.gain(numbers(found)) < 0
    assert error(unseen, found.profile).window < 0.7 * error(unseen).window


@pytest.mark.sweep(1, "learned")
def test_outside_what_was_visited_there_is_no_law(tmp_path):
    _, measured, _ = planted(tmp_path, "cogging")
    found = learned(measured, Terms(position=0.12))
    a, b = found.law.interval
    component = found.profile.channels.conservative.components[-1]
    assert component.label == "learned_force"
    assert component.interval == (a, b)
    lo, hi = measured.profile.joint.range
    s = (np.concatenate([run.position for run in measured.runs]) - lo) / (hi - lo)
    assert s.min() - 0.02 <= a
    assert b <= s.max() + 0.02


@pytest.mark.sweep(1, "learned")
def test_where_nothing_is_missing_nothing_is_learned(tmp_path):
    _, measured, _ = planted(tmp_path, None)
    mended, law = learn(*parted(measured))
    assert law is None
    assert mended.reason
    assert mended.profile == measured.profile


@pytest.mark.long
def test_the_command_adds_it(tmp_path):
    case, _, unseen = planted(tmp_path, "square_root_damping")
    said = tmp_path / "said.json"
    said.write_text(json.dumps({"verdict": "unexplained", "effects": []}))
    runs = [tmp_path / run.name for run in case.train]
    model, new = tmp_path / "model.xml", tmp_path / "new.xml"
    found = add(model, case.joint, said, runs, new, effect="learned_force")
    assert found.added
    told = sentences(found)
    assert told[0].startswith("Added a law learned from the runs.")
    assert told[1].startswith("Learned: ")
    assert {"position", "speed", "memory"} <= json.loads(json.dumps(found.as_json()))[
        "learned"
    ].keys()
    held = [tmp_path / run.name for run in case.held_out]
    after = read_measured(new, case.joint, held)
    assert error(after).window < 0.5 * error(unseen).window


@pytest.mark.slow
def test_a_wave_is_learned_from_a_curve(tmp_path):
    periods = np.random.default_rng().uniform(3, 6)
    gauged(tmp_path, lambda s, way: 0.6 * np.sin(2 * np.pi * periods * s), noise=0.02)
    said, new = tmp_path / "said.json", tmp_path / "new.xml"
    said.write_text(json.dumps({"verdict": "unexplained", "effects": []}))
    curve = [tmp_path / "curve.csv"]
    found = add(tmp_path / "model.xml", "door", said, curve, new, effect="learned_force")
    assert found.after.window < 0.1 * found.before.window + 0.04
    sine, cosine = found.learned.formula.terms
    assert np.hypot(sine.factor, cosine.factor) == pytest.approx(0.6, rel=0.05)
    n = float(sine.term.removeprefix("sin(").removesuffix(" q)"))
    assert n == pytest.approx(2 * np.pi * periods / SPAN, rel=0.02)


def test_the_root_of_a_speed_is_told_from_all_other_terms():
    v = np.linspace(0.02, 2.0, 20)
    singles = [(one,) for one in of_speed(2.0)]
    best = _sets(singles, v, 0.3 * np.sqrt(v), np.full(20, 0.005))[0][0]
    assert [one.text for one in best] == ["sign(v) √|v|"]
    assert _solved(best, v, 0.3 * np.sqrt(v), np.full(20, 0.005))[1] == pytest.approx([0.3])


def test_the_period_of_a_wave_is_found():
    q, n = np.linspace(-0.3, 0.9, 90), np.random.default_rng().uniform(12, 60)
    assert _period(q, 2 * np.sin(n * q + 1) + 0.5, 0.03) == pytest.approx((n,), rel=1e-3)


def test_a_memory_that_runs_tell_nothing_of_lasts_no_longer_than_a_law_may():
    law = Law(Terms(memory="position", time=0.5), (0.0, 1.0), 1.0, 1.0, 1.0)
    draws = np.random.default_rng().normal(0, 10, (32, 2))
    time = of_memory(law, np.zeros(2), draws, 0.0)[1]
    longest = 0.5 * np.exp(law.unknowns.high[-1])
    assert time.value == 0.5
    assert 0.5 < time.error < longest


def test_errors_are_told_by_one_digit():
    assert str(Number(0.8547, 61.3)) == "0.855 ± 60"
    assert str(Number(13.97, 0.0412)) == "14 ± 0.04"


@pytest.mark.parametrize("times", [0.98, 3.4])
def test_the_nearest_known_effect_is_told_with_what_it_misses(times):
    none = dict.fromkeys(("position", "speed", "gain", "time", "formula", "next_experiment"))
    nearest = Nearest("constant_damping_hinge", named("constant_damping_hinge"), times)
    told = Account(**none, along=False, memory="none", nearest=nearest, unit="rad", force_unit="")
    last = account_sentences(told)[-1]
    assert last.startswith("Nearest of what has a name: viscous damping; with it")
    assert last.endswith(f"the held-out error is {times:.2g} times that of the law.")


def test_the_demo_judges_what_was_learned():
    none = diagnosed("unexplained")
    half, tenth, one = (SimpleNamespace(rmse_window=error) for error in (0.5, 0.1, 1.0))
    told, right = _judged_law(none, {}, one, tenth)
    assert (told, right) == ("What was learned leaves 10 % of the error on unseen runs.", True)
    assert not _judged_law(none, {}, one, half)[1]
    assert _judged_law(none, {}, one, None) == ("Missed: nothing was learned.", False)
    told, right = _judged_law(diagnosed("missing_effect", "backlash"), {}, one, tenth)
    assert told.startswith("It has no name, and was taken for play between")
    assert not right
