"""What may be missing, ranked: each hypothesis is fitted together with the model's own numbers."""

from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from os import cpu_count

import numpy as np
from numpy.typing import NDArray

from joda._core import Solo
from joda._templates import templates
from joda.comparison import Measured
from joda.cutting import windows_of
from joda.hypotheses import Hypothesis, Units, hypotheses
from joda.judge import BEND, NOTHING, Fit, Judge, Linear, Make, Unknowns
from joda.profile import CHANNELS, Channels, Profile
from joda.single import Single
from joda.windows import Windows

Array = NDArray[np.float64]

BASE_DOUBT = 0.15
"""How far off (one standard deviation, relative) the model's own strengths may be."""
LEAST = 4
"""Fewest samples of a window that counts."""
KNOCKS = 2
"""Fewest windows with knocks that tell of the ends."""
MOVES = (0.1, 0.04, 0.015)
"""How far ends of intervals are moved on trial, in normalised position."""
FAR = 10.0
"""How far other numbers are moved, in their steps."""
FEW = 4
"""Iterations after that."""
ROUGH = 6
"""Iterations in which windows that are far off count in full."""
BEST = 3
"""How many trials of a hypothesis are fitted."""
APART = 0.06
"""How much these must differ in one of their numbers."""
POLISHED = 4
"""Of how many effects the numbers are tried elsewhere."""
CALM = 0.3
"""Part of the windows, the better ones, that tell the noise."""
WORST = 1.5
"""Mean square residual that noise may make."""
QUIET = 0.5
"""The least: noise is not estimated better."""
BOUNCY = 0.3
"""Least speed after a knock, per speed before, of ends that throw the joint back."""
CLEARLY = 0.15
"""How much more that is than the model's."""
AROUND = 5
"""Samples before and after a knock that tell its speeds."""
KNOCK_TIME = 0.6
"""In which a joint goes through its range towards a knock, s."""


@dataclass(frozen=True)
class Base:
    """The model as it is, with a factor for each of its components' strengths.

    Attributes:
        profile: of the joint.
        single: the joint.
        h: step, s.
        places: channel and number of each component that has a factor.
        unknowns: the factors.
    """

    profile: Profile
    single: Single
    h: float
    places: tuple[tuple[str, int], ...]
    unknowns: Unknowns

    def written(self, x: Array) -> Profile:
        """The profile with its factors."""
        channels = {}
        for name in CHANNELS:
            channel = getattr(self.profile.channels, name)
            parts = list(channel.components)
            for (where, number), factor in zip(self.places, x, strict=True):
                if where == name:
                    old = parts[number]
                    y = tuple(float(factor) * value for value in old.y)
                    parts[number] = old.model_copy(update={"y": y})
            channels[name] = channel.model_copy(update={"components": tuple(parts)})
        return self.profile.model_copy(
            update={"channels": self.profile.channels.model_copy(update=channels)}
        )

    def solo(self, x: Array) -> Solo:
        """The joint with its factors."""
        return self.single.solo(self.written(x), self.h)


def base_of(profile: Profile, single: Single, h: float) -> Base:
    """The model as it is."""
    places = tuple(
        (name, number)
        for name in CHANNELS
        for number, part in enumerate(getattr(profile.channels, name).components)
        if any(part.y)
    )
    k = len(places)
    unknowns = Unknowns(
        np.zeros(k), np.full(k, 20.0), np.full(k, 0.01), np.ones(k), np.full(k, BASE_DOUBT)
    )
    return Base(profile, single, h, places, unknowns)


def units_of(windows: Windows, measured: Measured) -> Units:
    """The joint's own units, from the measured motion."""
    profile, inertia = measured.profile, measured.single.inertia
    velocity = windows.start[:, 1]
    same = ~windows.fresh[1:]
    pace = np.diff(windows.at)[same] * windows.h
    acceleration = np.diff(velocity)[same] / pace
    speed = float(np.sqrt(np.mean(velocity**2)))
    pushed = float(np.sqrt(np.mean(windows.force**2)))
    force = max(pushed, inertia * float(np.sqrt(np.mean(acceleration**2))) if len(pace) else 0.0)
    friction = max((max(c.y) for c in profile.channels.friction.components), default=0.0)
    return Units(
        force=force or inertia,
        speed=speed or 1.0,
        inertia=inertia,
        span=float(np.ptp(profile.joint.range)),
        friction=friction,
        forced=any(run.forced for run in measured.runs),
        weight=max(map(abs, measured.context.gravity_force)),
        hinge=measured.single.hinge,
    )


