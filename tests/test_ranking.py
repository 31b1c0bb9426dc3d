"""How what may be missing is ranked, and when that is a verdict."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_cases import clear_case, read

from joda.commands.templates import templates
from joda.diagnosis import baseline as fits
from joda.diagnosis import search
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.hypotheses import hypotheses
from joda.diagnosis.hypotheses.base import unknowns_of
from joda.diagnosis.hypotheses.effects import KNOTS, from_effects
from joda.diagnosis.hypotheses.intervals import NARROWEST, ends
from joda.diagnosis.hypotheses.templates import WELLS
from joda.diagnosis.hypothesis_fits import beside, joined, price
from joda.diagnosis.ranking import evidence, hopeful, select
from joda.diagnosis.search import NARROWED, _shown_without_impacts, narrowed, rank
from joda.diagnosis.selection import Evidence, Selection, closer_counts, decide, pooled
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.verdict import diagnosed
from joda.effects import EndStopRestitution, QuadraticDamping
from joda.effects.guesses import Units
from joda.estimation.estimator import CAUCHY_SCALE
from joda.field import evaluate
from joda.hidden import EFFECTS, draw
from joda.profile import Channel, Joint, Profile

EFFECT = "quadratic_damping"
OTHERS = (
    *("direction_dependent_damping", "asymmetric_friction", "stribeck_friction"),
    *("gravity_offset", "spring_return_to_low_end", "added_inertia", "presliding_friction"),
)
UNITS = Units(
    force=1.0, speed=1.0, inertia=1.0, span=1.0, visited=(0.0, 1.0), friction=1.0, forced=True,
    weight=0.0, hinge=True,
)  # fmt: skip


@pytest.fixture(scope="module")
def shown():
    """Two runs of a joint, which show what its model lacks, and the model fitted to them."""
    while True:
        measured = read(clear_case(EFFECT))[0].changed(runs=[0, 4])
        if not (baseline := fit_baseline(measured)).only_noise:
            return measured, baseline


@pytest.fixture(scope="module")
def measured(shown):
    """A model that lacks an effect, two runs of the joint."""
    return shown[0]


@pytest.fixture(scope="module")
def baseline(shown):
    """The model fitted to them."""
    return shown[1]


@pytest.fixture(scope="module")
def progress():
    """What is done, of how much."""
    return []


@pytest.fixture(scope="module")
def ranked(baseline, progress):
    return rank(
        baseline, without(baseline), lambda done, total, what: progress.append((done, total))
    )


def without(baseline):
    """What is not tried."""
    return {h.effect for h in baseline.hypotheses} - {EFFECT, *OTHERS}


def error_of(baseline, found):
    """Standard error of an effect's last number, by the data alone."""
    make, unknowns = joined(baseline.base, found.hypothesis)
    wide = np.full(len(found.fit.x), 10.0)
    return np.sqrt(baseline.estimator.covariance(make, unknowns, found.fit, wide)[-1, -1])


def test_of_free_runs_a_play_has_a_load_behind_it():
    """Nothing pushes a handle there, but what lies behind the joint knocks all the same."""
    plain = Profile(joint=Joint(name="j", type="hinge", range=(0, 1), unit="rad"))
    for forced, sides in ((True, {"load", "motor"}), (False, {"motor"})):
        every = hypotheses(replace(UNITS, forced=forced), templates(), plain)
        plays = (h.write(plain, h.trials[0]) for h in every if h.effect == "backlash")
        assert {profile.effects[-1].side for profile in plays} == sides


@pytest.mark.slow
def test_what_is_left_rough_changes_nothing_of_the_best(baseline, ranked, monkeypatch):
    refined = []
    monkeypatch.setattr(search, "SEARCH", replace(search.SEARCH, noise_loss=0.0))
    monkeypatch.setattr(
        fits, "refined", lambda *args, make=fits.refined: refined.append(0) or make(*args)
    )
    whole = rank(baseline, without(baseline))
    assert len(refined) >= 1 + len(OTHERS)
    assert whole.candidates[0].hypothesis.effect == ranked.candidates[0].hypothesis.effect == EFFECT
    assert whole.candidates[0].fit.loss == pytest.approx(ranked.candidates[0].fit.loss, abs=1.0)
    assert whole.level == pytest.approx(ranked.level, rel=0.01)


