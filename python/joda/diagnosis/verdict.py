"""What a model lacks: the verdict on a ranking, with probabilities, sizes and sentences."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from joda.diagnosis import sentences
from joda.diagnosis.baseline import RESTITUTION, Baseline, fit_baseline
from joda.diagnosis.calibration import HEAVIER, Calibration, Calibrator
from joda.diagnosis.correction_report import SAME_EFFECT
from joda.diagnosis.corrections import (
    Corrected,
    Number,
    by_one_factor,
    corrected,
    corrections,
    errors_beside_a_force,
    heavier,
    numbers,
    numbers_beside,
    off,
    off_beside,
    off_without,
    one_factor,
)
from joda.diagnosis.data_sufficiency import at_rest, moved_one_way, too_little, too_noisy
from joda.diagnosis.effects_with_numbers import WithNumbers
from joda.diagnosis.end_stops import OtherEnds, suited, with_other_ends
from joda.diagnosis.findings import Diagnosis, Finding, Verdict
from joda.diagnosis.free_runs import FreeRuns, worst
from joda.diagnosis.holdout import Holdout
from joda.diagnosis.horizons import HorizonSearch, looked
from joda.diagnosis.hypothesis_fits import FittedHypothesis
from joda.diagnosis.joint_calibration import jointly, needed
from joda.diagnosis.plausible import unvisited_interval
from joda.diagnosis.ranking import Ranking, select
from joda.diagnosis.report import experiment_for, finding, likeliest_findings, reported
from joda.diagnosis.search import Progress
from joda.diagnosis.selection import Evidence, Selection
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.summary import (
    ENDS_LEFT,
    SAME,
    far_off,
    heavier_summary,
    helps,
    other_unit,
    summarised,
)
from joda.diagnosis.units import units_of
from joda.diagnosis.whole_run_search import WholeRuns, in_whole_runs
from joda.estimation.base_model import BaseModel
from joda.estimation.problem import segments_for
from joda.field import evaluate
from joda.measured.curves import curves_verdict, failing_force
from joda.measured.errors import MULTIPLE, worst_missed
from joda.measured.measured_joint import Measured
from joda.measured.misfit import rms
from joda.measured.visited import visited_share
from joda.measured.whiteness import strays
from joda.profile import Profile
from joda.scenes.limits import Stops
from joda.threads import one_blas_thread

Look = Callable[..., HorizonSearch]
"""`looked`, but for the effects that are not considered, and the progress."""
Answer = tuple[Calibration | None, HorizonSearch]
"""Numbers that are off, None where none is, and what looking says once these are right."""


@dataclass(frozen=True)
class Diagnosed:
    """What a model lacks.

    Attributes:
        diagnosis: for the user.
        profile: with the likeliest effect; None if there is none.
        candidates: what may be tried, the likeliest first, also what is too unlikely to be named.
        unexplained_by: the first look's ranking, where no effect explained the runs; else None.
        looks: the evidence of each look.
        corrected: the joint with its own numbers as the runs show them; None if none is off.
        calibration: numbers of its body and of the measurement that were set right first; None if
            none is off.
    """

    diagnosis: Diagnosis
    profile: Profile | None = None
    candidates: tuple[Finding, ...] = ()
    unexplained_by: Ranking | None = None
    looks: tuple[Evidence, ...] = ()
    corrected: Corrected | None = None
    calibration: Calibration | None = None


@one_blas_thread
def diagnosed(
    measured: Measured,
    exclude: Collection[str] = (),
    progress: Progress = lambda done, total, what: None,
    calibrate: bool = True,
) -> Diagnosed:
    """Finds what a model lacks.

    Args:
        measured: the joint and its runs.
        exclude: effects that are not considered.
        progress: told how much is done, of how much, and what.
        calibrate: whether numbers of the joint's body and of the measurement may be off.
    """
    if not segments_for(measured).usable.any():
        return Diagnosed(reported(measured, "insufficient_data", sentences.TOO_SHORT, (), None))
    if why := at_rest(measured):
        why = f"{why[0].upper()}{why[1:]}."
        return Diagnosed(reported(measured, "insufficient_data", why, (), None))
    if not measured.runs and (why := too_little(measured)):  # nor is their noise known
        return Diagnosed(reported(measured, "insufficient_data", why, (), None))
    baseline = fit_baseline(measured)
    look = partial(looked, exclude=exclude, progress=progress)
    if not calibrate:
        return _told(measured, None, look(measured, baseline=baseline), look)
    calibrator = Calibrator(measured)
    both = WithNumbers(calibrator, baseline, exclude, progress)
    found = calibrator.numbers(baseline)
    if found and found.alone:
        answer: Answer = found, look(found.of(measured))
        if answer[1].selection.verdict == "unexplained" or found.unusual:
            answer = _likelier(answer, _asked_with(both, look))
        return _told(measured, *answer, look)
    most = both.explain_most
    if most and (asked := _asked_with(both, look)):
        return _told(measured, *asked, look)
    plain = look(measured, baseline=baseline)
    if found is None and plain.selection.verdict == "adequate":
        return _unless_denied(measured, plain, calibrator, look)
    answer = _by_numbers(measured, plain, found, calibrator, look)
    verdict = answer[1].selection.verdict
    asks = verdict != "adequate" and not most
    if asks and (verdict == "unexplained" or answer[0] or both.help(plain.ranking)):
        answer = _likelier(answer, _asked_with(both, look))
    return _told(measured, *answer, look)


def _asked_with(both: WithNumbers, look: Look) -> Answer | None:
    """What looking says once numbers are right that are off beside the likeliest effect; None if no
    effect is then likelier than not."""
    if (there := both.likeliest()) is None:
        return None
    found, begun = there
    looks = look(found.of(both.measured) if found else both.measured, baseline=begun)
    return (found, looks) if looks.selection.likely else None


def _unless_denied(
    measured: Measured, plain: HorizonSearch, calibrator: Calibrator, look: Look
) -> Diagnosed:
    """That the model is adequate by its segments; where whole runs deny it, with numbers that are
    off, if these are right then."""
    out = _told(measured, None, plain, look)
    if out.diagnosis.verdict != "unexplained":
        return out
    if not (found := calibrator.numbers(plain.ranking.baseline, beside=True)):
        return out
    right = _told(measured, found, look(found.of(measured)), look)
    return right if right.diagnosis.verdict != "unexplained" else out


def _by_numbers(
    measured: Measured,
    plain: HorizonSearch,
    found: Calibration | None,
    calibrator: Calibrator,
    look: Look,
) -> Answer:
    """Numbers that are off, and what looking says with these, where they explain more than the best
    effect does; else none, and what it says without.

    Args:
        measured: the joint as it was given.
        plain: what looking says without.
        found: numbers that explain what the model leaves, by themselves; None: they are sought.
        calibrator: that seeks them.
        look: at a joint.
    """
    ranking, beside = plain.first[0], found is None
    if beside:
        ranking = plain.ranking
        found = calibrator.numbers(ranking.baseline, beside)
    if found and found.beats(ranking.baseline, ranking.candidates, clearly=beside):
        looks = look(found.of(measured))
        if looks.selection.verdict != "unexplained" or plain.selection.verdict == "unexplained":
            return found, looks
    return None, plain


def _likelier(given: Answer, both: Answer | None) -> Answer:
    """What is given, or numbers and an effect that were asked together, if these leave clearly
    less."""
    if both is None:
        return given
    if given[1].selection.verdict == "unexplained":
        return both

    def left(found: Calibration | None, looks: HorizonSearch) -> float:
        """Per sample, with the cost of all numbers."""
        ranking, cost = looks.first[0], found.cost if found else 0.0
        least = min((one.fit.loss + one.cost for one in ranking.candidates), default=np.inf)
        if looks.selection.verdict == "adequate":
            least = ranking.baseline.fit.loss
        return (least + cost) / max(ranking.baseline.estimator.samples, 1.0)

    samples = max(given[1].first[0].baseline.estimator.samples, 1.0)
    clearly = SETTINGS.corrections.equal_numbers / samples
    return both if left(*both) < left(*given) - clearly else given


def _told(
    measured: Measured, found: Calibration | None, looks: HorizonSearch, look: Look
) -> Diagnosed:
    """What looking at a joint says, with its numbers set right if some are off."""
    if found:
        return _set_right(measured, found, looks, look)
    return replace(_concluded(measured, looks), looks=looks.evidence)


def _set_right(
    measured: Measured,
    found: Calibration,
    looks: HorizonSearch,
    look: Look,
) -> Diagnosed:
    """What looking at a joint and runs says whose numbers were set right, with these.

    Those that stood in for an effect are given back, and the runs are looked at once more.
    """
    while looks.selection.likely:
        ranking, best = looks.ranking, looks.ranking.candidates[0]
        if best.hypothesis.effect == RESTITUTION:  # which segments do not tell of
            break
        beside = measured, found, ranking.baseline, best
        left = needed(*beside)
        if left and left.names == found.names:
            left = jointly(*beside)
            if left.sure == found.names:
                found = left
                break
            left = left.only(left.sure) if left.sure else None
        if left is None:
            return _told(measured, None, look(measured), look)
        found = left
        looks = look(found.of(measured))
    others = [one.of(measured) for one in found.drawn()]
    same = not SAME_EFFECT.keys().isdisjoint(found.names)
    out = replace(_concluded(found.of(measured), looks, others, same), looks=looks.evidence)
    numbers = found.corrections(measured)
    report = out.diagnosis
    summary = " ".join(
        [report.summary, "Beside it numbers are off:", *(n.explanation for n in numbers)]
    )
    diagnosis = replace(report, summary=summary, corrections=(*numbers, *report.corrections))
    return replace(out, diagnosis=diagnosis, calibration=found)


def _concluded(
    measured: Measured, looks: HorizonSearch, others: Sequence[Measured] = (), same: bool = False
) -> Diagnosed:
    """What looking at the measurements says; the others have numbers that are as likely, and `same`
    is whether a number that was set right does what a missing effect would."""
    ranking, selection = looks.ranking, looks.selection
    first_ranking, first_weighed = looks.first
    one_way = moved_one_way(measured)
    unexplained = first_weighed.verdict == "unexplained" and bool(measured.runs)
    unexplained_by = first_ranking if unexplained else None
    if selection.verdict == "adequate" and (why := too_little(measured) or too_noisy(measured)):
        return Diagnosed(reported(measured, "insufficient_data", why, (), None))
    suffice = not selection.likely and looks.free and looks.free.suffice
    if selection.verdict == "adequate" or suffice:
        return _adequate(measured, ranking, looks.free, others, same)
    every = likeliest_findings(measured, ranking, selection)
    sized = [k for k, one in every.items() if one.sized]
    experiment = experiment_for(measured, ranking, selection, one_way)
    if not sized or unvisited_interval(measured, every[sized[0]].interval):
        why = ENDS_LEFT if ranking.restitution else sentences.NO_EFFECT
        if sized:
            there = every[sized[0]].interval
            why = sentences.OUT_THERE.format(*there, 100 * visited_share(measured, there))
        report = reported(measured, "unexplained", why, (), experiment)
        return _driven(Diagnosed(report, unexplained_by=unexplained_by), ranking.baseline)
    first = every[sized[0]]
    hardly = (
        first.held_out_error_after > SETTINGS.naming.held_out_left * first.held_out_error_before
    )
    hardly |= far_off(first, measured.floor)
    if (
        first_weighed.verdict == "adequate"
        and hardly
        and selection.excess[0] < SETTINGS.selection.unexplained_excess
    ):
        # nor do segments held out know of anything
        return _adequate(measured, first_ranking, looks.free, others, same)
    if not helps(first, measured.floor) and all(
        look.model < SETTINGS.selection.unexplained_excess for look in looks.evidence
    ):
        return _adequate(measured, ranking, looks.free, others, same)
    findings = {k: every[k] for k in sized}
    return _missing(measured, ranking, selection, findings, experiment, unexplained_by)


def _missing(
    measured: Measured,
    ranking: Ranking,
    selection: Selection,
    findings: Mapping[int, Finding],
    experiment: str | None,
    unexplained_by: Ranking | None,
) -> Diagnosed:
    """That something is missing, and what may be, the likeliest first, by the places of these in a
    ranking."""
    (number, first), *_ = findings.items()
    verdict = selection.verdict if helps(first, measured.floor) else "unexplained"
    base, candidate = ranking.baseline.base, ranking.candidates[number]
    confounder = (_forced(measured) and one_factor(base, candidate)) or other_unit(measured)
    one_way = moved_one_way(measured)
    how = selection, measured.floor, one_way, ranking.restitution, confounder
    summary = summarised(first, *how, measured.templates)
    # the model's own numbers stand in for what is not known, unless the effect is sure
    sure = verdict == "missing_effect" and not confounder
    beside = [(ranking.candidates[k], one.probability) for k, one in findings.items()]
    own = numbers_beside(ranking.baseline, beside) if sure else ()
    summary += f" But {confounder}." if confounder else off_beside(own)
    if _forced(measured) and _same_everywhere(base, candidate):
        summary += sentences.AN_OFFSET
    told = tuple(findings.values())
    worth = tuple(one for one in told if one.probability >= SETTINGS.naming.worth_naming)
    report = replace(
        reported(measured, verdict, summary, worth, experiment),
        corrections=corrections(own, measured.profile.joint, SETTINGS.corrections.min_off_beside),
        confounder=confounder,
        unexplained_probability=selection.unknown if verdict == selection.verdict else None,
    )
    servo = (
        corrected(
            ranking.baseline,
            own,
            SETTINGS.corrections.min_off_beside,
            candidate.fit.x,
            driven_only=True,
        )
        if sure
        else None
    )
    profile = candidate.written(base) if worth else None
    diagnosis = Diagnosed(report, profile, told, unexplained_by, corrected=servo)
    return diagnosis if sure or confounder else _driven(diagnosis, ranking.baseline)


def _driven(found: Diagnosed, baseline: Baseline) -> Diagnosed:
    """The same with the numbers of the model that suit the runs best without an effect, where an
    actuator drives the joint: of that few models know any."""
    own = numbers(baseline)
    if baseline.base.joint_model.servo is None or not (
        right := corrected(baseline, own, SETTINGS.corrections.min_off, baseline.fit.x)
    ):
        return found
    report = found.diagnosis
    diagnosis = replace(
        report,
        summary=f"{report.summary}{off_without(own)}",
        corrections=corrections(own, baseline.base.profile.joint, SETTINGS.corrections.min_off),
    )
    return replace(found, diagnosis=diagnosis, corrected=right)


def _adequate(
    measured: Measured,
    ranking: Ranking,
    free: FreeRuns | None,
    others: Sequence[Measured],
    same: bool,
) -> Diagnosed:
    """No effect shows in segments: the model is adequate, unless whole runs or curves deny it."""
    baseline = ranking.baseline
    if not measured.runs and _uneven(measured, baseline):
        return _unexplained(measured, _report_uneven(measured), sentences.GAUGE_AGAIN)
    left = worst(measured, baseline, others)
    ends = (
        with_other_ends(measured, baseline, others, left.whole)
        if left.whole > SETTINGS.whole_runs.max_multiple
        else None
    )
    by_ends = bool(ends and ends.times <= SETTINGS.whole_runs.max_multiple)
    if why := _drifting(free, left.free if not by_ends else 0.0):
        return _denied(measured, ranking, ends, why)
    denying = free if free and free.denied else None
    told, least = (denying, 0.0) if denying else (baseline, SETTINGS.corrections.min_off)
    own = numbers(baseline, found=(denying.fit.x, denying.errors) if denying else None)
    if denying and not off(own, least):
        by_whole = _denied(measured, ranking, ends, sentences.TOGETHER)
        if by_whole.diagnosis.verdict != "unexplained":  # else other numbers do as well
            return by_whole
        return _unexplained(measured, sentences.TOGETHER, sentences.AGAIN)
    if off(own, least) and moved_one_way(measured):
        surely = _beside_a_force(measured, baseline, denying)
        pairs = zip(own, surely, strict=True)
        if not all(sure.off(least) for one, sure in pairs if one.off(least)):
            experiment = experiment_for(measured, ranking, select(ranking), one_way=True)
            summary = f"{sentences.EITHER.format(off(own, least))}{SAME}."
            return _unexplained(measured, summary + _confounded(measured), experiment)
        own = surely
    numbers_off, forced = off(own, least), _forced(measured)
    sure = heavier(own) if numbers_off and not forced else 0.0
    if sure > SETTINGS.selection.sure and (found := _heavier(measured, ranking, numbers_off, sure)):
        return found
    all_alike = by_one_factor(own, forced) if numbers_off else ""
    if numbers_off:
        numbers_off = sentences.NUMBERS_OFF.format(numbers_off, all_alike)
    denied = bool(ends) and not by_ends
    if denied:
        noise = sentences.BEYOND_NOISE.format(measured.floor, measured.unit)
        summary = sentences.BEYOND_ENDS.format(noise, left.whole, numbers_off)
    else:
        summary = _suffices(measured, numbers_off, left.whole, bool(denying), same)
        if ends:
            summary += sentences.AT_ENDS.format(left.whole, ends.times, ends.changes)
    confounder = _confounded(measured)
    verdict: Verdict = "unexplained" if denied else "adequate"
    report = reported(
        measured, verdict, summary + confounder, (), sentences.PRESS if denied else None
    )
    report = replace(report, corrections=corrections(own, measured.profile.joint, least))
    driven = baseline.base.joint_model.servo is not None
    if confounder or (all_alike and forced and not driven):
        return Diagnosed(report)
    found = Diagnosed(report, corrected=corrected(baseline, own, least, told.fit.x))
    if ends and denied:
        return _by_whole_runs(measured, ranking, ends.stops, found)
    return found


def _unexplained(measured: Measured, summary: str, experiment: str | None) -> Diagnosed:
    return Diagnosed(reported(measured, "unexplained", summary, (), experiment))


def _confounded(measured: Measured) -> str:
    """That the force may be in another unit, if so."""
    confounder = other_unit(measured)
    return f" But {confounder}." if confounder else ""


def _drifting(free: FreeRuns | None, missed: float) -> str:
    """What whole runs deny whatever the model's own numbers, if they do.

    Args:
        free: what whole free runs tell.
        missed: times what errors explain, before the joint comes to an end.
    """
    if missed > SETTINGS.whole_runs.max_multiple:
        return sentences.DRIFTING.format(missed)
    return sentences.SLOWLY if free and free.drifting else ""


def _denied(
    measured: Measured, ranking: Ranking, ends: OtherEnds | None, summary: str
) -> Diagnosed:
    """What whole runs say of the effects where they deny that the model is adequate."""
    stops = ends.stops if ends else suited(measured, ranking.baseline)
    plain = _unexplained(measured, summary, sentences.AGAIN)
    return _by_whole_runs(measured, ranking, stops, plain)


def _beside_a_force(
    measured: Measured, baseline: Baseline, denying: FreeRuns | None
) -> tuple[Number, ...]:
    """The model's own numbers with their errors where a force that acts one way may be missing."""
    told = denying or baseline
    usual = units_of(baseline.estimator.segments, measured).force
    errors = errors_beside_a_force(told.estimator, told.base, told.fit, usual)
    if denying:
        errors = np.maximum(errors, denying.errors)
    return numbers(baseline, found=(told.fit.x, errors))


