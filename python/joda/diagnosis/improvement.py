"""Diagnoses and mends a model until the data support nothing more."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from joda.diagnosis.adding import Error, add_effect, better_stops, by_all, error, fallen
from joda.diagnosis.applied_corrections import AppliedCorrections
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.corrections import Corrected, corrected, corrections, numbers
from joda.diagnosis.departures import FAITHFUL, Departures
from joda.diagnosis.findings import Correction, Diagnosis, Finding
from joda.diagnosis.overlap import divided
from joda.diagnosis.pair_search import pairs
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shape_refinement import refitted
from joda.diagnosis.verdict import Diagnosed, diagnosed
from joda.estimation.problem import segments_for
from joda.measured.measured_joint import Measured
from joda.profile import Profile
from joda.scenes.actuators import Servo
from joda.scenes.limits import Stops
from joda.threads import one_blas_thread

ADDING = SETTINGS.adding

NOTHING_HELPS = "No likely effect clearly lowers the error on what was held out of the fit."
INTERRUPTED = "Interrupted; what was found until then is kept."

Parts = tuple[Measured, Measured]
"""The runs to fit, and those held out."""
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Step:
    """A stair of the falling error.

    Attributes:
        added: what was found missing and added; None at the beginning, and for corrections.
        profile: with all effects so far.
        corrections: of the model's own numbers, that were made instead.
        servo: of the joint's actuators, with all corrections so far; None where none was made.
        right: what was set right of what the joint moves and of the measurement, so far.
        stops: ends of the range that suit the runs there; None: the model's.
        error: on runs held out of every fit.
        diagnosis: of the model with this profile; None if it was not made.
        departs: by what the profile is not what was given and diagnosed.
    """

    added: Finding | None
    profile: Profile
    error: Error
    diagnosis: Diagnosis | None = None
    departs: Departures = FAITHFUL
    corrections: tuple[Correction, ...] = ()
    servo: Servo | None = None
    right: AppliedCorrections | None = None
    stops: Stops | None = None

    @property
    def effect(self) -> str | None:
        """Name of what was added."""
        return self.added.effect if self.added else None


@one_blas_thread
def improved(
    measured: Measured, parts: Parts, progress: Progress = lambda what: None
) -> tuple[tuple[Step, ...], str]:
    """Adds effects while the data support them.

    Args:
        measured: the joint, its profile as it is, and its runs.
        parts: the same, see `joda.diagnosis.split.parted`.
        progress: what is being done.

    Returns:
        the stairs, the first one the model as it was; and why there are no more, a sentence.
    """
    steps = [Step(None, measured.profile, error(parts[1]))]
    why = f"{ADDING.max_effects} effects were added; that is as many as are tried."
    try:
        if measured.joint_model.servo and (
            first := _numbers_first(parts, steps[0].error, progress)
        ):
            parts = _driven(parts, first.servo)
            steps.append(first)
        while len(steps) <= ADDING.max_effects:
            progress("diagnose")
            given = steps[-1].profile
            found = diagnosed(_with(parts, given)[0], calibrate=len(steps) == 1)
            said, own = found.diagnosis, found.diagnosis.corrections
            if found.calibration:
                if not (more := _calibrated(parts, steps[-1], found, progress)):
                    why = NOTHING_HELPS
                    break
                parts = _corrected(parts, found.calibration.applied)
                steps += more
                if steps[-1].profile is not given:
                    continue
                own = tuple(one for one in own if one not in steps[-1].corrections)
            steps[-1] = replace(steps[-1], diagnosis=said)
            if said.confounder:
                why = said.summary
                break
            anew = found.calibration or not steps[-1].corrections
            right = found.corrected if anew else None
            if right and (set_right := _set_right(parts, steps[-1].error, right, own, progress)):
                parts = _driven(parts, set_right.servo)
                steps.append(replace(set_right, right=steps[-1].right))
                continue
            if not (stairs := _next(parts, steps[-1], found, progress)):
                why = NOTHING_HELPS if said.verdict == "missing_effect" else said.summary
                break
            last = steps[-1]
            steps += [replace(step, servo=last.servo, right=last.right) for step in stairs]
            steps = _renamed(parts, steps, progress)
        if effect := steps[-1].effect:
            progress("all numbers once more, to all runs")
            steps[-1] = _by_all(measured, steps[-1], effect)
        progress("the ends of the range")
        steps = _stopped(parts, steps)
    except KeyboardInterrupt:
        why = INTERRUPTED
    return tuple(steps), why


def _by_all(measured: Measured, last: Step, effect: str) -> Step:
    """The last stair, fitted once more to all runs as they were set right."""
    whole = last.right.of(measured) if last.right else measured
    whole, _ = _driven((whole, whole), last.servo)
    return replace(last, profile=by_all(whole, last.profile, effect, last.departs))


def _stopped(parts: Parts, steps: list[Step]) -> list[Step]:
    """The stairs, the last one with ends of the range that suit the runs there; one more where
    nothing else was missing."""
    train, held = _with(parts, steps[-1].profile)
    if not (found := better_stops(train, held)):
        return steps
    stops, after = found
    last = replace(steps[-1], stops=stops, error=after)
    return [*steps[: max(len(steps) - 1, 1)], last]


def _numbers_first(parts: Parts, before: Error, progress: Progress) -> Step | None:
    """The numbers of a driven joint set right before anything is asked: few models know them, and a
    diagnosis of a model that is far off takes as long as the next one."""
    progress("the model's own numbers")
    baseline = fit_baseline(parts[0])
    found = numbers(baseline)
    right = corrected(baseline, found, SETTINGS.corrections.min_off, baseline.fit.x)
    own = corrections(found, baseline.base.profile.joint, SETTINGS.corrections.min_off)
    return _set_right(parts, before, right, own, progress) if right else None


def _calibrated(parts: Parts, last: Step, found: Diagnosed, progress: Progress) -> list[Step]:
    """The joint and its runs with numbers set right, if that lowers the error held out: by itself,
    or else together with the model's own that were found off beside them, or with the effect that
    was; none if it does not."""
    assert found.calibration
    right, said = found.calibration.applied, found.diagnosis
    beside = _with(_corrected(parts, right), last.profile)
    after = error(beside[1])
    own = tuple(one for one in said.corrections if one.parameter in found.calibration.names)
    alone = Step(None, last.profile, after, said, corrections=own, right=right)
    if fallen(last.error, after):
        return [alone]
    if found.corrected:
        more = _set_right(beside, last.error, found.corrected, said.corrections, progress)
        return [replace(more, diagnosis=said, right=right)] if more else []
    stairs = [replace(one, right=right) for one in _next(beside, alone, found, progress)]
    return [alone, *stairs] if stairs and fallen(last.error, stairs[-1].error) else []


def _corrected(parts: Parts, right: AppliedCorrections) -> Parts:
    """Both with numbers set right."""
    train, held = parts
    return right.of(train), right.of(held)


def _set_right(
    parts: Parts, before: Error, right: Corrected, found: tuple[Correction, ...], progress: Progress
) -> Step | None:
    """The model with its own numbers set right, at the scene's own step, if that lowers the error
    held out, also as whole runs."""
    progress("the model's own numbers")
    train, held = _driven(parts, right.servo)
    train = train.changed(right.profile)
    profile = refitted(train, right.profile, segments_for(train).length)
    after = error(held.changed(profile))
    rises = before.whole is not None and (after.whole or 0.0) > before.whole
    if not fallen(before, after) or rises:
        return None
    return Step(None, profile, after, corrections=found, servo=right.servo)


def _driven(parts: Parts, servo: Servo | None) -> Parts:
    """The runs with other numbers of the actuator."""
    if servo is None:
        return parts
    train, held = (
        part.changed(joint_model=replace(part.joint_model, servo=servo)) for part in parts
    )
    return train, held


def _next(parts: Parts, last: Step, latest: Diagnosed, progress: Progress) -> list[Step]:
    """The first effect of the diagnosis that clearly lowers the error held out; none if none does.

    Where no effect explains at once what the model as it was lacks, perhaps two do: then the first
    one of the best pair, and with it the second if that lowers the error further. Not so of joints
    that an actuator drives, of which that takes too long.
    """
    known = latest.diagnosis.verdict == "missing_effect"
    found: Sequence[Sequence[Finding]] = [[one] for one in latest.candidates]
    if latest.unexplained_by and not last.added and not parts[0].joint_model.servo:
        train = parts[0].changed(last.profile)
        known, found = False, pairs(train, latest.unexplained_by, progress)
    for number, (first, *second) in enumerate(found[: ADDING.max_tried]):
        if known and number and first.probability < ADDING.min_probability:
            return []
        most = ADDING.max_error if known or not number else ADDING.max_error_unlikely
        if step := _added(parts, last.profile, first, most, progress):
            return _stairs(parts, step, second, progress) or [step]
    return []


def _added(
    parts: Parts, profile: Profile, finding: Finding, most: float, progress: Progress
) -> Step | None:
    """The profile with what was found, if that brings the error held out to a part of it."""
    progress(f"add {finding.effect}")
    train, held = _with(parts, profile)
    given = parts[0].profile
    added_effect = add_effect(
        train, held, finding.effect, finding.direction, finding.interval, progress, given
    )
    if added_effect.effect and added_effect.after.window < most * added_effect.before.window:
        return Step(finding, added_effect.profile, added_effect.after, departs=added_effect.departs)
    return None


def _renamed(parts: Parts, steps: list[Step], progress: Progress) -> list[Step]:
    """The stairs, with another effect in the place of one that stood in for it.

    Each was named while others were missing, or not yet fitted beside it. Beside them as they are
    now it is asked for again.
    """
    first = next((k for k, step in enumerate(steps) if step.added), len(steps))
    before, begin, added = steps[: first - 1], steps[first - 1], steps[first:]
    if any(step.corrections for step in added):
        return steps
    for k, step in enumerate(added if len(added) > 1 else ()):
        progress(f"asking again what {step.effect} is")
        others = [one.added for one in added if one is not step]
        without = divided(added[-1].profile, step.effect or "", begin.profile)[1]
        found = diagnosed(_with(parts, without)[0], calibrate=False).diagnosis
        if found.verdict != "missing_effect" or found.effects[0].effect in [
            one.effect for one in added
        ]:
            continue
        instead = found.effects[0]
        for place in sorted({k, len(others)}):  # where it was, and last
            stairs = _stairs(parts, begin, [*others[:place], instead, *others[place:]], progress)
            if stairs and stairs[-1].error.window < ADDING.equal_error * added[-1].error.window:
                own = (replace(s, servo=begin.servo, right=begin.right) for s in stairs[1:])
                return [*before, begin, *own]
    return steps


def _stairs(
    parts: Parts, begin: Step, findings: Sequence[Finding | None], progress: Progress
) -> list[Step] | None:
    """What was found, added one after the other; None if one of them does not lower the error."""
    steps = [begin]
    for finding in findings:
        if not finding or not (
            step := _added(parts, steps[-1].profile, finding, ADDING.max_error, progress)
        ):
            return None
        steps.append(step)
    return steps


def _with(parts: Parts, profile: Profile) -> Parts:
    train, held = parts
    return train.changed(profile), held.changed(profile)