@pytest.mark.slow
def test_where_the_model_leaves_only_noise_few_are_fitted_to_the_end(monkeypatch):
    refined, rng = [], np.random.default_rng()
    measured = read(draw(int(rng.integers(2**31)), None))[0].changed(runs=[0, 4])
    baseline = fit_baseline(replace(measured, sigma=tuple(1.2 * one for one in measured.sigma)))
    assert baseline.only_noise
    monkeypatch.setattr(
        fits, "refined", lambda *args, make=fits.refined: refined.append(0) or make(*args)
    )
    few, some = rank(baseline), len(refined)
    monkeypatch.setattr(search, "SEARCH", replace(search.SEARCH, rough_gain=-np.inf))
    whole = rank(baseline)
    assert some < (len(refined) - some) / 2
    assert select(few).verdict == select(whole).verdict == "adequate"
    assert evidence(whole).gain - evidence(few).gain < 20


@pytest.mark.parametrize("promising", [True, False])
def test_all_are_fitted_to_the_end_only_if_the_best_few_are_promising(
    baseline, ranked, promising, monkeypatch
):
    refined, asked = [], []
    monkeypatch.setattr(
        search, "SEARCH", replace(search.SEARCH, noise_loss=0.0)
    )  # else what is far off is left rough all the same
    monkeypatch.setattr(
        fits, "refined", lambda *args, make=fits.refined: refined.append(0) or make(*args)
    )
    found = rank(baseline, without(baseline), promising=lambda few: asked.append(few) or promising)
    assert len(asked[0].candidates) <= search.PERTURBED and hopeful(asked[0])
    assert (len(refined) > search.PERTURBED) == promising
    assert found.candidates[0].hypothesis.effect == ranked.candidates[0].hypothesis.effect


def test_what_no_effect_comes_near_gives_no_hope(ranked):
    estimator = ranked.baseline.estimator
    squares = 30.0 * estimator.segments.count
    loss = estimator.loss(squares)
    far = replace(ranked.baseline, fit=replace(ranked.baseline.fit, squares=squares, loss=loss))
    left = 0.9 * loss * ranked.n_effective / estimator.samples
    candidates = tuple(replace(one, score=left) for one in ranked.candidates)
    assert not hopeful(replace(ranked, baseline=far, candidates=candidates))


def test_progress_counts_and_never_exceeds_the_total(ranked, progress):
    assert [done for done, _ in progress] == list(range(1, len(progress) + 1))
    assert all(done <= total for done, total in progress)
    assert progress[-1][0] > 0.8 * progress[-1][1]


def test_the_best_are_fitted_to_longer_segments_from_where_they_were(measured, baseline, ranked):
    """There the others leave a larger part of what the true one does."""
    longer = fit_baseline(measured, 3 * baseline.estimator.segments.length, baseline.fit.x)
    closer = narrowed(longer, ranked)
    names = [one.hypothesis.effect for one in ranked.candidates]
    assert {one.hypothesis.effect for one in closer.candidates} <= set(names[:NARROWED])
    assert closer.candidates[0].hypothesis.effect == EFFECT
    first, then = (
        (one.baseline, next(c for c in one.candidates if c.hypothesis.effect == EFFECT))
        for one in (ranked, closer)
    )
    (before,), (after,) = first[1].x, then[1].x
    assert abs(after - before) < 3 * np.hypot(error_of(*first), error_of(*then))
    assert after == pytest.approx(before, rel=0.3)
    assert len(longer.estimator.segments.at) < len(baseline.estimator.segments.at)


