"""What may be missing, ranked: each hypothesis is fitted together with the model's own numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda._core import Solo
from joda.component import Component
from joda.hypotheses import Hypothesis, Units
from joda.judge import BEND, Fit, Judge, Linear, Make, Unknowns
from joda.profile import CHANNELS, Profile
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
FEW = 4
"""Iterations after that."""
ROUGH = 6
"""Iterations in which windows that are far off count in full."""
BEST = 3
"""How many trials of a hypothesis are fitted."""
APART = 0.06
"""How much these must differ in one of their numbers."""
EXPLAINED = 0.8
"""Part of the knocks' excess that bouncy ends must explain."""


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


def units_of(windows: Windows, base: Base, profile: Profile, forced: bool, weight: float) -> Units:
    """The joint's own units, from the measured motion."""
    inertia = base.single.inertia
    velocity = windows.start[:, 1]
    same = ~windows.fresh[1:]
    pace = np.diff(windows.at)[same] * windows.h
    acceleration = np.diff(velocity)[same] / pace
    speed = float(np.sqrt(np.mean(velocity**2)))
    pushed = float(np.sqrt(np.mean(windows.force**2)))
    force = max(pushed, inertia * float(np.sqrt(np.mean(acceleration**2))))
    friction = max((max(c.y) for c in profile.channels.friction.components), default=0.0)
    return Units(
        force=force or inertia,
        speed=speed or 1.0,
        inertia=inertia,
        span=float(np.ptp(profile.joint.range)),
        friction=friction,
        forced=forced,
        weight=weight,
        hinge=base.single.hinge,
    )


@dataclass(frozen=True)
class Guess:
    """A hypothesis, fitted.

    Attributes:
        hypothesis: what is missing.
        fit: of the model's factors and the hypothesis' numbers.
    """

    hypothesis: Hypothesis
    fit: Fit


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
        taken = np.linalg.solve(H, np.stack([gradient, across], axis=1)) if len(H) else np.zeros((0, 2))
        slope = about.products(about.r[:, :, None], d, about.z[:, :, None])[0, 0] - across @ taken[:, 0]
        bend = about.products(d, d)[0, 0] - across @ taken[:, 1]
        amount = -slope / max(bend, 1e-12)
        gains.append(slope**2 / max(bend, 1e-12) if amount > 0 else 0.0)
        first = trial.copy()
        first[0] = np.clip(trial[0] * np.clip(amount, 0.3, 30.0), hypothesis.unknowns.low[0], hypothesis.unknowns.high[0])
        out.append(first)
    order = np.argsort(gains)[::-1]
    chosen: list[int] = []
    for k in order:
        if len(chosen) == BEST:
            break
        apart = [np.abs(hypothesis.trials[k] - hypothesis.trials[c])[1:].max(initial=0.0) for c in chosen]
        if min(apart, default=1.0) > APART:
            chosen.append(int(k))
    return [out[k] for k in chosen]


def knock_guess(judge: Judge, base: Base, fit: Fit, hypothesis: Hypothesis) -> Guess | None:
    """How bouncy the ends are, by the windows with knocks; they tell of nothing else."""
    knocks = judge.windows.knocks & (judge.windows.count >= LEAST)
    if knocks.sum() < KNOCKS:
        return None
    own = Judge(judge.windows, knocks)
    profile = base.written(fit.x)
    none = hypothesis.unknowns.part(0)

    def make(x: Array) -> Solo:
        return base.single.solo(hypothesis.write(profile, x) if len(x) else profile, base.h)

    soft = own.fit(make, none, np.zeros(0), fit.start, 6)
    fits = [own.fit(make, hypothesis.unknowns, trial, fit.start, 6) for trial in hypothesis.trials]
    best = min(fits, key=lambda f: f.loss)
    least = own.loss(judge.windows.count.astype(float))
    if best.loss - least > (1 - EXPLAINED) * (soft.loss - least):
        return None
    whole = Fit(
        np.concatenate([fit.x, best.x]),
        np.where(knocks[:, None], best.start, fit.start),
        np.where(knocks, best.squares, fit.squares),
        fit.loss - soft.loss + best.loss,
    )
    return Guess(hypothesis, whole)


def guess(
    judge: Judge, base: Base, fit: Fit, about: Linear, hypothesis: Hypothesis
) -> Guess | None:
    """The hypothesis fitted, from its most promising trials; None if the data cannot tell."""
    if hypothesis.effect == "end_stop_restitution":
        return knock_guess(judge, base, fit, hypothesis)
    make, unknowns = joined(base, hypothesis)
    usual = float(np.median((fit.squares / np.maximum(judge.windows.count, 1))[judge.counts]))
    wide = BEND * max(usual, 1.0)

    def fitted(x: Array, start: Array) -> Fit:
        near = judge.fit(make, unknowns, x, start, ROUGH, wide)
        return judge.fit(make, unknowns, near.x, near.start)

    fits = [
        fitted(np.concatenate([fit.x, trial]), fit.start)
        for trial in screened(judge, base, fit, about, hypothesis)
    ]
    return Guess(hypothesis, min(fits, key=lambda f: f.loss))


def joined(base: Base, hypothesis: Hypothesis) -> tuple[Make, Unknowns]:
    """The model's factors and the hypothesis' numbers as one vector."""
    n = len(base.places)

    def make(x: Array) -> Solo:
        return base.single.solo(hypothesis.write(base.written(x[:n]), x[n:]), base.h)

    return make, base.unknowns.and_(hypothesis.unknowns)


def moved(judge: Judge, base: Base, found: Guess) -> Guess:
    """The guess after its interval's ends were tried elsewhere: a fit does not see across an edge
    that few windows cross."""
    make, unknowns = joined(base, found.hypothesis)
    best = found.fit
    for by in MOVES:
        for k in range(len(best.x) - found.hypothesis.ends, len(best.x)):
            for way in (-by, by):
                x = best.x.copy()
                x[k] += way
                trial = judge.fit(make, unknowns, x, best.start, FEW)
                if trial.loss < best.loss - 1:
                    best = judge.fit(make, unknowns, trial.x, trial.start)
    return Guess(found.hypothesis, best)