def _suffices(measured: Measured, numbers_off: str, left: float, denied: bool, same: bool) -> str:
    """That no effect is missing, and what is left.

    Args:
        measured: the joint and its runs.
        numbers_off: which of the model's own numbers are off, a sentence; empty if none is.
        left: of whole runs, times what errors explain, with these fitted.
        denied: whether whole free runs deny the model as it stands.
        same: whether a number that was set right does what a missing effect would.
    """
    run = worst_missed(measured)
    missed = run.multiple if run else 0.0
    noise = sentences.BEYOND_NOISE.format(measured.floor, measured.unit)
    if numbers_off and ((run and run.fault) or denied):
        how = sentences.WHOLE.format(missed) if run and run.fault else sentences.FREELY
        told = sentences.WITH_THESE.format(how, numbers_off, noise)
        return f"{told[0].upper()}{told[1:]}" if same else f"{sentences.NONE_MISSING}{told}"
    loose = missed > MULTIPLE and left <= SETTINGS.whole_runs.max_multiple
    adrift = not numbers_off and strays(measured) < SETTINGS.whole_runs.drift_probability
    where = "With the numbers below the model" if same else "The model"
    where = (
        "In segments the model"
        if adrift or (loose and left > SETTINGS.whole_runs.said_multiple)
        else where
    )
    summary = f"{where} is adequate: {noise} that an effect would explain.{numbers_off}"
    if loose:
        return summary + sentences.WITHOUT.format(missed, left)
    return f"{summary}{sentences.ADRIFT}" if adrift else summary