def test_ends_are_asked_last_where_segments_without_knocks_tell_of_an_effect(baseline, ranked):
    noise = float(baseline.estimator.samples)

    def tells(without, with_it):
        model = replace(baseline, fit=replace(baseline.fit, loss=without))
        best = [replace(one, fit=replace(one.fit, loss=with_it)) for one in ranked.candidates]
        return _shown_without_impacts(model, best)

    assert tells(5 * noise, noise)
    assert not tells(5 * noise, 4 * noise)  # more than noise is left
    assert not tells(noise, noise)
    assert not _shown_without_impacts(baseline, [])


def test_no_excluded_effect_is_ranked(baseline):
    kept = "added_inertia"
    exclude = {h.effect for h in baseline.hypotheses} - {kept}
    assert {one.hypothesis.effect for one in rank(baseline, exclude).candidates} <= {kept}
    assert rank(baseline, {*exclude, kept}).candidates == ()


def test_a_model_that_was_fitted_badly_is_fitted_anew(baseline):
    """From where the best effect was found; else all that is tried would seem to be missing."""
    stuck = replace(baseline, fit=replace(baseline.fit, loss=3 * baseline.fit.loss))
    found = rank(stuck, {h.effect for h in baseline.hypotheses} - {EFFECT}).baseline.fit
    assert found.loss < 1.5 * baseline.fit.loss


@pytest.mark.long
def test_a_load_behind_a_play_is_told_from_a_handle_before_it():
    """Of a joint of the independent simulator: flanks that give way, and shares that differ."""
    case = draw(2, "backlash", family="household")
    (hidden,) = case.truth.hidden
    baseline = fit_baseline(read(case)[0])
    first, second = (
        baseline.fit_hypothesis(h) for h in baseline.hypotheses if h.effect == "backlash"
    )
    assert second.score < 0.6 * first.score
    (effect,) = second.written(baseline.base).effects
    assert (effect.side, effect.play) == ("motor", pytest.approx(hidden.width, rel=0.15))
    assert effect.load == pytest.approx(hidden.inertia, rel=0.15)
    assert effect.share == pytest.approx(hidden.friction / case.truth.friction, abs=0.15)


def test_a_well_is_tried_where_the_other_was_found(baseline):
    first, second = (next(h for h in baseline.hypotheses if h.effect == name) for name in WELLS)
    found = baseline.fit_hypothesis(first)
    found = replace(found, fit=replace(found.fit, x=np.append(found.fit.x[:-2], (0.6, 0.9))))
    tried = beside(second, found)
    assert tried.effect == second.effect
    assert np.allclose(tried.trials[:, -2:], [(0.6, 0.9), (0.6, 1.0), (0.3, 0.9)])


def test_in_longer_segments_an_effect_must_leave_nothing_but_noise(ranked):
    assert select(ranked).verdict == select(ranked, wholly=True).verdict == "missing_effect"
    more = replace(ranked, level=2 * SETTINGS.selection.noise_square)
    strange = select(more, wholly=True)
    assert strange.verdict == "unexplained"
    assert strange.probabilities[0] <= 0.5  # and an unknown one is as likely


@pytest.mark.parametrize(
    ("before", "closer", "likely", "verdict"),
    [
        (0.8, 0.15, 1.1 / 3, "unexplained"),
        (0.8, 0.3, 1.4 / 3, "unexplained"),
        (0.8, 0.4, 1.6 / 3, "missing_effect"),
        (0.8, None, 0.8 / 3, "unexplained"),
    ],
)
def test_what_a_closer_look_contradicts_is_believed_less(before, closer, likely, verdict):
    names = ("asymmetric_friction", "backlash")
    first = Selection("missing_effect", (before, 0.1), (0.6, (0.1, 0.2)), names)
    other = names[:1] if closer is not None else ()
    said = (closer,) if closer is not None else ()
    denied = Selection("unexplained", said, (7.0, (1.5,) * len(other)), other)
    found = pooled(first, denied)
    assert (found.verdict, found.effects) == (verdict, names)
    assert found.probabilities == pytest.approx((likely, 0.1 / 3))
    assert found.unknown == pytest.approx(1 - 0.1 / 3 - likely)
    assert pooled(first, replace(denied, verdict="missing_effect")) == first


