"""How bouncy the ends of the range are: by the windows with knocks, which tell of nothing else."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import LEAST, Base
from joda.diagnosis.guessing import Guess, guessed
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.judge import Fit, Judge
from joda.diagnosis.windows import Windows
from joda.joints.single import Single
from joda.profile import Channels

Array = NDArray[np.float64]

KNOCKS = 2
"""Fewest knocks at an end that tell of it."""
CLEARLY, SURELY = 0.07, 3.0
"""How much more of its speed an end must throw back than the model's: at the least, and in standard
errors."""
CLEAR = 3.0
"""How far off an end a joint must be, in noises, not to be at it."""
AROUND = 5
"""Samples before and after a knock that tell its speeds."""
KNOCK_TIME = 0.6
"""In which a joint goes through its range towards a knock, s."""


def knock_guess(
    judge: Judge,
    base: Base,
    given: Single,
    fit: Fit,
    hypothesis: Hypothesis,
    surely: bool = True,
) -> Guess | None:
    """How bouncy an end is, or both, by the speeds before and after the knocks there.

    How long and how deep a knock is tells of the stop's stiffness, which is another matter.

    Args:
        judge, base, fit: the model and how it was fitted.
        given: the joint with its own ends.
        hypothesis: bouncy ends.
        surely: whether it is asked if they are.

    Returns:
        None if there are no knocks, or if it is asked and the joint does not come back from each of
        the ends clearly faster than the model does.
    """
    windows, ends = judge.windows, ends_of(hypothesis)
    each = [rebounds(windows, base, [side]) for side in ends]
    if surely:
        own = rebound(base, given)
        if not all(_bouncier(one, own) for one in each):
            return None
    measured = np.concatenate(each)
    if not len(measured):
        return None
    low, high = hypothesis.unknowns.low, hypothesis.unknowns.high
    x = np.clip([mean_of(measured)[0]], low, high)
    profile = base.written(fit.x)
    there = Judge(windows, np.isin(knocked(windows, base), ends))
    bouncy = base.single.solo(hypothesis.write(profile, x), base.h)
    solos = given.solo(profile, base.h), bouncy
    soft, best = (there.started(solo) for solo in solos)
    whole = Fit(
        np.concatenate([fit.x, x]),
        np.where(there.counts[:, None], best.start, fit.start),
        np.where(there.counts, best.squares, fit.squares),
        fit.loss - soft.loss + best.loss,
    )
    return guessed(judge, hypothesis, whole)


def ends_of(hypothesis: Hypothesis) -> list[int]:
    """Which ends it is of: -1 the low one, 1 the high one."""
    first, last = hypothesis.interval(hypothesis.trials[0])
    return [side for side, there in ((-1, first <= 0.0), (1, last >= 1.0)) if there]


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


def _bouncier(measured: Array, own: float) -> bool:
    """Whether an end throws the joint back clearly faster than the model's does."""
    if len(measured) < KNOCKS:
        return False
    mean, error = mean_of(measured)
    return mean - own > max(CLEARLY, SURELY * error)


def mean_of(measured: Array) -> tuple[float, float]:
    """Mean restitution of knocks and its standard error, by their errors or their scatter."""
    ratio, error = measured.T
    weight = error**-2.0
    mean = float(weight @ ratio / weight.sum())
    free = max(len(ratio) - 1, 1)
    scatter = float(np.sqrt(weight @ (ratio - mean) ** 2 / weight.sum() / free))
    return mean, max(scatter, float(weight.sum() ** -0.5))


def rebounds(windows: Windows, base: Base, ends: Sequence[int]) -> Array:
    """Of the first knock in each window: speed after per speed before, and its standard error.

    The speeds are those of lines through the samples before the joint is at the end, and after it
    has left it.

    Returns:
        shape (knocks, 2); knocks without enough samples before or after tell none.
    """
    lo, hi = base.profile.joint.range
    out = []
    sides = knocked(windows, base)
    for k in np.flatnonzero(np.isin(sides, ends)):
        row = windows.rows[k]
        own = row[row >= 0]
        near = max(own[0] - AROUND, 0), min(own[-1] + 1 + 2 * AROUND, len(windows.time))
        t, y = windows.time[slice(*near)], windows.position[slice(*near)]
        noise = 1 / float(windows.sharpness[k, 0])
        away = hi - y if sides[k] > 0 else y - lo
        inside = away > CLEAR * noise
        if inside.all():  # the knock is between two samples
            inside[np.argmin(away)] = False
        first = int(np.argmin(inside))  # at the end
        back = first + int(np.argmax(inside[first:]))  # off it again
        parts = slice(first - AROUND, first), slice(back, back + AROUND)
        if first < AROUND or back == first or back + AROUND > len(t):
            continue
        if not inside[parts[1]].all() or (np.diff(t[parts[0].start : parts[1].stop]) <= 0).any():
            continue  # it hops there, or another run begins
        (before, off), (after, off_after) = (_slope(t[part], y[part]) for part in parts)
        if before * sides[k] > 0:
            ratio = -after / before
            out.append((ratio, noise * np.hypot(off_after, ratio * off) / abs(before)))
    return np.array(out).reshape(-1, 2)


def _slope(t: Array, y: Array) -> tuple[float, float]:
    """Of a line through samples, and its standard error for noise of 1."""
    t = t - t.mean()
    square = float(t @ t)
    return float(t @ y) / square, square**-0.5


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