def _by_whole_runs(
    measured: Measured, ranking: Ranking, stops: Stops | None, plain: Diagnosed
) -> Diagnosed:
    """What whole runs say of the effects, where they alone tell that something is missing.

    Args:
        measured: the joint and its runs.
        ranking: of the effects by segments.
        stops: ends of the range that suit the runs best; None: the model's.
        plain: what is said where that is nothing.
    """
    whole = in_whole_runs(measured, ranking, stops)
    again, selection = whole.ranking, select(whole.ranking)
    if selection.verdict == "adequate":
        return _by_other_numbers(measured, whole, stops) or plain
    if selection.share > SETTINGS.whole_runs.max_share:
        return plain
    every = likeliest_findings(measured, again, selection)
    if not every[0].sized or unvisited_interval(measured, every[0].interval):
        return plain
    report, given = plain.diagnosis, plain.diagnosis.summary
    found = _missing(measured, again, selection, every, report.next_experiment, None)
    said = found.diagnosis
    if said.verdict == "missing_effect":
        return replace(found, diagnosis=replace(said, summary=f"{said.summary}{sentences.WHOLLY}"))
    guess = replace(said, summary=f"{given} {said.summary}", corrections=report.corrections)
    return replace(found, diagnosis=guess, corrected=plain.corrected)