@pytest.mark.parametrize(
    ("likely", "left", "counts"),
    [(0.7, 0.19, True), (0.2, 0.19, False), (0.2, 0.0, True)],
)
def test_a_closer_look_counts_that_is_surer_or_leaves_less(likely, left, counts):
    first = Selection("missing_effect", (0.3,), (0.11, (0.0,)), ("bistable_mechanism",))
    closer = Selection("missing_effect", (likely,), (1.3, (left,)), first.effects)
    assert closer_counts(first, closer) == counts
    assert not closer_counts(first, replace(closer, verdict="unexplained"))


@pytest.mark.parametrize(("disturbed", "verdict"), [(1, "adequate"), (3, "missing_effect")])
def test_one_segment_of_many_tells_of_no_effect(ranked, disturbed, verdict):
    """Where all of them together leave no more than noise."""
    estimator, first = ranked.baseline.estimator, ranked.candidates[0]
    calm = np.where(estimator.counts, 0.5 * estimator.segments.count, 0.0)
    off = calm.copy()
    which = np.flatnonzero(estimator.counts)[:disturbed]
    off[which] += 0.4 * calm.sum() * estimator.segments.count[which] / calm[which].sum()
    fits = [
        replace(first.fit, squares=squares, loss=estimator.loss(squares)) for squares in (off, calm)
    ]
    own = replace(first, fit=fits[1], score=fits[1].loss)
    one = replace(
        ranked, baseline=replace(ranked.baseline, fit=fits[0]), candidates=(own,), level=1
    )
    assert estimator.counts.sum() > 10 and one.baseline.excess < 0
    gain = estimator.losses(off) - estimator.losses(calm)
    told = evidence(one).gain + first.cost
    assert told == pytest.approx(gain.sum() - gain.max())
    assert decide(evidence(one)).verdict == verdict


def test_a_number_costs_what_the_data_tell_of_it(baseline):
    """Nothing where they tell nothing, or only of its sum with one of the model's own; a uniform
    number has a variance of a twelfth of its width's square; never more than for BIC."""
    (hypothesis,) = [one for one in baseline.hypotheses if one.effect == "quadratic_damping"]
    wide = replace(hypothesis, unknowns=unknowns_of((0.0, 1.0, 0.01), (-2.0, 2.0, 0.01)))

    def cost(*information):
        fit = replace(baseline.fit, x=np.zeros(3), information=np.array(information, float))
        return price(wide, fit, samples=100.0)

    none = [100, 0, 0], [0, 0, 0], [0, 0, 0]
    assert cost(*none) == pytest.approx(0.0)
    assert cost([100, 0, 0], [0, 12, 0], [0, 0, 0]) == pytest.approx(np.log(2))
    assert cost([100, 0, 0], [0, 0, 0], [0, 0, 6]) == pytest.approx(np.log(1 + 6 * 16 / 12))
    assert cost([50, 50, 0], [50, 50, 0], [0, 0, 0]) == pytest.approx(0.0)
    assert cost([100, 0, 0], [0, 1e9, 0], [0, 0, 1e9]) == pytest.approx(2 * np.log(100))
    without = price(wide, replace(baseline.fit, information=None), samples=100.0)
    assert without == pytest.approx(2 * np.log(100))


