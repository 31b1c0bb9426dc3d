"""How bouncy the ends of the range are: by the windows with knocks, which tell of nothing else."""

import numpy as np
from numpy.typing import NDArray

from joda._core import Solo
from joda.diagnosis.baseline import LEAST, Base
from joda.diagnosis.guessing import ROUGH, Guess, guessed
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.judge import NOTHING, Fit, Judge
from joda.diagnosis.windows import Windows
from joda.joints.single import Single
from joda.profile import Channels

Array = NDArray[np.float64]

KNOCKS = 2
"""Fewest knocks at an end that tell of it."""
CLEARLY, SURELY = 0.07, 3.0
"""How much more of its speed an end must throw back than the model's: at the least, and in standard
errors."""
AROUND = 5
"""Samples before and after a knock that tell its speeds."""
KNOCK_TIME = 0.6
"""In which a joint goes through its range towards a knock, s."""


def knock_guess(
    judge: Judge, base: Base, given: Single, fit: Fit, hypothesis: Hypothesis
) -> Guess | None:
    """How bouncy an end is, or both, by the windows with knocks there.

    Args:
        judge, base, fit: the model and how it was fitted.
        given: the joint with its own ends.
        hypothesis: bouncy ends.

    Returns:
        None if the joint does not come back from there clearly faster than the model does.
    """
    windows = judge.windows
    sides = knocked(windows, base)
    first, last = hypothesis.interval(hypothesis.trials[0])
    ends = [side for side, there in ((-1, first <= 0.0), (1, last >= 1.0)) if there]
    own = rebound(base, given)
    if not all(_bouncier(windows, sides == side, own) for side in ends):
        return None
    there = Judge(windows, np.isin(sides, ends))
    profile = base.written(fit.x)

    def make(x: Array) -> Solo:
        if not len(x):
            return given.solo(profile, base.h)
        return base.single.solo(hypothesis.write(profile, x), base.h)

    soft = there.fit(make, NOTHING, np.zeros(0), fit.start, ROUGH)
    trials = [*hypothesis.trials, [np.median(rebounds(windows, there.counts)[:, 0])]]
    fits = [there.fit(make, hypothesis.unknowns, np.array(x), fit.start, ROUGH) for x in trials]
    best = min(fits, key=lambda f: f.loss)
    whole = Fit(
        np.concatenate([fit.x, best.x]),
        np.where(there.counts[:, None], best.start, fit.start),
        np.where(there.counts, best.squares, fit.squares),
        fit.loss - soft.loss + best.loss,
    )
    return guessed(judge, hypothesis, whole)


def knocked(windows: Windows, base: Base) -> NDArray[np.intp]:
    """At which end each window has a knock: -1 low, 1 high, 0 none; shape (m,)."""
    middle = float(np.mean(base.profile.joint.range))
    told = windows.knocks & (windows.count >= LEAST)
    out = np.zeros(len(told), np.intp)
    for k in np.flatnonzero(told):
        row = windows.rows[k]
        position = windows.position[row[row >= 0]] - middle
        out[k] = np.sign(position[np.argmax(np.abs(position))])
    return out


def _bouncier(windows: Windows, there: NDArray[np.bool_], own: float) -> bool:
    """Whether an end throws the joint back clearly faster than the model's."""
    measured = rebounds(windows, there)
    if len(measured) < KNOCKS:
        return False
    ratio, error = measured.T
    weight = error**-2.0
    mean = float(weight @ ratio / weight.sum())
    scatter = float(np.sqrt(weight @ (ratio - mean) ** 2 / weight.sum() / (len(ratio) - 1)))
    return mean - own > max(CLEARLY, SURELY * max(scatter, float(weight.sum() ** -0.5)))


def rebound(base: Base, given: Single) -> float:
    """Speed after a knock, per speed before, of the model with its own ends."""
    profile = base.profile.model_copy(update={"channels": Channels()})
    lo, hi = profile.joint.range
    steps, speed = round(KNOCK_TIME / base.h), (hi - lo) / KNOCK_TIME
    start = np.array([[hi - 0.2 * (hi - lo), speed]])
    begin = np.zeros(1, np.int64)
    solo = given.without_weight().solo(profile, base.h)
    before, after = solo.replay(np.zeros(steps), begin, start, np.ones(1, bool), base.h)
    return float((before[-1] - after[-1]) / base.h / speed)


def rebounds(windows: Windows, there: NDArray[np.bool_]) -> Array:
    """Of the first knock in each window: speed after per speed before, and its standard error.

    Args:
        windows: of the runs.
        there: windows with knocks, shape (m,).

    Returns:
        shape (knocks, 2); windows with too few samples before or after a knock tell none.
    """
    out = []
    for k in np.flatnonzero(there):
        row = windows.rows[k]
        own = row[row >= 0]
        t, y = windows.time[own], windows.position[own]
        turns = np.flatnonzero(np.diff(np.sign(np.diff(y))) != 0) + 1
        turns = turns[(turns >= AROUND) & (turns < len(own) - AROUND)]
        if not len(turns):
            continue
        turn = turns[np.argmax(np.abs(y[turns] - y[0]))]
        parts = slice(turn - AROUND, turn), slice(turn + 1, turn + 1 + AROUND)
        (before, off), (after, off_after) = (_slope(t[part], y[part]) for part in parts)
        if before:
            ratio = -after / before
            noise = 1 / float(windows.whitener[k, 0, 0])
            out.append((ratio, noise * np.hypot(off_after, ratio * off) / abs(before)))
    return np.array(out).reshape(-1, 2)


def _slope(t: Array, y: Array) -> tuple[float, float]:
    """Of a line through samples, and its standard error for noise of 1."""
    t = t - t.mean()
    square = float(t @ t)
    return float(t @ y) / square, square**-0.5