@dataclass(frozen=True)
class Guess:
    """A hypothesis, fitted.

    Attributes:
        hypothesis: what is missing.
        fit: of the model's factors and the hypothesis' numbers.
        score: its loss, and what its numbers cost.
        cost: of its numbers.
    """

    hypothesis: Hypothesis
    fit: Fit
    score: float
    cost: float

    @property
    def x(self) -> Array:
        """The hypothesis' numbers."""
        return self.fit.x[-len(self.hypothesis.unknowns.low) :]


def screened(
    judge: Judge, base: Base, fit: Fit, about: Linear, hypothesis: Hypothesis
) -> list[Array]:
    """The most promising trials, by the gain that a small strength promises."""
    if len(hypothesis.trials) == 1:
        return list(hypothesis.trials)
    windows = judge.windows
    profile = base.written(fit.x)
    H, gradient = about.normal()
    H = H + np.diag(base.unknowns.doubt**-2.0)
    gains, out = [], []
    for trial in hypothesis.trials:
        solo = base.single.solo(hypothesis.write(profile, trial), base.h)
        d = (windows.residuals(windows.misfit(solo, fit.start)) - about.r)[:, :, None]
        across = about.products(d, about.J)[0]
        taken = (
            np.linalg.solve(H, np.stack([gradient, across], axis=1)) if len(H) else np.zeros((0, 2))
        )
        slope = (
            about.products(about.r[:, :, None], d, about.z[:, :, None])[0, 0] - across @ taken[:, 0]
        )
        bend = about.products(d, d)[0, 0] - across @ taken[:, 1]
        amount = -slope / max(bend, 1e-12)
        gains.append(slope**2 / max(bend, 1e-12) if amount > 0 else 0.0)
        first = trial.copy()
        first[0] = np.clip(
            trial[0] * np.clip(amount, 0.3, 30.0),
            hypothesis.unknowns.low[0],
            hypothesis.unknowns.high[0],
        )
        out.append(first)
    order = np.argsort(gains)[::-1]
    chosen: list[int] = []
    for k in order:
        if len(chosen) == BEST:
            break
        apart = [
            np.abs(hypothesis.trials[k] - hypothesis.trials[c])[1:].max(initial=0.0) for c in chosen
        ]
        if min(apart, default=1.0) > APART:
            chosen.append(int(k))
    return [out[k] for k in chosen]


def knock_guess(judge: Judge, base: Base, fit: Fit, hypothesis: Hypothesis) -> Guess | None:
    """How bouncy the ends are, by the windows with knocks; they tell of nothing else.

    None if the joint does not come back from the ends clearly faster than the model does.
    """
    windows = judge.windows
    knocks = windows.knocks & (windows.count >= LEAST)
    own = Judge(windows, knocks)
    profile = base.written(fit.x)

    def make(x: Array) -> Solo:
        return base.single.solo(hypothesis.write(profile, x) if len(x) else profile, base.h)

    soft = own.fit(make, NOTHING, np.zeros(0), fit.start, ROUGH)
    measured = rebounds(windows, knocks, windows.position)
    if len(measured) < KNOCKS or np.median(measured) < BOUNCY:
        return None
    if np.median(measured) < rebound(base) + CLEARLY:
        return None
    trials = [*hypothesis.trials, [np.median(measured)]]
    fits = [own.fit(make, hypothesis.unknowns, np.array(x), fit.start, ROUGH) for x in trials]
    best = min(fits, key=lambda f: f.loss)
    whole = Fit(
        np.concatenate([fit.x, best.x]),
        np.where(knocks[:, None], best.start, fit.start),
        np.where(knocks, best.squares, fit.squares),
        fit.loss - soft.loss + best.loss,
    )
    return _guess(judge, hypothesis, whole)


