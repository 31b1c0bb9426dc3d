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
"""Fewest windows with knocks that tell of the ends."""
BOUNCY = 0.3
"""Least speed after a knock, per speed before, of ends that throw the joint back."""
CLEARLY = 0.15
"""How much more that is than the model's."""
AROUND = 5
"""Samples before and after a knock that tell its speeds."""
KNOCK_TIME = 0.6
"""In which a joint goes through its range towards a knock, s."""


def knock_guess(
    judge: Judge, base: Base, given: Single, fit: Fit, hypothesis: Hypothesis
) -> Guess | None:
    """How bouncy the ends are, by the windows with knocks; they tell of nothing else.

    Args:
        judge, base, fit: the model and how it was fitted.
        given: the joint with its own ends.
        hypothesis: bouncy ends.

    Returns:
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
    if np.median(measured) < rebound(base, given) + CLEARLY:
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
    return guessed(judge, hypothesis, whole)


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


def rebounds(windows: Windows, knocks: NDArray[np.bool_], position: Array) -> Array:
    """Speed after per speed before, of the first knock in each window, the harder half of them."""
    speeds = []
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
            speeds.append((abs(before), -after / before))
    harder = sorted(speeds)[-max(KNOCKS, len(speeds) // 2) :]
    return np.array([ratio for _, ratio in harder])
