"""A hypothesis fitted together with the model's own strengths, from where it promises most."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from joda.diagnosis.balance import balanced
from joda.diagnosis.baseline import Base, joined
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.hypotheses.base import FREE_CURVE
from joda.diagnosis.judge import BEND, Fit, Judge, Linear, Make, Unknowns
from joda.profile import Profile

Array = NDArray[np.float64]

MOVES = (0.1, 0.04, 0.015)
"""How far ends of intervals are moved on trial, in normalised position."""
FAR = 10.0
"""How far other numbers are moved, in their steps."""
AS_GOOD = 1.0
"""How much more loss is as good."""
WIDE = 2.0
"""How far a search begins to look, in those."""
SEARCHED, SETTLING = 15, 4
"""Models that it tries for each number, and iterations that fit the starts of one."""
FEW = 4
"""Iterations after that."""
ROUGH = 6
"""Iterations in which windows that are far off count in full."""
BEST = 3
"""How many trials of a hypothesis with many are fitted."""
APART = 0.06
"""How much these must differ in one of their numbers."""
OFF = 0.1
"""How far off a factor of the model's own strengths is that may stand in for what is missing."""
NOTHING = 0.1
"""Part of its step below which a strength is none."""
LOST = 10.0
"""Mean square residual of windows, in the median, from which a model's fit leads nowhere."""
MANY = 4000
"""Samples that count as many: from there on, what was fitted first is hardly in the way."""


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

    @property
    def vanished(self) -> bool:
        """Whether it is hardly there, no more than a simpler effect, or beyond the widest of its
        bounds: something else fits."""
        unknowns = self.hypothesis.unknowns
        least = 1.01 * unknowns.low[0] or NOTHING * unknowns.step[0]
        hardly = self.hypothesis.remains != FREE_CURVE and least > 0 and self.x[0] < least
        return bool(hardly or unknowns.pressed(self.x) or not self.hypothesis.itself(self.x))

    def written(self, base: Base) -> Profile:
        """The model's profile with the effect."""
        return self.hypothesis.write(base.written(self.fit.x), self.x)


@dataclass(frozen=True)
class Begin:
    """The model without a hypothesis, from where that is fitted.

    Attributes:
        fit: of the model's factors.
        bend: mean square residual from which a window counts as its logarithm at first.
        about: the model there, linear.
    """

    fit: Fit
    bend: float
    about: Linear


def begins(judge: Judge, base: Base, given: Fit, fit: Fit) -> tuple[Begin, ...]:
    """From the model as it was fitted, and of few samples as it was given, where that is far off.

    A factor that is far off may stand in for what is missing; many samples lead back from there.
    """
    far = judge.samples < MANY and np.any(np.abs(fit.x - given.x) > OFF)
    fits = [fit, given] if far else [fit]
    wide = [BEND * usual(judge, one) for one in fits]
    return tuple(
        Begin(one, bend, judge.linear(base.solo, base.unknowns, one.x, one.start, bend))
        for one, bend in zip(fits, wide, strict=True)
    )


def screened(judge: Judge, base: Base, begin: Begin, hypothesis: Hypothesis) -> list[Array]:
    """The most promising trials, by the gain that a small strength promises."""
    if len(hypothesis.trials) == 1:
        return list(hypothesis.trials)
    windows, fit, about = judge.windows, begin.fit, begin.about
    profile = base.written(fit.x)
    H, gradient = about.normal()
    H = H + np.diag(base.unknowns.doubt**-2.0)
    gains, out = [], []
    for trial in hypothesis.trials:
        solo = base.with_profile(hypothesis.write(profile, trial), fit.x)
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
            trial[0] * np.clip(amount, 0.3, 300.0),
            hypothesis.unknowns.low[0],
            hypothesis.unknowns.high[0],
        )
        out.append(first)
    if len(out) <= BEST + 1:
        return out
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


def rough(
    judge: Judge, base: Base, begun: Sequence[Begin], hypothesis: Hypothesis
) -> tuple[Fit, ...]:
    """The hypothesis fitted roughly: from each begin, its most promising trials."""
    make, unknowns = joined(base, hypothesis)

    def best(begin: Begin, trials: Sequence[Array], kept: int) -> list[Fit]:
        starts = (np.concatenate([begin.fit.x, x]) for x in trials)
        fits = [_leaving(judge, make, unknowns, x, begin) for x in starts]
        near = [
            replace(fit, loss=judge.loss(fit.squares) + unknowns.penalty(fit.x)) for fit in fits
        ]
        return sorted(near, key=lambda f: f.loss)[:kept]

    found = [
        fit
        for begin in begun
        for fit in best(begin, screened(judge, base, begin, hypothesis), hypothesis.kept)
    ]
    windows, first = judge.windows, begun[0]
    if usual(judge, first.fit) >= LOST and windows.pushed:
        given = replace(first.fit, x=base.unknowns.mean, start=windows.start)
        found += best(replace(first, fit=given), balanced(windows, base, hypothesis), 1)
    return tuple(found)


