"""What may be missing, ranked: each hypothesis is fitted together with the model's own numbers."""

from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from os import cpu_count

import numpy as np

from joda._templates import templates
from joda.baseline import Base, base_of, single_for, units_of, usable, windows_for
from joda.comparison import Measured
from joda.guessing import Guess, guess, moved, usual
from joda.hypotheses import Hypothesis, hypotheses
from joda.judge import BEND, Fit, Judge, Linear
from joda.knocks import knock_guess

POLISHED = 4
"""Of how many effects the numbers are tried elsewhere."""
CALM = 0.3
"""Part of the windows, the better ones, that tell the noise."""
WORST = 1.5
"""Mean square residual that noise may make."""
QUIET = 0.5
"""The least: noise is not estimated better."""


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
    base = base_of(measured.profile, single_for(measured), windows.h)
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
        guesses = heard(pool.map(lambda h: tell(judge, base, fit, about, h), tried))
        best = _best(guesses)[:POLISHED]
        guesses += heard(pool.map(lambda g: moved(judge, base, g), best))
    scored, level, told = _levelled(judge, guesses)
    return Ranking(judge, base, fit, tuple(_best(scored)), level, told)


def tell(judge: Judge, base: Base, fit: Fit, about: Linear, hypothesis: Hypothesis) -> Guess | None:
    """The hypothesis fitted; None if the data cannot tell of it."""
    if hypothesis.effect == "end_stop_restitution":
        return knock_guess(judge, base, fit, hypothesis)
    return guess(judge, base, fit, about, hypothesis)


def _best(guesses: Iterable[Guess]) -> list[Guess]:
    """The best guess of each effect, the lowest score first."""
    best: dict[str, Guess] = {}
    for one in sorted(guesses, key=lambda g: g.score):
        best.setdefault(one.hypothesis.effect, one)
    return list(best.values())