def test_two_that_are_nearly_as_good_only_resemble_what_is_missing(ranked):
    """If neither leaves only noise, though one whose shape is roughly known might leave so much."""
    estimator = ranked.baseline.estimator
    squares = 30.0 * estimator.segments.count  # far off, whatever effect was drawn
    far = replace(ranked.baseline.fit, squares=squares, loss=estimator.loss(squares))
    clear = replace(
        ranked, baseline=replace(ranked.baseline, fit=far), level=1.0, n_effective=estimator.samples
    )
    own = select(clear).excess[0]

    def verdict(*parts):
        """Where the first effects leave these parts of the excess."""
        candidates = [
            replace(
                candidate,
                score=(part * own + CAUCHY_SCALE * np.log1p(1 / CAUCHY_SCALE)) * clear.n_effective,
            )
            for candidate, part in zip(clear.candidates, parts, strict=False)
        ]
        coarse = replace(candidates[0].hypothesis, misfit_tolerance=SETTINGS.tolerances.known_shape)
        candidates[0] = replace(candidates[0], hypothesis=coarse)
        return select(replace(clear, candidates=tuple(candidates))).verdict

    assert verdict(0.15, 0.6) == "missing_effect"
    assert verdict(0.15, 0.18) == "unexplained"
    assert verdict(0.0, 0.01) == "missing_effect"  # both leave only noise: either may be


@pytest.mark.long
def test_ends_that_are_bouncier_than_the_model_s_are_unexplained_if_that_is_excluded():
    """Only impacts tell of them, and those tell of nothing else."""
    train = read(draw(195372811, "end_stop_restitution"))[0]  # one whose impacts are hard enough
    others = set(EFFECTS) - {"end_stop_restitution", "quadratic_damping"}
    assert diagnosed(train, others).diagnosis.effects[0].effect == "end_stop_restitution"
    without = diagnosed(train, {*others, "end_stop_restitution"}).diagnosis
    assert without.verdict == "unexplained"
    assert without.summary.startswith("The ends of the range throw the joint back")


@pytest.mark.parametrize(
    "effect",
    [
        EndStopRestitution(restitution=0.5, end="low"),
        EndStopRestitution(restitution=0.5),
        QuadraticDamping(direction="positive", y=(1, 1)),
    ],
)
def test_what_a_profile_has_cannot_be_missing(effect):
    joint = Joint(name="j", type="hinge", range=(0, 1), unit="rad")
    profile = Profile(joint=joint, effects=(effect,))
    offered = {h.effect for h in hypotheses(UNITS, templates(), profile)}
    assert effect.effect not in offered
    assert "added_inertia" in offered


def is_curve(hypothesis, effect):
    """Whether it is the effect as a free curve, and not as a constant on a part of the range."""
    return hypothesis.effect == effect and len(hypothesis.unknowns.low) == KNOTS


@pytest.mark.parametrize("effect", ["position_dependent_friction", "position_dependent_damping"])
def test_a_constant_on_less_than_0_8_of_the_range_differs_along_the_way(baseline, effect):
    """As the contract has it; what covers more is the constant effect."""
    zone = next(h for h in baseline.hypotheses if h.effect == effect and len(h.unknowns.low) == 4)
    for (a, b), itself in (((0.3, 0.6), True), ((0.0, 0.78), True), ((0.1, 0.95), False)):
        assert zone.itself(np.array([1.0, 0.002, a, b])) == itself


@pytest.mark.parametrize("effect", ["position_dependent_friction", "position_dependent_damping"])
def test_a_curve_that_hardly_differs_along_the_way_is_none(baseline, effect):
    """Another effect, a constant one, is all that it is; excluding that makes no curve of it."""
    found = baseline.fit_hypothesis(next(h for h in baseline.hypotheses if is_curve(h, effect)))
    n = len(baseline.base.places)
    for y, vanished in ((np.full(9, 0.3), True), (np.linspace(0, 0.6, 9), False)):
        fit = replace(found.fit, x=np.append(found.fit.x[:n], y))
        assert replace(found, fit=fit).vanished == vanished


@pytest.mark.parametrize("effect", ["position_dependent_friction", "position_dependent_damping"])
def test_a_curve_is_level_where_no_run_has_been(baseline, effect):
    units = replace(UNITS, visited=(0.2, 0.7))
    every = hypotheses(units, templates(), baseline.base.profile)
    curve = next(h for h in every if is_curve(h, effect))
    written = curve.write(baseline.base.profile, np.arange(1.0, len(curve.unknowns.low) + 1))
    channel = getattr(written.channels, "friction" if "friction" in effect else "damping")
    part = channel.components[-1]
    s = np.array([0, 0.1, 0.2, 0.7, 0.8, 1])
    values = evaluate(Channel(components=(part,)), s)[0]
    assert values[0] == values[1] == values[2] == part.y[0] > 0
    assert values[3] == pytest.approx(values[4]) == pytest.approx(part.y[-1])
    assert part.y[-1] > part.y[0]