def rebound(base: Base) -> float:
    """Speed after a knock, per speed before, of the model."""
    profile = base.profile.model_copy(update={"channels": Channels()})
    lo, hi = profile.joint.range
    steps, speed = round(KNOCK_TIME / base.h), (hi - lo) / KNOCK_TIME
    start = np.array([[hi - 0.2 * (hi - lo), speed]])
    begin = np.zeros(1, np.int64)
    solo = base.single.without_weight().solo(profile, base.h)
    before, after = solo.replay(np.zeros(steps), begin, start, np.ones(1, bool), base.h)
    return float((before[-1] - after[-1]) / base.h / speed)


def rebounds(windows: Windows, knocks: NDArray[np.bool_], position: Array) -> Array:
    """Speed after per speed before, of the first knock in each window; shape (knocks,)."""
    out = []
    for row in windows.rows[knocks]:
        own = row[row >= 0]
        t, y = windows.time[own], position[own]
        turns = np.flatnonzero(np.diff(np.sign(np.diff(y))) != 0) + 1
        turns = turns[(turns >= AROUND) & (turns < len(own) - AROUND)]
        if not len(turns):
            continue
        k = turns[np.argmax(np.abs(y[turns] - y[0]))]
        before = np.polyfit(t[k - AROUND : k], y[k - AROUND : k], 1)[0]
        after = np.polyfit(t[k + 1 : k + 1 + AROUND], y[k + 1 : k + 1 + AROUND], 1)[0]
        if before:
            out.append(-after / before)
    return np.array(out)


def guess(
    judge: Judge, base: Base, fit: Fit, about: Linear, hypothesis: Hypothesis
) -> Guess | None:
    """The hypothesis fitted, from its most promising trials; None if the data cannot tell."""
    if hypothesis.effect == "end_stop_restitution":
        return knock_guess(judge, base, fit, hypothesis)
    make, unknowns = joined(base, hypothesis)
    wide = BEND * usual(judge, fit)

    rough = [
        judge.fit(make, unknowns, np.concatenate([fit.x, trial]), fit.start, ROUGH, wide)
        for trial in screened(judge, base, fit, about, hypothesis)
    ]
    near = min(rough, key=lambda f: judge.loss(f.squares))
    return _guess(judge, hypothesis, judge.fit(make, unknowns, near.x, near.start))


def joined(base: Base, hypothesis: Hypothesis) -> tuple[Make, Unknowns]:
    """The model's factors and the hypothesis' numbers as one vector."""
    n = len(base.places)

    def make(x: Array) -> Solo:
        return base.single.solo(hypothesis.write(base.written(x[:n]), x[n:]), base.h)

    return make, base.unknowns.and_(hypothesis.unknowns)


def moved(judge: Judge, base: Base, found: Guess) -> Guess:
    """The guess after its numbers were tried elsewhere: a fit does not see across an edge that few
    windows cross, nor past a speed at which the joint begins to stick."""
    make, unknowns = joined(base, found.hypothesis)
    best = found.fit
    n = len(best.x)
    first = len(base.places)
    places = [(k, by) for by in MOVES for k in range(n - found.hypothesis.ends, n)]
    shapes = [(k, FAR * unknowns.step[k]) for k in range(first, n - found.hypothesis.ends)]
    for k, by in places + shapes:
        for way in (-by, by):
            x = best.x.copy()
            x[k] += way
            trial = judge.fit(make, unknowns, x, best.start, FEW)
            if trial.loss < best.loss - 1:
                best = judge.fit(make, unknowns, trial.x, trial.start)
    return _guess(judge, found.hypothesis, best)


def _guess(judge: Judge, hypothesis: Hypothesis, fit: Fit) -> Guess:
    samples = float(judge.windows.count[judge.counts].sum())
    cost = hypothesis.rarity + len(hypothesis.unknowns.low) * np.log(max(samples, 2.0))
    return Guess(hypothesis, fit, fit.loss + cost, cost)


