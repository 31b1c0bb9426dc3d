"""What a model lacks: the verdict on a ranking, with probabilities, sizes and sentences."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from joda.diagnosis.baseline import RESTITUTION, Baseline, fit_baseline
from joda.diagnosis.calibration import HEAVIER, Calibration, Calibrator
from joda.diagnosis.correction_report import SAME_EFFECT
from joda.diagnosis.corrections import (
    FAR_OFF,
    OFF,
    Corrected,
    by_one_factor,
    corrected,
    corrections,
    errors_beside_a_force,
    heavier,
    numbers,
    off,
    off_beside,
    off_without,
    one_factor,
)
from joda.diagnosis.coverage import at_rest, moved_one_way, too_little, too_noisy
from joda.diagnosis.end_stops import suited, with_other_ends
from joda.diagnosis.experiments import Model, means_of, next_experiment, there_and_back
from joda.diagnosis.findings import Diagnosis, Finding, Verdict
from joda.diagnosis.free_runs import BEYOND, CHANCE, FreeRuns, worst
from joda.diagnosis.holdout import Holdout
from joda.diagnosis.horizons import HorizonSearch, looked
from joda.diagnosis.hypothesis_fits import joined
from joda.diagnosis.joint_calibration import jointly, needed
from joda.diagnosis.phrases import explained
from joda.diagnosis.plausible import Needs, unseen_place
from joda.diagnosis.ranking import Ranking, hopeful, weigh
from joda.diagnosis.rivals import indistinguishable
from joda.diagnosis.search import Progress, rank
from joda.diagnosis.selection import LITTLE, MUCH, SURE, Evidence, Selection
from joda.diagnosis.summary import (
    BOUNCY,
    FALLEN,
    SAME,
    far_off,
    heavier_summary,
    helps,
    other_unit,
    summarised,
)
from joda.diagnosis.uncertainty import uncertainty
from joda.diagnosis.units import units_of
from joda.diagnosis.whole_run_search import WholeRuns, in_whole_runs
from joda.estimation.base_model import BaseModel
from joda.estimation.nuisance import nuisances_of
from joda.estimation.problem import segments_for
from joda.measured.curves import curves_verdict, failing_force
from joda.measured.errors import MULTIPLE, worst_missed
from joda.measured.measured_joint import Measured
from joda.measured.misfit import rms
from joda.measured.visited import unvisited, unvisited_part, visited_share
from joda.measured.whiteness import strays
from joda.profile import Profile
from joda.scenes.limits import Stops
from joda.threads import one_blas_thread

TOO_SHORT = (
    "The measurements are too short, or their force is far too strong for the joint (see to its "
    "unit), to tell anything."
)
RECORD_MORE = (
    "Record more: move the joint through its whole range in both directions, slowly and fast, with "
    "the force if it can be measured, for some 20 s in all."
)
GAUGE_MORE = "Measure more: at some 20 places of the whole range or more, in both directions."
GAUGE_AGAIN = (
    "Measure the same again, and at places nearer together: what comes again is the joint's, what "
    "does not is the hand's or the gauge's."
)
GAUGE_BACK = "Measure the way back too, as slowly."
AGAIN = (
    "Repeat one slow motion three times, in both directions, then the same fast: if repeats "
    "differ, the effect has memory or changes with time; if fast and slow differ, it is a "
    "resistance; if neither, it is a force over position."
)
UNEVEN = (
    "Something is missing that no known effect explains: the force's error, {:.2g} {} RMS beside a "
    "noise of {:.2g}, is more than noise, or has a pattern that noise has not; a hand that "
    "trembles makes one too."
)
DRIFTING = (
    "Something is missing that no known effect explains: windows show nothing beyond the noise, "
    "but whole runs are missed by up to {:.0f} times what noise, start and force explain."
)
SLOWLY = (
    "Something is missing that no known effect explains: windows show nothing beyond the noise, "
    "but of runs in which no force acted as a whole more is left than noise makes, whatever the "
    "model's own strengths."
)
TOGETHER = (
    "Either the model's own numbers are off, or something is missing, and these runs cannot tell "
    "which: as it stands the model leaves more of whole free runs than noise makes, and with other "
    "numbers it would not."
)
WITH_THESE = "as it stands the model {}.{} With these there is {} that an effect would explain."
BEYOND_NOISE = "nothing beyond the noise ({:.2g} {})"
NUMBERS_OFF = " Its own numbers are off: {}.{}"
NONE_MISSING = "No effect is missing, but "
WHOLE = "misses whole runs by up to {:.0f} times the noise"
FREELY = "leaves more of whole free runs than noise makes"
WITHOUT = (
    " As it stands it misses whole runs by up to {:.0f} times the noise all the same, and with its "
    "numbers fitted by up to {:.1f} times what noise, start and force explain; joda compare says "
    "where."
)
SOME = 2.0
"""How many times what errors explain a whole run is missed by, where segments alone are adequate.
"""
ADRIFT = (
    " But more is left of whole runs than noise of position and force makes: a small fault of the "
    "model, or what the force did between its samples."
)
AT_ENDS = (
    " From where the joint comes to an end of its range, whole runs are missed by up to {:.0f} "
    "times what noise, start and force explain, and by {:.1f} times with other ends: {}; joda "
    "improve writes them."
)
BEYOND_ENDS = (
    "Something at the ends of the range is missing that no known effect explains: within it there "
    "is {}, but from where the joint comes to an end, whole runs are missed by up to {:.0f} times "
    "what noise, start and force explain, whatever the stops (solreflimit, solimplimit).{}"
)
WHOLLY = " Windows show nothing of it; whole runs do."
MOST_LEFT = 0.5
"""Part of what whole runs are missed by that an effect may leave to be worth a word."""
PRESS = (
    "Press the joint slowly against either end and let it go, and let it come there slowly and "
    "fast, with the force: that parts the stop from a force close to it."
)
EITHER = "Either the model's own numbers are off ({}), or a force is missing"
NAMED, WORTH_NAMING = 5, 0.01
"""How many effects are named, and only those of at least some probability."""
OUT_THERE = (
    "Something is missing, and what explains most of it would act at s = {:.2f} to {:.2f}, of "
    "which runs visited {:.0f} %: whether it does, these data cannot tell. It may be an obstacle, "
    "another end of the range, a latch, or nothing of the joint, such as a push that was not "
    "recorded."
)
NO_EFFECT = "Something is missing that no known effect explains."


@dataclass(frozen=True)
class Diagnosed:
    """What a model lacks.

    Attributes:
        diagnosis: for the user.
        profile: with the likeliest effect; None if there is none.
        candidates: what may be tried, the likeliest first, also what is too unlikely to be named.
        puzzling: the first look's ranking, where no effect explained the runs; else None.
        looks: the evidence of each look.
        corrected: the joint with its own numbers as the runs show them; None if none is off.
        calibration: numbers of its body and of the measurement that were set right first; None if
            none is off.
    """

    diagnosis: Diagnosis
    profile: Profile | None = None
    candidates: tuple[Finding, ...] = ()
    puzzling: Ranking | None = None
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
        return Diagnosed(_report(measured, "insufficient_data", TOO_SHORT, (), None))
    if why := at_rest(measured):
        why = f"{why[0].upper()}{why[1:]}."
        return Diagnosed(_report(measured, "insufficient_data", why, (), None))
    if not measured.runs and (why := too_little(measured)):  # nor is their noise known
        return Diagnosed(_report(measured, "insufficient_data", why, (), None))
    baseline = fit_baseline(measured)
    calibrator = Calibrator(measured)
    found = calibrator.numbers(baseline) if calibrate else None
    mended: tuple[Calibration, HorizonSearch] | None = None
    if found and found.alone:
        plain = looked(found.of(measured), exclude, progress)
        mended = found, plain
    else:
        plain = looked(measured, exclude, progress, baseline)
        ranking, beside = plain.first[0], False
        if calibrate and found is None and plain.selection.verdict != "adequate":
            ranking, beside = plain.ranking, True
            found = calibrator.numbers(ranking.baseline, beside)
        if found and found.beats(ranking.baseline, ranking.candidates, clearly=beside):
            looks = looked(found.of(measured), exclude, progress)
            if looks.selection.verdict != "unexplained" or plain.selection.verdict == "unexplained":
                mended = found, looks
    puzzled = calibrate and (mended[1] if mended else plain).selection.verdict == "unexplained"
    if puzzled and (both := _together(measured, baseline.base, exclude, progress)):
        mended = both
    if mended:
        return _set_right(measured, *mended, exclude, progress)
    return replace(_concluded(measured, plain), looks=plain.evidence)


def _together(
    measured: Measured, base: BaseModel, exclude: Collection[str], progress: Progress
) -> tuple[Calibration, HorizonSearch] | None:
    """Numbers that are off, and an effect that is missing once these are right, where neither alone
    explains the runs: every effect is asked with all numbers free beside it, then the numbers
    beside the likeliest, then all effects with these set right. None if none is then likelier than
    not."""
    every = nuisances_of(measured, base)
    widths = {str(name): std for name, std in zip(every.names, every.prior_stds, strict=True)}
    if "mass" in widths:  # then all is told in units of the force as it was recorded
        widths.pop("force_scale", None)
    if not (measured.runs and widths):
        return None
    free = replace(measured, doubtful=widths)
    ranking = rank(fit_baseline(free), exclude, progress, hopeful, Needs(measured).allow)
    if not weigh(ranking).likely:
        return None
    other = measured.changed(profile=ranking.candidates[0].written(ranking.baseline.base))
    if (found := Calibrator(other).numbers(fit_baseline(other))) is None:
        return None
    looks = looked(found.of(measured), exclude, progress)
    return (found, looks) if looks.selection.likely else None


def _set_right(
    measured: Measured,
    found: Calibration,
    looks: HorizonSearch,
    exclude: Collection[str],
    progress: Progress,
) -> Diagnosed:
    """What looking at a joint and runs says whose numbers were set right, with these.

    Those that stood in for an effect are given back, and the runs are looked at once more.
    """
    while looks.selection.likely:
        ranking, best = looks.ranking, looks.ranking.candidates[0]
        if best.hypothesis.effect == RESTITUTION:  # which segments do not tell of
            break
        beside = measured, found, ranking.baseline, best
        if (fewer := needed(*beside)) is None:
            plain = looked(measured, exclude, progress)
            return replace(_concluded(measured, plain), looks=plain.evidence)
        if fewer.names == found.names:
            found = jointly(*beside)
            break
        found = fewer
        looks = looked(found.of(measured), exclude, progress)
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
    puzzled = first_weighed.verdict == "unexplained" and bool(measured.runs)
    puzzling = first_ranking if puzzled else None
    if selection.verdict == "adequate" and (why := too_little(measured) or too_noisy(measured)):
        return Diagnosed(_report(measured, "insufficient_data", why, (), None))
    suffice = not selection.likely and looks.free and looks.free.suffice
    if selection.verdict == "adequate" or suffice:
        return _adequate(measured, ranking, looks.free, others, same)
    every = _findings(measured, ranking, selection)
    sized = [k for k, one in every.items() if one.sized]
    experiment = _next(measured, ranking, selection, one_way)
    if not sized or unseen_place(measured, every[sized[0]].interval):
        why = BOUNCY if ranking.restitution else NO_EFFECT
        if sized:
            there = every[sized[0]].interval
            why = OUT_THERE.format(*there, 100 * visited_share(measured, there))
        report = _report(measured, "unexplained", why, (), experiment)
        return _driven(Diagnosed(report, puzzling=puzzling), ranking.baseline)
    first = every[sized[0]]
    hardly = first.held_out_error_after > FALLEN * first.held_out_error_before
    hardly |= far_off(first, measured.floor)
    if first_weighed.verdict == "adequate" and hardly and selection.excess[0] < MUCH:
        # nor do segments held out know of anything
        return _adequate(measured, first_ranking, looks.free, others, same)
    if not helps(first, measured.floor) and all(look.model < MUCH for look in looks.evidence):
        return _adequate(measured, ranking, looks.free, others, same)
    findings = {k: every[k] for k in sized}
    return _missing(measured, ranking, selection, findings, experiment, puzzling)


def _findings(measured: Measured, ranking: Ranking, selection: Selection) -> dict[int, Finding]:
    """The first few effects of a ranking that are worth a word, by their place there."""
    held, one_way = Holdout(ranking.baseline, measured), moved_one_way(measured)
    return {
        k: finding(
            measured, ranking, held, k, selection, indistinguishable(ranking, selection, k, one_way)
        )
        for k in range(min(NAMED, len(ranking.candidates)))
        if k == 0 or selection.probabilities[k] > WORTH_NAMING
    }


def _missing(
    measured: Measured,
    ranking: Ranking,
    selection: Selection,
    findings: Mapping[int, Finding],
    experiment: str | None,
    puzzling: Ranking | None,
) -> Diagnosed:
    """That something is missing, and what may be, the likeliest first, by the places of these in a
    ranking."""
    (number, first), *_ = findings.items()
    verdict = selection.verdict if helps(first, measured.floor) else "unexplained"
    base, candidate = ranking.baseline.base, ranking.candidates[number]
    doubt = (_forced(measured) and one_factor(base, candidate)) or other_unit(measured)
    one_way = moved_one_way(measured)
    summary = summarised(first, selection, measured.floor, one_way, ranking.restitution, doubt)
    sure = verdict == "missing_effect" and not doubt  # else they stand in for what is not known
    own = numbers(ranking.baseline, candidate) if sure else ()
    summary += f" But {doubt}." if doubt else off_beside(own)
    told = tuple(findings.values())
    worth = tuple(one for one in told if one.probability >= WORTH_NAMING)
    report = replace(
        _report(measured, verdict, summary, worth, experiment),
        corrections=corrections(own, measured.profile.joint, FAR_OFF),
        doubt=doubt,
        unexplained_probability=selection.unknown if verdict == selection.verdict else None,
    )
    servo = (
        corrected(ranking.baseline, own, FAR_OFF, candidate.fit.x, driven_only=True)
        if sure
        else None
    )
    profile = candidate.written(base) if worth else None
    diagnosis = Diagnosed(report, profile, told, puzzling, corrected=servo)
    return diagnosis if sure or doubt else _driven(diagnosis, ranking.baseline)


def _driven(found: Diagnosed, baseline: Baseline) -> Diagnosed:
    """The same with the numbers of the model that suit the runs best without an effect, where an
    actuator drives the joint: of that few models know any."""
    own = numbers(baseline)
    if baseline.base.joint_model.servo is None or not (
        right := corrected(baseline, own, OFF, baseline.fit.x)
    ):
        return found
    report = found.diagnosis
    diagnosis = replace(
        report,
        summary=f"{report.summary}{off_without(own)}",
        corrections=corrections(own, baseline.base.profile.joint, OFF),
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

    def unexplained(summary: str, experiment: str | None) -> Diagnosed:
        return Diagnosed(_report(measured, "unexplained", summary, (), experiment))

    def whole_runs_tell(summary: str) -> Diagnosed:
        stops = ends.stops if ends else suited(measured, baseline)
        return _by_whole_runs(measured, ranking, stops, unexplained(summary, AGAIN))

    def with_these(how: str) -> str:
        told = WITH_THESE.format(how, numbers_off, noise)
        return f"{told[0].upper()}{told[1:]}" if same else f"{NONE_MISSING}{told}"

    baseline = ranking.baseline
    if not measured.runs and _uneven(measured, baseline):
        return unexplained(_report_uneven(measured), GAUGE_AGAIN)
    left = worst(measured, baseline, others)
    ends = with_other_ends(measured, baseline, others, left.whole) if left.whole > BEYOND else None
    if left.free > BEYOND and not (ends and ends.times <= BEYOND):
        return whole_runs_tell(DRIFTING.format(left.free))
    if free and free.drifting:
        return whole_runs_tell(SLOWLY)
    denying = free if free and free.denied else None
    told, least = (denying, 0.0) if denying else (baseline, OFF)
    by_runs = (denying.fit.x, denying.errors) if denying else None
    own, worst_run = numbers(baseline, found=by_runs), worst_missed(measured)
    numbers_off = off(own, least)
    if denying and not numbers_off:
        by_whole = whole_runs_tell(TOGETHER)
        guessed = by_whole.diagnosis.verdict == "unexplained"  # where other numbers do as well
        return unexplained(TOGETHER, AGAIN) if guessed else by_whole
    if numbers_off and moved_one_way(measured):
        usual = units_of(baseline.estimator.segments, measured).force
        errors = errors_beside_a_force(told.estimator, told.base, told.fit, usual)
        if denying:
            errors = np.maximum(errors, denying.errors)
        surely = numbers(baseline, found=(told.fit.x, errors))
        pairs = zip(own, surely, strict=True)
        if not all(sure.off(least) for one, sure in pairs if one.off(least)):
            experiment = _next(measured, ranking, weigh(ranking), one_way=True)
            summary = EITHER.format(numbers_off) + SAME + "."
            summary += f" But {doubt}." if (doubt := other_unit(measured)) else ""
            return unexplained(summary, experiment)
        own, numbers_off = surely, off(surely, least)
    forced = _forced(measured)
    sure = heavier(own) if numbers_off and not forced else 0.0
    if sure > SURE and (found := _heavier(measured, ranking, numbers_off, sure)):
        return found
    all_alike = by_one_factor(own, forced) if numbers_off else ""
    if numbers_off:
        numbers_off = NUMBERS_OFF.format(numbers_off, all_alike)
    missed = worst_run.multiple if worst_run else 0.0
    noise = BEYOND_NOISE.format(measured.floor, measured.unit)
    verdict: Verdict = "unexplained" if ends and ends.times > BEYOND else "adequate"
    if verdict == "unexplained":
        summary = BEYOND_ENDS.format(noise, left.whole, numbers_off)
    elif numbers_off and worst_run and worst_run.fault:
        summary = with_these(WHOLE.format(missed))
    elif numbers_off and denying:
        summary = with_these(FREELY)
    else:
        loose = missed > MULTIPLE and left.whole <= BEYOND
        adrift = not numbers_off and strays(measured) < CHANCE
        where = "With the numbers below the model" if same else "The model"
        where = "In windows the model" if adrift or (loose and left.whole > SOME) else where
        summary = f"{where} is adequate: {noise} that an effect would explain.{numbers_off}"
        summary += WITHOUT.format(missed, left.whole) if loose else ADRIFT if adrift else ""
    if ends and verdict == "adequate":
        summary += AT_ENDS.format(left.whole, ends.times, ends.changes)
    if doubt := other_unit(measured):
        summary += f" But {doubt}."
    report = _report(measured, verdict, summary, (), PRESS if verdict == "unexplained" else None)
    report = replace(report, corrections=corrections(own, measured.profile.joint, least))
    driven = baseline.base.joint_model.servo is not None
    if doubt or (all_alike and forced and not driven):
        return Diagnosed(report)
    found = Diagnosed(report, corrected=corrected(baseline, own, least, told.fit.x))
    if ends and verdict == "unexplained":
        return _by_whole_runs(measured, ranking, ends.stops, found)
    return found


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
    again, selection = whole.ranking, weigh(whole.ranking)
    if selection.verdict == "adequate":
        return _by_other_numbers(measured, whole, stops) or plain
    if selection.share > MOST_LEFT:
        return plain
    every = _findings(measured, again, selection)
    if not every[0].sized or unseen_place(measured, every[0].interval):
        return plain
    report, given = plain.diagnosis, plain.diagnosis.summary
    found = _missing(measured, again, selection, every, report.next_experiment, None)
    said = found.diagnosis
    if said.verdict == "missing_effect":
        return replace(found, diagnosis=replace(said, summary=f"{said.summary}{WHOLLY}"))
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
    if not off(own) or moved_one_way(measured) or worst(there, fitted).whole > BEYOND:
        return None
    missed = worst_missed(measured)
    misses = WHOLE.format(missed.multiple if missed else 0.0)
    noise = BEYOND_NOISE.format(measured.floor, measured.unit)
    told = NUMBERS_OFF.format(off(own), by_one_factor(own, _forced(measured)))
    summary = NONE_MISSING + WITH_THESE.format(misses, told, noise)
    report = _report(measured, "adequate", summary, (), None)
    report = replace(report, corrections=corrections(own, measured.profile.joint, OFF))
    return Diagnosed(report, corrected=corrected(fitted, own, OFF, fitted.fit.x))


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
            one = finding(measured, ranking, held, number, weigh(ranking))
            before = held.as_given  # without it, it is the model's numbers that are off
            one = replace(one, probability=probability, held_out_error_before=before)
            summary = heavier_summary(one, numbers_off)
            report = _report(measured, "missing_effect", summary, (one,), None)
            return Diagnosed(report, candidate.written(ranking.baseline.base), (one,))
    return None


def _report_uneven(measured: Measured) -> str:
    """How far off the curves are; where their unit is in doubt, that is asked first."""
    if doubt := other_unit(measured):
        return f"{doubt[0].upper()}{doubt[1:]}."
    missed = rms(np.concatenate([curve.excess for curve in measured.curves]))
    return UNEVEN.format(missed, measured.unit, measured.floor)


def _uneven(measured: Measured, baseline: Baseline) -> bool:
    """Whether curves are beyond their noise also with the model's own strengths as fitted."""
    fitted = baseline.base.written(baseline.fit.x)
    curves = [curve.against(fitted, measured.context) for curve in measured.curves]
    failing = failing_force(curves, measured.profile.joint)
    return curves_verdict(curves, failing) == "beyond_noise"