def _by_other_numbers(
    measured: Measured, whole: WholeRuns, stops: Stops | None
) -> Diagnosed | None:
    """That no effect is missing, and the model's own numbers are off as whole runs show them; None
    where these leave more of the runs than errors explain, or a force would do the same.

    Args:
        measured: the joint and its runs.
        whole: what whole runs say.
        stops: ends of the range that these have there; None: the model's.
    """
    fitted = whole.ranking.baseline
    own = numbers(fitted, found=(fitted.fit.x, whole.errors))
    there = measured.stopped(stops) if stops else measured
    if (
        not off(own)
        or moved_one_way(measured)
        or worst(there, fitted).whole > SETTINGS.whole_runs.max_multiple
    ):
        return None
    missed = worst_missed(measured)
    misses = sentences.WHOLE.format(missed.multiple if missed else 0.0)
    noise = sentences.BEYOND_NOISE.format(measured.floor, measured.unit)
    told = sentences.NUMBERS_OFF.format(off(own), by_one_factor(own, _forced(measured)))
    summary = sentences.NONE_MISSING + sentences.WITH_THESE.format(misses, told, noise)
    report = reported(measured, "adequate", summary, (), None)
    report = replace(
        report, corrections=corrections(own, measured.profile.joint, SETTINGS.corrections.min_off)
    )
    return Diagnosed(
        report, corrected=corrected(fitted, own, SETTINGS.corrections.min_off, fitted.fit.x)
    )