def _levelled(judge: Judge, guesses: Sequence[Guess]) -> tuple[list[Guess], float, float]:
    """The guesses, scored by what the best of them leaves in its better windows.

    Recorded noise is often less than all that a simulation cannot follow: clocks, forces, whatever
    else is a little wrong. Such a misfit is all of one piece within a window, which then counts as
    one sample.

    Returns:
        the guesses; the mean square residual that is noise; how many samples count.
    """
    samples = float(judge.windows.count[judge.counts].sum())
    if not guesses or not samples:
        return [], 1.0, samples
    best = min(guesses, key=lambda g: g.score).fit.squares
    each = (best / np.maximum(judge.windows.count, 1))[judge.counts]
    level = max(float(np.quantile(each, CALM)), QUIET)
    told = float(judge.counts.sum()) if level > WORST else samples

    def scored(one: Guess) -> Guess:
        penalty = one.fit.loss - judge.loss(one.fit.squares)
        loss = judge.loss(one.fit.squares, level=level) * told / samples
        cost = one.hypothesis.rarity + len(one.x) * np.log(max(told, 2.0))
        return replace(one, score=loss + penalty + cost)

    return [scored(one) for one in guesses], level, told


@dataclass(frozen=True)
class Ranking:
    """What may be missing from a model.

    Attributes:
        judge: of the windows.
        base: the model as it is.
        fit: of its factors alone.
        guesses: the best one of each effect, the most likely first.
        level: mean square residual that counts as noise.
        told: how many samples count.
    """

    judge: Judge
    base: Base
    fit: Fit
    guesses: tuple[Guess, ...]
    level: float
    told: float


Told = Callable[[int, int, str], None]


def rank(
    measured: Measured,
    length: float | None = None,
    exclude: Collection[str] = (),
    heed: Told = lambda done, total, what: None,
) -> Ranking:
    """Fits every hypothesis to measured runs.

    Args:
        measured: the joint and its runs.
        length: of the windows, s; None: by the joint's pace.
        exclude: effects that are not tried.
        heed: told how many hypotheses are done, of how many, and the last one's name.
    """
    windows = windows_for(measured, length)
    judge = Judge(windows, usable(windows))
    base = base_of(measured.profile, measured.single, windows.h)
    fit = judge.fit(base.solo, base.unknowns, np.ones(len(base.places)))
    about = judge.linear(base.solo, base.unknowns, fit.x, fit.start, BEND * usual(judge, fit))
    units = units_of(windows, measured)
    tried = [h for h in hypotheses(units, templates(), measured.profile) if h.effect not in exclude]
    total = len(tried) + POLISHED
    done = 0

    def heard(found: Iterable[Guess | None]) -> list[Guess]:
        nonlocal done
        out = []
        for one in found:
            done += 1
            if one is not None:
                heed(done, total, one.hypothesis.effect)
                out.append(one)
        return out

    with ThreadPoolExecutor(cpu_count()) as pool:
        guesses = heard(pool.map(lambda h: guess(judge, base, fit, about, h), tried))
        best = _best(guesses)[:POLISHED]
        guesses += heard(pool.map(lambda g: moved(judge, base, g), best))
    scored, level, told = _levelled(judge, guesses)
    return Ranking(judge, base, fit, tuple(_best(scored)), level, told)


def windows_for(measured: Measured, length: float | None = None) -> Windows:
    """The runs in windows."""
    lo, hi = measured.profile.joint.range
    return windows_of(
        measured.runs,
        measured.sigma,
        hi - lo,
        lo,
        measured.single.inertia,
        measured.timestep,
        length,
    )


def usable(windows: Windows) -> NDArray[np.bool_]:
    """Which windows tell of the joint: enough samples, and no knock at an end of the range."""
    return np.asarray((windows.count >= LEAST) & ~windows.knocks)


def usual(judge: Judge, fit: Fit) -> float:
    """Mean square residual of the windows, in the median; at least 1."""
    each = (fit.squares / np.maximum(judge.windows.count, 1))[judge.counts]
    return max(float(np.median(each)), 1.0) if len(each) else 1.0


def _best(guesses: Iterable[Guess]) -> list[Guess]:
    """The best guess of each effect, the lowest score first."""
    best: dict[str, Guess] = {}
    for one in sorted(guesses, key=lambda g: g.score):
        best.setdefault(one.hypothesis.effect, one)
    return list(best.values())