@pytest.mark.slow
def test_a_fit_that_is_pressed_against_a_usual_bound_is_widened():
    """Even drag as an effect of which usually only a tenth of the true size is looked for."""
    baseline = fit_baseline(read(draw(84751434, EFFECT))[0].changed(runs=[0, 4]))
    every = [h for h in baseline.hypotheses if h.effect == EFFECT]
    size = baseline.fit_hypothesis(every[0]).x[0]
    usual, widest = (np.array([0.1, 10.0]) * size)[:, None]

    def bounded(high, widest):
        bounds = replace(every[0].unknowns, high=high, widest=np.stack([[np.nan], widest]))
        return baseline.fit_hypothesis(
            replace(every[0], unknowns=bounds, trials=np.array([[0.05 * size]]), uneven=None)
        )

    hard, pressed, wide = (bounded(usual, up) for up in ([np.nan], 2 * usual, widest))
    assert hard.x[0] == pytest.approx(usual[0]) and not hard.vanished
    assert pressed.x[0] <= 2 * usual[0] and pressed.vanished
    assert usual[0] < wide.x[0] < widest[0] and not wide.vanished
    assert wide.fit.loss < hard.fit.loss - 100


@pytest.mark.parametrize("place", ["whole", "low", "high", "most", "inside"])
def test_an_interval_is_within_the_range_wherever_a_trial_begins(place):
    for x in np.random.default_rng().uniform(-1, 2, (200, 2)):
        a, b = ends(place, x)
        assert 0 <= a <= b - NARROWEST + 1e-12
        assert b <= 1


@pytest.mark.parametrize("samples, sure", [(28, False), (1000, True)])
def test_few_samples_tell_less_of_two_effects_that_leave_as_much_of_each(samples, sure):
    """A difference of 0.06 in what is left of each sample is 1.7 in loss of 28 samples, a ratio of
    likelihoods of 2.3, and 60 of 1000."""
    evidence = Evidence(
        samples=samples,
        n_effective=samples,
        noisy=False,
        restitution=False,
        model=100.0,
        tolerant=100.0,
        own=100.0,
        gain=100.0 * samples,
        misfit_tolerance=0.01,
        effects=("gravity_offset", "constant_positive_conservative_hinge"),
        left=(0.0, 0.06),
    )
    first, second = decide(evidence).probabilities
    assert (first > 0.9) == sure
    assert (second > 0.2) != sure


@pytest.mark.parametrize(
    ("effect", "model", "left", "verdict"),
    [
        ("backlash", 12.2, (1.8, 9.6), "missing_effect"),
        ("backlash", 43.8, (2.15, 2.37), "unexplained"),
        ("load_dependent_friction", 16.8, (1.41, 10.9), "missing_effect"),
        ("load_dependent_friction", 16.8, (1.41, 1.9), "unexplained"),
    ],
)
def test_play_and_load_leave_more_than_a_law_that_is_known_and_much_less_than_all_others(
    effect, model, left, verdict
):
    """How a contact yields, or its friction grows with the load, is not known: of the joints with
    these numbers one has play, one a trembling hand, one a round contact under load."""
    found = [one for one in from_effects(UNITS) if one.effect == effect]
    assert found
    for one in found:
        evidence = Evidence(
            samples=5000.0,
            n_effective=5000.0,
            noisy=False,
            restitution=False,
            model=model,
            tolerant=model,
            own=model,
            gain=(model - left[0]) * 5000,
            misfit_tolerance=one.misfit_tolerance,
            effects=(effect, "presliding_friction"),
            left=left,
        )
        assert decide(evidence).verdict == verdict
