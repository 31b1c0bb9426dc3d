"""Adds an effect to a joint's profile and fits everything together.

First the effect's few numbers with the model's strengths; then every control point, interval and
number (`joda.diagnosis.shape_refinement`). What is written makes runs that no fit has seen
likelier.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from joda.diagnosis.baseline import RESTITUTION, Baseline, fit_baseline
from joda.diagnosis.data_sufficiency import at_rest
from joda.diagnosis.departures import FAITHFUL, Departures, departures, given_parts, restored
from joda.diagnosis.end_stops import fitted_stops
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.overlap import overlap
from joda.diagnosis.paired_test import MISSED_MORE, risen, worse
from joda.diagnosis.plausible import Needs, implausible, unvisited_interval, unvisited_shape
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shape_refinement import (
    LONGEST,
    Likelihood,
    Trials,
    Tried,
    checked,
    clearly,
    has_restitution,
    likeliest,
    refitted,
)
from joda.measured.errors import Errors, errors, known, until_an_end
from joda.measured.measured_joint import Measured
from joda.measured.misfit import rms
from joda.profile import Profile
from joda.scenes.limits import Stops
from joda.threads import one_blas_thread

NO_LESS = "it does not lower the held-out error"
OWN = (
    "the model's own numbers, fitted without it, do as well on what was held out; joda refine fits "
    "them"
)
NOTHING_LEFT = (
    "the held-out error is no more than the noise even without it, so that it cannot tell"
)
STRENGTHS = (1.0, 3.0, 10.0)
"""Of an effect whose place is known: the trials, in units of the usual one."""


@dataclass(frozen=True)
class Error:
    """How far a model is off.

    Attributes:
        whole: RMS of open-loop replays of whole runs or blocks, rad or m; None where none can be
            replayed, as the force at its beginning is unknown, or there are only curves.
        window: RMS of segments of 0.4 s, rad or m; of curves the force's, N·m or N.
    """

    whole: float | None
    window: float


@dataclass(frozen=True)
class AddedEffect:
    """A profile with an effect more.

    Attributes:
        profile: the whole one (`joda.scenes.native`).
        effect: that was added; None if nothing did better than the model as it was.
        before, after: errors on runs held out of the fit.
        reason: why nothing was added, a clause; None if something was.
        departs: by what the profile is not what was given and diagnosed.
        stops: ends of the range that suit the runs there; None: the model's.
    """

    profile: Profile
    effect: str | None
    before: Error
    after: Error
    reason: str | None = None
    departs: Departures = FAITHFUL
    stops: Stops | None = None


def error(measured: Measured, profile: Profile | None = None, *, within: bool = True) -> Error:
    """How far the model, or another profile, is off: of runs, in MuJoCo with the plugin; by
    positions `within` the joint's range (see `errors`) or all."""
    return replayed(measured, profile, within=within)[0]


def replayed(
    measured: Measured, profile: Profile | None = None, *, within: bool = True
) -> tuple[Error, Errors | None]:
    """The same, and the replays; None where there are only curves."""
    model = measured if profile is None else measured.changed(profile)
    if not model.runs:
        return Error(None, rms(np.concatenate([curve.excess for curve in model.curves]))), None
    found = errors(model, within=within)
    return Error(known(found.whole), found.window), found


@one_blas_thread
def add_effect(
    train: Measured,
    held: Measured,
    effect: str,
    direction: str | None = None,
    near: tuple[float, float] | None = None,
    progress: Callable[[str], None] = lambda what: None,
    given: Profile | None = None,
) -> AddedEffect:
    """Adds an effect, if that is plausible and runs held out are clearly better with it.

    Of what is tried, the likeliest is taken that makes those runs likelier, their error less in
    segments (a paired test) and not more as a whole, and exerts no force that nothing needs. It may
    change what the model gave, or act elsewhere than near, only if no other is nearly as good.

    Args:
        train: the joint, its profile as it is, and runs to fit.
        held: the same with runs held out.
        effect: its name.
        direction: of the effect, if it is known.
        near: where it is, in normalised position, if that is known.
        progress: what is being done.
        given: the profile of the model as it was given; None: the joint's as it is.
    """
    before, replays = replayed(held)
    if reason := at_rest(train) or unvisited_interval(train, near):
        return AddedEffect(train.profile, None, before, before, reason)
    progress("the effect's own numbers")
    given = given or train.profile
    baseline = fit_baseline(train)
    begin = starts(baseline, effect, direction, near)
    trials = Trials(train, held, effect == RESTITUTION, begin[0] if begin else None)
    tried = [one for start in begin for one in trials.refined_shapes(start, effect, progress)]
    loss = trials.unseen.loss(train.profile)

    needs = Needs(train)

    def best(some: Iterable[Tried]) -> tuple[Tried | None, Error, str]:
        """The likeliest that may be added, and its error; else why the first may not."""
        reasons = []
        for one in sorted(some, key=lambda one: one.score):
            reason = implausible(needs, one.profile, effect)
            reason = reason or unvisited_shape((train, held), one.profile, effect, train.profile)
            if not reason and not clearly(one.unseen, loss):
                reason = NO_LESS
            if not reason:  # replays take longest
                after, anew = replayed(held, one.profile)
                if not fallen(before, after):
                    reason = NO_LESS
                elif replays and anew:
                    reason = worse(replays, anew)
                    if reason == MISSED_MORE and not _missed_before_an_end(held, replays, anew):
                        reason = None
                if not reason:
                    return one, after, ""
            reasons.append(reason)
        return None, before, reasons[0] if reasons else "these data can tell nothing of it"

    first, after, reason = best(tried)
    if not first and tried and (parts := given_parts(given, effect)):
        # its own numbers as they were given may be better than these runs tell them
        as_given = restored(likeliest(tried).profile, given, parts)
        held_fast = trials.holding(as_given, parts, progress)
        first, after, _ = best(held_fast)
        tried += held_fast
    if not first:
        silent = reason == NO_LESS and before.window < SETTINGS.adding.silent * held.floor
        return AddedEffect(train.profile, None, before, before, NOTHING_LEFT if silent else reason)
    departs = departures(given, first.profile, effect, near)
    if departs.sentences:
        parts = departs.parts
        back = restored(first.profile, given, parts)
        tried += trials.holding(back, parts, progress) if parts else []
        count = len(departs.sentences)
        found = [(one, departures(given, one.profile, effect, near)) for one in tried]
        other, error_then, _ = best(one for one, own in found if len(own.sentences) < count)
        if other and _as_good(other, first):
            first, after = other, error_then
            departs = departures(given, first.profile, effect, near)
    if departs.parts:
        progress("the model's own numbers without the effect")
        own = checked(baseline.base.written(baseline.fit.x))
        without = likeliest(trials.refined_shapes(own, effect, progress))
        if _as_good(without, first):
            return AddedEffect(train.profile, None, before, before, OWN)
    return AddedEffect(first.profile, effect, before, after, departs=departs)