def _same_everywhere(base: BaseModel, candidate: FittedHypothesis) -> bool:
    """Whether an effect is a force that is the same all over the range."""
    s = np.linspace(0.0, 1.0, 101)
    profiles = candidate.written(base), base.written(candidate.fit.x)
    with_it, without = (evaluate(one.channels.conservative, s)[0] for one in profiles)
    force = with_it - without
    return bool(force[0] and np.allclose(force, force[0]))


def _forced(measured: Measured) -> bool:
    """Whether a force was recorded."""
    return not measured.runs or any(run.forced for run in measured.runs)


def _heavier(
    measured: Measured, ranking: Ranking, numbers_off: str, probability: float
) -> Diagnosed | None:
    """That the joint is heavier, which numbers that are off by one factor tell; None where no more
    inertia can be asked for."""
    for number, candidate in enumerate(ranking.candidates):
        if candidate.hypothesis.effect == HEAVIER:
            held = Holdout(ranking.baseline, measured)
            one = finding(measured, ranking, held, number, select(ranking))
            before = held.as_given  # without it, it is the model's numbers that are off
            one = replace(one, probability=probability, held_out_error_before=before)
            summary = heavier_summary(one, numbers_off)
            report = reported(measured, "missing_effect", summary, (one,), None)
            return Diagnosed(report, candidate.written(ranking.baseline.base), (one,))
    return None


def _report_uneven(measured: Measured) -> str:
    """How far off the curves are; where their unit is in doubt, that is asked first."""
    if confounder := other_unit(measured):
        return f"{confounder[0].upper()}{confounder[1:]}."
    missed = rms(np.concatenate([curve.excess for curve in measured.curves]))
    return sentences.UNEVEN.format(missed, measured.unit, measured.floor)


def _uneven(measured: Measured, baseline: Baseline) -> bool:
    """Whether curves are beyond their noise also with the model's own strengths as fitted."""
    fitted = baseline.base.written(baseline.fit.x)
    curves = [curve.against(fitted, measured.context) for curve in measured.curves]
    failing = failing_force(curves, measured.profile.joint)
    return curves_verdict(curves, failing) == "beyond_noise"
