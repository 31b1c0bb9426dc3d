"""Adds an effect to a joint's profile and fits everything together.

First the effect's few numbers with the model's strengths; then every control point, interval and
number, each near where it was; in windows that grow longer, as what is right in short ones is a
good start for longer ones. What is written is what does best on runs that no fit has seen.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from joda._templates import templates
from joda.baseline import base_of, units_of, usable, windows_for
from joda.comparison import Measured, joined, rms
from joda.guessing import guess, moved, usual
from joda.hypotheses import Hypothesis, hypotheses
from joda.judge import BEND, Judge, Unknowns
from joda.parameters import Parameters
from joda.profile import Profile
from joda.ranking import tell
from joda.runs import Run

Array = NDArray[np.float64]

LONGER = (1.0, 3.0, 9.0)
"""Lengths of windows, in units of the diagnosis' own."""
NEARLY = 0.95
"""Part of another error from which one is clearly less."""
ROUNDS = 6
"""Iterations with each length."""
STRENGTHS = (1.0, 3.0, 10.0)
"""Of an effect whose place is known: the trials, in units of the usual one."""
NUDGE = 0.004
"""Step of a number for differences, in its own unit."""
FEWEST = 4
"""Runs from which every fourth is held out; of fewer, the last quarter of each."""


@dataclass(frozen=True)
class Error:
    """How far a model is off, rad or m.

    Attributes:
        whole: RMS of open-loop replays of whole runs.
        window: RMS of windows of 0.4 s.
    """

    whole: float
    window: float


@dataclass(frozen=True)
class Mended:
    """A profile with an effect more.

    Attributes:
        profile: the whole one (`joda.native`).
        effect: that was added; None if nothing did better than the model as it was.
        before, after: errors on runs held out of the fit.
    """

    profile: Profile
    effect: str | None
    before: Error
    after: Error


def parted(measured: Measured) -> tuple[Measured, Measured]:
    """The runs to fit, and those held out: every fourth, or of few runs each one's last quarter."""
    count = len(measured.runs)
    if count >= FEWEST:
        held = list(range(3, count, 4))
        kept = [k for k in range(count) if k not in held]
        return measured.changed(runs=kept), measured.changed(runs=held)
    cuts = [3 * len(run.time) // 4 for run in measured.runs]
    first = tuple(_cut(run, slice(0, at)) for run, at in zip(measured.runs, cuts, strict=True))
    last = tuple(_cut(run, slice(at, None)) for run, at in zip(measured.runs, cuts, strict=True))
    return measured.with_runs(first), measured.with_runs(last)


def _cut(run: Run, part: slice) -> Run:
    velocity = None if run.velocity is None else run.velocity[part]
    return Run(run.name, run.time[part], run.position[part], velocity, run.force[part], run.forced)


def error(measured: Measured, profile: Profile | None = None) -> Error:
    """How far the model, or another profile, is off in MuJoCo with the plugin."""
    one = measured if profile is None else measured.changed(profile)
    wholes, windows = [], []
    for run, sigma in zip(one.runs, one.sigma, strict=True):
        path = one.replayer.whole(run, sigma) - run.position
        wholes.append(path[~np.isnan(path)])
        windows.append(joined(one.replayer.windows(run, sigma)))
    return Error(rms(np.concatenate(wholes)), rms(np.concatenate(windows)))


def mend(
    train: Measured,
    held: Measured,
    effect: str,
    direction: str | None = None,
    near: tuple[float, float] | None = None,
    told: Callable[[str], None] = lambda what: None,
) -> Mended:
    """Adds an effect, if that lowers the error on runs held out.

    Args:
        train: the joint, its profile as it is, and runs to fit.
        held: the same with runs held out.
        effect: its name.
        direction: of the effect, if it is known.
        near: where it is, in normalised position, if that is known.
        told: what is being done.
    """
    before = error(held)
    best: tuple[Profile, Error] | None = None
    for profile in _candidates(train, effect, direction, near, told):
        after = error(held, profile)
        if after.window < before.window and (best is None or _better(after, best[1])):
            best = profile, after
    if best is None:
        return Mended(train.profile, None, before, before)
    return Mended(best[0], effect, before, best[1])


def _better(one: Error, other: Error) -> bool:
    """Clearly less in windows; or hardly more there, and less in whole runs."""
    return one.window < NEARLY * other.window or (
        one.window < other.window / NEARLY and one.whole < other.whole
    )


def _candidates(
    train: Measured,
    effect: str,
    direction: str | None,
    near: tuple[float, float] | None,
    told: Callable[[str], None],
) -> Iterator[Profile]:
    """Profiles with the effect, fitted further and further."""
    told("the effect's own numbers")
    windows = windows_for(train)
    judge = Judge(windows, usable(windows))
    base = base_of(train.profile, train.single, windows.h)
    fit = judge.fit(base.solo, base.unknowns, np.ones(len(base.places)))
    about = judge.linear(base.solo, base.unknowns, fit.x, fit.start, BEND * usual(judge, fit))
    units = units_of(windows, train)
    every = [h for h in hypotheses(units, templates(), train.profile) if h.effect == effect]
    tried = [h for h in every if direction in (None, h.direction)] or every
    guesses = [g for h in tried if (g := tell(judge, base, fit, about, h))]
    guesses += [guess(judge, base, fit, about, there) for h in tried if (there := _placed(h, near))]
    if not guesses:
        return
    first = moved(judge, base, min(guesses, key=lambda g: g.score))
    n = len(base.places)
    profile = first.hypothesis.write(base.written(first.fit.x[:n]), first.x)
    yield checked(profile)
    for factor in LONGER:
        told(f"everything together, windows of {factor * windows.length:.2g} s")
        profile = refitted(train, profile, factor * windows.length)
        yield checked(profile)


def _placed(hypothesis: Hypothesis, near: tuple[float, float] | None) -> Hypothesis | None:
    """A hypothesis that begins at an interval, with several strengths; None if it has none."""
    ends = hypothesis.ends
    if near is None or not ends:
        return None
    own = near if ends == 2 else near[1:] if near[0] <= 0 else near[:1]
    trials = np.repeat(hypothesis.trials[:1], len(STRENGTHS), axis=0)
    trials[:, 0] *= STRENGTHS
    trials[:, -ends:] = own
    return replace(hypothesis, trials=trials)


def checked(profile: Profile) -> Profile:
    """The profile, validated as one from a file."""
    return Profile.model_validate(profile.model_dump(exclude={"schema_version"}))


def refitted(train: Measured, profile: Profile, length: float) -> Profile:
    """All numbers of a profile fitted in windows of some length (s), near where they were."""
    windows = windows_for(train, length, fine=False)  # at the scene's own step
    judge = Judge(windows, usable(windows))
    if not judge.counts.any():
        return profile
    parameters = Parameters(checked(profile), ("values", "intervals", "effects"))
    n = len(parameters.start)
    if not n:
        return profile
    unbounded = np.full(n, np.inf)
    unknowns = Unknowns(
        -unbounded,
        unbounded,
        np.full(n, NUDGE),
        parameters.start,
        parameters.doubt,
        parameters.constraints,
    )
    single, h = train.single, windows.h
    fit = judge.fit(
        lambda theta: single.solo(parameters.written(theta, exact=True), h),
        unknowns,
        parameters.start,
        iterations=ROUNDS,
    )
    return parameters.written(fit.x)