@one_blas_thread
def with_stop(added: AddedEffect, train: Measured, held: Measured) -> AddedEffect:
    """What was added to these, with ends of the range that suit the runs there."""
    own, judged = (one.changed(added.profile) for one in (train, held))
    if not (found := better_stops(own, judged)):
        return added
    stops, after = found
    return replace(added, after=after, stops=stops)


def better_stops(train: Measured, held: Measured) -> tuple[Stops, Error] | None:
    """Ends of the range that suit the runs there, and the error held out with them; None where the
    model's own do as well on what was held out."""
    if not (stops := fitted_stops(train, held)):
        return None
    before, after = error(held, within=False), error(held.stopped(stops), within=False)
    most = SETTINGS.adding.max_rise
    risen = after.window > most * before.window
    if before.whole is not None and after.whole is not None:
        risen |= after.whole > most * before.whole
    return None if risen else (stops, error(held.stopped(stops)))


@one_blas_thread
def by_all(
    measured: Measured,
    profile: Profile,
    effect: str,
    departs: Departures,
    near: tuple[float, float] | None = None,
) -> Profile:
    """A profile with an effect more, all its numbers fitted once more, also to the runs that judged
    it; as it was where that is not likelier, or departs from what was given in more.

    Args:
        measured: the joint, its profile as it was given, and all runs.
        profile: what was accepted.
        effect: that was added.
        departs: by what the profile is not what was given and diagnosed.
        near: where the effect was diagnosed, in normalised position.
    """
    if not measured.runs:
        return profile
    anew = refitted(measured, profile, LONGEST)
    more = departures(measured.profile, anew, effect, near)
    if len(more.sentences) > len(departs.sentences):
        return profile
    return min(profile, anew, key=Likelihood(measured, has_restitution(profile), profile).loss)


def fallen(before: Error, after: Error) -> bool:
    """Whether the segment error is smaller, or that of free runs where segments are too short to
    show it."""
    in_segments = after.window < SETTINGS.adding.max_segment_error * before.window
    if before.whole is None or after.whole is None:
        return in_segments
    return in_segments or (
        after.whole < SETTINGS.adding.whole_run_fall * before.whole and after.window < before.window
    )


def _missed_before_an_end(held: Measured, before: Errors, after: Errors) -> bool:
    """Whether whole runs are missed by more until they come to an end: what they do after that is
    also the stop's, which may be another than the model's."""
    return risen(until_an_end(held, before), until_an_end(held, after)) > SETTINGS.adding.max_rise


def _as_good(other: Tried, first: Tried) -> bool:
    """Whether a profile is as good as the likeliest, on what was held out and on all runs."""
    return other.score < first.score + SETTINGS.adding.likelier and not clearly(
        first.unseen, other.unseen
    )


def starts(
    baseline: Baseline, effect: str, direction: str | None, near: tuple[float, float] | None
) -> list[Profile]:
    """The profile with the effect at its most likely place, and if that is elsewhere, near one."""
    every = [h for h in baseline.hypotheses if h.effect == effect]
    tried = [h for h in every if direction in (None, h.direction)] or every
    candidates = [found for h in tried if (found := baseline.fit_hypothesis(h))]
    candidates += [
        baseline.refined(baseline.coarse(there)) for h in tried if (there := _placed(h, near))
    ]
    candidates.sort(key=lambda found: found.score)
    close = [
        g
        for g in candidates
        if near and overlap(g.hypothesis.interval(g.x), near) >= SETTINGS.adding.min_overlap
    ]
    firsts = candidates[:1] if not close or close[0] is candidates[0] else [candidates[0], close[0]]
    shaped = [baseline.perturbed(baseline.uneven(one)) for one in firsts]
    return [checked(one.written(baseline.base)) for one in shaped]


def _placed(hypothesis: Hypothesis, near: tuple[float, float] | None) -> Hypothesis | None:
    """A hypothesis that begins at an interval, with several strengths; None if it has none."""
    ends = hypothesis.ends
    if near is None or not ends:
        return None
    own = near if ends == 2 else near[1:] if near[0] <= 0 else near[:1]
    return hypothesis.placed([own], STRENGTHS)