def _leaving(judge: Judge, make: Make, unknowns: Unknowns, x: Array, begin: Begin) -> Fit:
    """A rough fit; where no step from x is better as a whole, each window's start stays if that is
    better."""
    line = make, unknowns, x, begin.fit.start, ROUGH, begin.bend
    fit = judge.fit(*line)
    return replace(judge, apart=True).fit(*line) if np.array_equal(fit.x, x) else fit


def finished(judge: Judge, base: Base, hypothesis: Hypothesis, near: Sequence[Fit]) -> Guess:
    """The hypothesis fitted to the end, from rough fits; where it is pressed against a bound that
    is only usual, within wider ones again."""
    make, unknowns = joined(base, hypothesis)
    fits = [
        judge.refit(make, unknowns, judge.fit(make, unknowns, fit.x, fit.start)) for fit in near
    ]
    found = guessed(judge, hypothesis, min(fits, key=lambda f: f.loss))
    wider = hypothesis.unknowns.widened()
    if not hypothesis.unknowns.pressed(found.x) or wider is hypothesis.unknowns:
        return _free(judge, base, found)
    return finished(judge, base, replace(hypothesis, unknowns=wider), [found.fit])


def beside(hypothesis: Hypothesis, found: Guess) -> Hypothesis:
    """One with a place, to be tried where another was found, and twice as far to either side."""
    low, high = found.x[-2:]
    wide = high - low
    longer = (low, min(high + wide, 1.0)), (max(low - wide, 0.0), high)
    return hypothesis.placed([(low, high), *longer])


def moved(judge: Judge, base: Base, found: Guess) -> Guess:
    """The guess after its numbers were tried elsewhere: a fit does not see across an edge that few
    windows cross, nor past a speed at which the joint begins to stick."""
    make, unknowns = joined(base, found.hypothesis)
    best = found.fit
    n = len(best.x)
    first = base.count
    places = [(k, by) for by in MOVES for k in range(n - found.hypothesis.ends, n)]
    shapes = [(k, FAR * unknowns.step[k]) for k in range(first, n - found.hypothesis.ends)]
    for k, by in places + shapes:
        for way in (-by, by):
            x = best.x.copy()
            x[k] += way
            trial = judge.fit(make, unknowns, x, best.start, FEW)
            if trial.loss < best.loss - 1:
                best = judge.fit(make, unknowns, trial.x, trial.start)
    return _free(judge, base, guessed(judge, found.hypothesis, judge.refit(make, unknowns, best)))


def _free(judge: Judge, base: Base, found: Guess) -> Guess:
    """The guess off the bounds that its numbers are pressed against, if it is as good there."""
    hypothesis = found.hypothesis
    if not hypothesis.unknowns.pressed(found.x):
        return found
    make, unknowns = joined(base, replace(hypothesis, unknowns=hypothesis.unknowns.inside()))
    fit = judge.fit(make, unknowns, found.fit.x, found.fit.start)
    return guessed(judge, hypothesis, fit) if fit.loss < found.fit.loss + AS_GOOD else found


def searched(judge: Judge, base: Base, found: Guess) -> Guess:
    """The guess after a search without derivatives (Nelder and Mead 1965), in which every window's
    start is fitted anew: where a joint sticks and slips, the loss is jagged."""
    make, unknowns = joined(base, found.hypothesis)
    scale, k = FAR * unknowns.step, len(unknowns.step)

    def at(z: Array) -> Array:
        return np.clip(found.fit.x + scale * z, unknowns.low, unknowns.high)

    def loss(z: Array) -> float:
        return judge.started(make(at(z)), SETTLING).loss + unknowns.penalty(at(z))

    simplex = np.vstack([np.zeros(k), WIDE * np.eye(k)])
    options = {"maxfev": SEARCHED * k, "initial_simplex": simplex}
    x = at(minimize(loss, np.zeros(k), method="Nelder-Mead", options=options).x)
    fit = judge.refit(make, unknowns, judge.fit(make, unknowns, x, judge.started(make(x)).start))
    return guessed(judge, found.hypothesis, min(found.fit, fit, key=lambda one: one.loss))


def guessed(judge: Judge, hypothesis: Hypothesis, fit: Fit) -> Guess:
    """A fit of a hypothesis, with what its numbers cost."""
    samples = judge.samples
    cost = hypothesis.rarity + len(hypothesis.unknowns.low) * np.log(max(samples, 2.0))
    return Guess(hypothesis, fit, fit.loss + cost, cost)


def usual(judge: Judge, fit: Fit) -> float:
    """Mean square residual of the windows, in the median; at least 1."""
    each = (fit.squares / np.maximum(judge.windows.count, 1))[judge.counts]
    return max(float(np.median(each)), 1.0) if len(each) else 1.0
