"""A small sample of tests/benchmarks/hidden.py: what is named on joints that nobody has seen."""

import secrets
from dataclasses import replace

import numpy as np
import pytest
from hidden import said
from hidden_cases import case_of, dice, job_of, mixed, read, spread
from hidden_families import by_effect
from hidden_figures import fine, told
from hidden_floor import true_error
from hidden_model import true_profile

from joda.diagnosis.adding import add_effect, error
from joda.diagnosis.split import parted
from joda.hidden import EFFECTS, FAMILIES, draw
from joda.measured.misfit import rms

RELIABLE = (
    "constant_friction_hinge",
    "constant_damping_hinge",
    "quadratic_damping",
    "direction_dependent_damping",
    "spring_return_to_high_end",
    "detent_internal",
    "load_dependent_friction",
)
RUNS = range(0, 8, 2)
"""Half of the runs, in half of the time."""


@pytest.mark.long
def test_of_a_null_and_two_effects_at_most_one_is_wrong():
    master = secrets.randbits(32)
    print("master seed", master)
    effects = dice(master, "reliable").choice(RELIABLE, 2, replace=False)
    hidden = [replace(job_of(master, "forced", k), effect=str(e)) for k, e in enumerate(effects)]
    rows = []
    for job in [job_of(master, "none", 0), *hidden]:
        case = case_of(job)
        seal = {"effect": case.seal["effect"], "seal": case.seal}
        rows.append(vars(job) | seal | said(read(case)[0].changed(runs=RUNS)))
        print(told(rows[-1]))
    assert sum(map(fine, rows)) >= 2


def test_the_true_model_misses_a_null_by_the_noise():
    case = draw(2, None, forced=False)
    assert true_error(case) == pytest.approx(case.noise, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(2))
def test_in_mujoco_the_true_profile_moves_as_in_the_simulator(number):
    """Effects of the plugin against laws, steps and friction that were written apart from it."""
    seed = secrets.randbits(31)
    effect = EFFECTS[seed % len(EFFECTS)]
    print("seed", seed, effect)
    case = draw(seed, effect)
    _, held_out = read(case)
    true = held_out.changed(true_profile(case, held_out.profile))
    pairs = zip(true.runs, true.sigma, strict=True)
    missed = [rms(w.misfit) for run, sigma in pairs for w in true.replayer.segments(run, sigma)]
    # a half, as windows that end in a knock, or go over a barrier or just not, tell of luck
    part = 0.25 if effect == "end_stop_restitution" else 0.5
    assert np.quantile(missed, part) < 3 * case.noise


@pytest.mark.slow
def test_the_true_memory_makes_the_error_small():
    case = draw(1, "backlash")
    assert true_error(case) < 1.5 * case.noise


def test_a_master_seed_gives_the_same_jobs_and_every_effect_in_turn():
    jobs = [job_of(5, "hard", k) for k in range(9)]
    assert jobs == [job_of(5, "hard", k) for k in range(9)]
    assert len({job.effect for job in jobs[:3]}) == 3
    assert job_of(6, "hard", 0).seed != jobs[0].seed


def test_the_families_line_has_every_effect_of_each_and_is_judged_by_the_seal(capsys):
    jobs = [job_of(5, "families", k, "switches") for k in range(len(spread("switches")))]
    hidden = {(job.effect, job.forced) for job in jobs}
    assert {(name, True) for name in (None, *EFFECTS, *FAMILIES["switches"].uncatalogued)} <= hidden
    assert ("backlash", False) not in hidden and ("detent_internal", False) in hidden
    said = {"probability": 0.95, "indistinguishable_from": []}
    rows = []
    for job in jobs:
        known = job.effect in EFFECTS
        row = vars(job) | {"verdict": "missing_effect" if known else "unexplained", "unseen": 1.2}
        row |= {"named": [said | {"effect": job.effect}] if known else [], "unseen_before": 9.0}
        seal = {"in_catalogue": known} if job.effect else {}
        rows.append(row | {"seal": {"effect": job.effect, **seal}})
    by_effect(rows)
    out = capsys.readouterr().out
    assert "| detent_internal | 1/1, 1/1 |" in out
    assert "| backlash | 1/1, – |" in out
    assert "| no catalogue: unexplained | 7/7 |" in out
    assert "| nothing: adequate | 0/2 |" in out


@pytest.mark.long
def test_a_curve_gets_as_many_control_points_as_the_data_support():
    """A template's five control points make no over-centre spring."""
    seed = secrets.randbits(31)
    print("seed", seed)
    case = draw(seed, "bistable_mechanism")
    train, held_out = read(case)
    added_effect = add_effect(*parted(train), "bistable_mechanism")
    parts = added_effect.profile.channels.conservative.components
    assert added_effect.after.window < max(0.3 * added_effect.before.window, 1.5 * case.noise)
    unseen = error(held_out, added_effect.profile).window
    assert unseen < max(0.3 * error(held_out).window, 1.5 * case.noise)
    assert max(len(part.x) for part in parts) > 5


@pytest.mark.parametrize(
    ("hides", "forced"), [("nothing", True), ("effect", False), ("outside", True)]
)
def test_cases_of_all_families_are_mixed(hides, forced):
    jobs = mixed(5, hides, forced, 12)
    assert len({job.family for job in jobs[:4]}) == 4
    beyond = [job.effect in FAMILIES[job.family].uncatalogued for job in jobs]
    assert all(beyond) if hides == "outside" else not any(beyond)
    assert all((job.effect is None) == (hides == "nothing") for job in jobs)
    assert {job.forced for job in jobs} == ({True, False} if hides == "nothing" else {forced})
    assert len({(job.family, job.number) for job in jobs}) == len(jobs) == 12
    assert jobs == mixed(5, hides, forced, 12) != mixed(6, hides, forced, 12)