def _report(
    measured: Measured,
    verdict: Verdict,
    summary: str,
    effects: tuple[Finding, ...],
    experiment: str | None,
) -> Diagnosis:
    joint = measured.profile.joint
    if verdict == "insufficient_data":
        experiment = RECORD_MORE if measured.runs else GAUGE_MORE
    return Diagnosis(
        joint=joint.name,
        verdict=verdict,
        summary=summary,
        effects=effects,
        unvisited=unvisited(measured),
        noise_floor=measured.floor,
        unit=measured.unit,
        next_experiment=experiment,
        notes=measured.notes,
        contacts=measured.contacts,
    )


def finding(
    measured: Measured,
    ranking: Ranking,
    held: Holdout,
    number: int,
    selection: Selection,
    alike: tuple[str, ...] = (),
) -> Finding:
    """A candidate of a ranking, told.

    Args:
        measured: the joint and its runs.
        ranking: of what may be missing.
        held: errors of segments held out.
        number: of the candidate.
        selection: the ranking's probabilities.
        alike: effects that the data cannot tell from it.
    """
    candidate = ranking.candidates[number]
    hypothesis, x = candidate.hypothesis, candidate.x
    before, after = held.errors(candidate)
    magnitude = hypothesis.magnitude(x)
    own, left = selection.excess
    doubt = uncertainty(ranking.baseline, candidate, left[number] / max(own, LITTLE))
    interval = hypothesis.interval(x)
    joint = measured.profile.joint
    alone = hypothesis.write(Profile(joint=joint), x).effects
    return Finding(
        effect=hypothesis.effect,
        interval=interval,
        interval_error=doubt.ends,
        probability=selection.probabilities[number],
        direction=hypothesis.direction,
        magnitude=magnitude,
        magnitude_error=doubt.magnitude,
        unit=hypothesis.unit,
        explanation=explained(
            hypothesis.effect,
            hypothesis.direction,
            interval,
            unvisited_part(measured, interval),
            (magnitude, doubt.magnitude, hypothesis.unit),
            (before, after, measured.floor),
            measured.unit,
            joint,
            uneven=hypothesis.factors > 0,
            shown=next((one.shown for one in alone if one.effect == hypothesis.effect), None),
        ),
        held_out_error_before=before,
        held_out_error_after=after,
        indistinguishable_from=alike,
    )


def _next(measured: Measured, ranking: Ranking, selection: Selection, one_way: bool) -> str | None:
    """The experiment that tells the likeliest two apart; None if the first is sure."""
    if not measured.runs:
        return GAUGE_BACK if one_way else None
    means = means_of(measured, ranking.baseline.estimator.segments, ranking.baseline.base.h)
    if one_way:
        return there_and_back(means).sentence
    if selection.verdict == "unexplained":
        return AGAIN
    if selection.probabilities[0] > SURE or len(ranking.candidates) < 2:
        return None
    first, second = (
        Model(*joined(ranking.baseline.base, g.hypothesis), g.fit.x) for g in ranking.candidates[:2]
    )
    return next_experiment(first, second, means)
