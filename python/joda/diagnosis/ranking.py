"""What may be missing, ranked: each hypothesis is fitted together with the model's own numbers."""

from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from os import cpu_count

import numpy as np

from joda._templates import templates
from joda.diagnosis.baseline import Base, base_of, single_for, units_of, usable, windows_for
from joda.diagnosis.guessing import Begin, Guess, begins, guess, moved
from joda.diagnosis.hypotheses import Hypothesis, hypotheses
from joda.diagnosis.judge import Fit, Judge
from joda.diagnosis.knocks import knock_guess
from joda.measured.reading import Measured

POLISHED, NEAR = 4, 3.0
"""Of how many effects the numbers are tried elsewhere, and up to which part of the least loss."""
QUICK = 1200
"""Samples up to which they are tried whatever their loss; of more, up to that part of the own."""
CALM = 0.3
"""Part of the windows, the better ones, that tell the noise."""
WORST = 1.5
"""Mean square residual that noise may make."""


@dataclass(frozen=True)
class Asked:
    """A model fitted to measured runs, and what it may lack.

    Attributes:
        judge: of the windows.
        base: the model as it is.
        fit: of its factors alone.
        begins: from where hypotheses are fitted.
        hypotheses: all of the catalogue.
    """

    judge: Judge
    base: Base
    fit: Fit
    begins: tuple[Begin, ...]
    hypotheses: tuple[Hypothesis, ...]

    def tell(self, hypothesis: Hypothesis) -> Guess | None:
        """The hypothesis fitted; None if the data cannot tell of it."""
        if hypothesis.effect == "end_stop_restitution":
            return knock_guess(self.judge, self.base, self.fit, hypothesis)
        return self.guess(hypothesis)

    def guess(self, hypothesis: Hypothesis) -> Guess:
        """The hypothesis fitted to windows without knocks."""
        return guess(self.judge, self.base, self.begins, hypothesis)

    def apart(self) -> "Asked":
        """The same, but what is fitted from here on has every window's start apart."""
        return replace(self, judge=replace(self.judge, apart=True))

    def moved(self, found: Guess) -> Guess:
        """The guess with its numbers tried elsewhere."""
        return moved(self.judge, self.base, found)


def asked(measured: Measured, length: float | None = None) -> Asked:
    """Fits the model's own strengths in windows of some length (s); None: by the joint's pace."""
    windows = windows_for(measured, length)
    judge = Judge(windows, usable(windows))
    base = base_of(measured.profile, single_for(measured, windows.h), windows.h)
    given = np.ones(len(base.places))
    starts = windows.start, judge.started(base.solo(given)).start
    fits = [judge.fit(base.solo, base.unknowns, given, start) for start in starts]
    fit = min(fits, key=lambda f: f.loss)
    every = hypotheses(units_of(windows, measured), templates(), measured.profile)
    return Asked(judge, base, fit, begins(judge, base, fit), tuple(every))


@dataclass(frozen=True)
class Ranking:
    """What may be missing from a model.

    Attributes:
        asked: the model and its runs.
        guesses: the best one of each effect, the most likely first.
        level: mean square residual that counts as noise, 1 at least.
        told: how many samples count.
    """

    asked: Asked
    guesses: tuple[Guess, ...]
    level: float
    told: float


Told = Callable[[int, int, str], None]


def rank(
    begun: Asked,
    exclude: Collection[str] = (),
    heed: Told = lambda done, total, what: None,
    known: Sequence[Guess] = (),
) -> Ranking:
    """Fits every hypothesis to measured runs.

    Args:
        begun: the model and its runs.
        exclude: effects that are not tried.
        heed: told how many hypotheses are done, of how many, and the last one's name.
        known: guesses of the same windows that are there already; the better ones are taken.
    """
    tried = [h for h in begun.hypotheses if h.effect not in exclude]
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
        guesses = heard(pool.map(begun.tell, tried))
        best = _best(guesses)[:POLISHED]
        guesses += heard(map(begun.moved, best[:1]))
        least = min((one.fit.loss for one in guesses), default=0.0)
        part = min(QUICK / max(begun.judge.samples, 1.0), 1.0)
        most = max(NEAR * least, part * begun.fit.loss)
        names = {one.hypothesis.effect for one in best}
        likely = [one for one in guesses if one.hypothesis.effect in names and one is not best[0]]
        near = [one for one in likely if one.fit.loss < most]
        done = total - len(near)
        guesses += heard(pool.map(begun.moved, near))
    there = [one for one in (*guesses, *known) if not one.vanished]
    return Ranking(begun, *_levelled(begun.judge, there))


def _best(guesses: Iterable[Guess]) -> list[Guess]:
    """The best guess of each effect, the lowest score first."""
    best: dict[str, Guess] = {}
    for one in sorted(guesses, key=lambda g: g.score):
        best.setdefault(one.hypothesis.effect, one)
    return list(best.values())


def levelled(judge: Judge, fit: Fit, level: float) -> float:
    """A fit's loss, with what its numbers lose by being off (and knocks), where noise is more."""
    beside = fit.loss - judge.loss(fit.squares)
    return judge.loss(fit.squares, level=level) + beside / level


def _levelled(judge: Judge, guesses: Sequence[Guess]) -> tuple[tuple[Guess, ...], float, float]:
    """The best guesses, scored by what the best of them leaves in its better windows.

    Recorded noise is often less than all that a simulation cannot follow: clocks, forces, whatever
    else is a little wrong. Such a misfit is all of one piece within a window, which then counts as
    one sample.

    Returns:
        the best one of each effect, the most likely first; the mean square residual that is
        noise; how many samples count.
    """
    samples = judge.samples
    if not guesses or not samples:
        return (), 1.0, samples
    best = min(guesses, key=lambda g: g.fit.loss + g.cost).fit.squares
    each = (best / np.maximum(judge.windows.count, 1))[judge.counts]
    level = max(float(np.quantile(each, CALM)), 1.0)
    told = float(judge.counts.sum()) if level > WORST else samples

    def scored(one: Guess) -> Guess:
        loss = levelled(judge, one.fit, level) * told / samples
        cost = one.hypothesis.rarity + len(one.x) * np.log(max(told, 2.0))
        return replace(one, score=loss + cost)

    return tuple(_best(map(scored, guesses))), level, told
