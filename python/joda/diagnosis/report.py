"""What is reported of a ranking: findings with sizes and sentences, and what to record next."""

from joda.diagnosis import sentences
from joda.diagnosis.data_sufficiency import moved_one_way
from joda.diagnosis.experiments import Model, means_of, next_experiment, there_and_back
from joda.diagnosis.findings import Diagnosis, Finding, Verdict
from joda.diagnosis.holdout import Holdout
from joda.diagnosis.hypothesis_fits import joined
from joda.diagnosis.indistinguishable import indistinguishable, kinds_of
from joda.diagnosis.phrases import explained, named, words_of
from joda.diagnosis.ranking import Ranking
from joda.diagnosis.selection import Selection
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.uncertainty import uncertainty
from joda.measured.measured_joint import Measured
from joda.measured.visited import unvisited, unvisited_part
from joda.profile import Profile


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
    error = uncertainty(
        ranking.baseline, candidate, left[number] / max(own, SETTINGS.selection.negligible_excess)
    )
    interval = hypothesis.interval(x)
    joint = measured.profile.joint
    words = words_of(hypothesis.effect, measured.templates)
    alone = hypothesis.write(Profile(joint=joint), x).effects
    return Finding(
        effect=hypothesis.effect,
        name=words.name,
        interval=interval,
        interval_error=error.ends,
        probability=selection.probabilities[number],
        direction=hypothesis.direction,
        magnitude=magnitude,
        magnitude_error=error.magnitude,
        unit=hypothesis.unit,
        explanation=explained(
            words,
            hypothesis.direction,
            interval,
            unvisited_part(measured, interval),
            (magnitude, error.magnitude, hypothesis.unit),
            (before, after, measured.floor),
            measured.unit,
            joint,
            uneven=hypothesis.factors > 0,
            shown=next((one.shown for one in alone if one.effect == hypothesis.effect), None),
            alike=[named(other, measured.templates) for other in alike],
        ),
        held_out_error_before=before,
        held_out_error_after=after,
        indistinguishable_from=alike,
    )


def likeliest_findings(
    measured: Measured, ranking: Ranking, selection: Selection
) -> dict[int, Finding]:
    """The first few effects of a ranking that are worth a word, by their place there."""
    held = Holdout(ranking.baseline, measured)
    kinds = kinds_of(ranking, measured.templates) if moved_one_way(measured) else {}
    return {
        k: finding(
            measured, ranking, held, k, selection, indistinguishable(ranking, selection, k, kinds)
        )
        for k in range(min(SETTINGS.naming.named, len(ranking.candidates)))
        if k == 0 or selection.probabilities[k] > SETTINGS.naming.worth_naming
    }


def reported(
    measured: Measured,
    verdict: Verdict,
    summary: str,
    effects: tuple[Finding, ...],
    experiment: str | None,
) -> Diagnosis:
    """A verdict with what the measurements themselves tell.

    Args:
        measured: the joint and its runs.
        verdict, summary, effects: of the diagnosis.
        experiment: what to record next; None: nothing, or more where there is too little.
    """
    joint = measured.profile.joint
    if verdict == "insufficient_data":
        experiment = sentences.RECORD_MORE if measured.runs else sentences.GAUGE_MORE
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


def experiment_for(
    measured: Measured, ranking: Ranking, selection: Selection, one_way: bool
) -> str | None:
    """The experiment that tells the likeliest two apart; None if the first is sure."""
    if not measured.runs:
        return sentences.GAUGE_BACK if one_way else None
    means = means_of(measured, ranking.baseline.estimator.segments, ranking.baseline.base.h)
    if one_way:
        return there_and_back(means).sentence
    if selection.verdict == "unexplained":
        return sentences.AGAIN
    if selection.probabilities[0] > SETTINGS.selection.sure or len(ranking.candidates) < 2:
        return None
    first, second = (
        Model(*joined(ranking.baseline.base, g.hypothesis), g.fit.x) for g in ranking.candidates[:2]
    )
    return next_experiment(first, second, means)
