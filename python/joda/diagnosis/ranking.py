"""What may be missing, ranked: from a fit of every hypothesis to the best ones of each effect."""

from collections.abc import Callable, Collection, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from os import cpu_count
from typing import TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from joda.diagnosis.asking import RESTITUTION, Asked, Rough
from joda.diagnosis.baseline import joined
from joda.diagnosis.guessing import Guess, beside
from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.judge import BLAS, Fit, Judge
from joda.profile import Profile

POLISHED, NEAR = 4, 3.0
"""Of how many effects the numbers are tried elsewhere, and up to which part of the least loss."""
QUICK = 1200
"""Samples up to which they are tried whatever their loss; of more, up to that part of the own."""
SEARCHED, FEW = 2, 8
"""Of how many effects they are searched without derivatives, and of how many numbers at most."""
ENOUGH, FAR = 1.5, 5.0
"""Loss per sample at which nothing more can be found, and from how many times the least a rough fit
is then left as it is."""
NARROWED = 6
"""How many effects are looked at again in longer windows, where the first is not sure."""
WELLS = {"detent_internal", "bistable_mechanism_internal"}
"""Effects of which one may stand in for the other where no run went all the way."""
TELLS, TELLS_EACH = 60.0, 0.1
"""Gain in loss from which windows without knocks tell of an effect; the same, per sample."""
CALM = 0.3
"""Part of the windows, the better ones, that tell the noise."""
WORST = 1.5
"""Mean square residual that noise may make."""


@dataclass(frozen=True)
class Ranking:
    """What may be missing from a model.

    Attributes:
        asked: the model and its runs.
        guesses: the best one of each effect, the most likely first.
        level: mean square residual that counts as noise, 1 at least.
        told: how many samples count.
        bouncy: whether knocks tell of bouncier ends than the model's, and that is not tried.
    """

    asked: Asked
    guesses: tuple[Guess, ...]
    level: float
    told: float
    bouncy: bool


Told = Callable[[int, int, str], None]
A = TypeVar("A", Hypothesis, Rough, Guess)
T = TypeVar("T", Rough, Guess)


def rank(
    begun: Asked,
    exclude: Collection[str] = (),
    heed: Told = lambda done, total, what: None,
    roughly: bool = False,
    possible: Callable[[Profile, str], bool] = lambda profile, effect: True,
) -> Ranking:
    """Fits every hypothesis to measured runs.

    Args:
        begun: the model and its runs.
        exclude: effects that are not tried.
        heed: told how many hypotheses are done, of how many, and the last one's name.
        roughly: whether only the most promising ones are fitted to the end.
        possible: whether a profile with an effect can be meant.
    """
    tried = [h for h in begun.hypotheses if h.effect not in {*exclude, RESTITUTION}]
    bouncy = [h for h in begun.hypotheses if h.effect == RESTITUTION]
    silent = RESTITUTION in exclude
    with threadpool_limits(1, BLAS), ThreadPoolExecutor(cpu_count()) as pool:
        work = _Work(pool, heed, 2 * len(tried) + POLISHED)
        guesses = _fitted(begun, tried, work, roughly)
        if not roughly:
            guesses += _beside(begun, tried, guesses, work)
            guesses += _polished(begun, guesses, work)
            guesses += _searched(begun, guesses, work)
        begun = _unstuck(begun, guesses)
        others = [one.written(begun.base) for one in _best(guesses)[:1]]
        ends = begun.bouncy(bouncy, others)
        if not silent and not _told_within(begun, guesses):
            guesses += ends
    there = [
        one
        for one in guesses
        if not one.vanished and possible(one.written(begun.base), one.hypothesis.effect)
    ]
    return Ranking(begun, *_scored(begun.judge, there), bouncy=silent and bool(ends))


def narrowed(
    begun: Asked,
    before: Ranking,
    heed: Told = lambda done, total, what: None,
) -> Ranking:
    """The best effects of a ranking again, fitted to longer windows from where they were found.

    Where one that left only noise of shorter windows leaves more of these, its numbers are tried
    elsewhere too: what goes over a barrier in one window and not in another is no way for a fit.

    Args:
        begun: the model and its runs in longer windows.
        before: the ranking.
        heed: told how many hypotheses are done, of how many, and the last one's name.
    """
    judge = begun.judge
    tried = [g for g in before.guesses if g.hypothesis.effect != RESTITUTION][:NARROWED]

    def again(found: Guess) -> Guess:
        make, _ = joined(begun.base, found.hypothesis)
        start = judge.started(make(found.fit.x)).start
        guess = begun.finished(Rough(found.hypothesis, (replace(found.fit, start=start),)))
        stuck = _only_noise(found, before.asked.judge) and not _only_noise(guess, judge)
        return begun.moved(guess) if stuck else guess

    with threadpool_limits(1, BLAS), ThreadPoolExecutor(cpu_count()) as pool:
        guesses = _Work(pool, heed, len(tried)).all(again, tried)
        begun = _unstuck(begun, guesses)
    there = [one for one in guesses if not one.vanished]
    return Ranking(begun, *_scored(judge, there), bouncy=before.bouncy)


@dataclass
class _Work:
    """Threads, and how much they have done."""

    pool: ThreadPoolExecutor
    heed: Told
    total: int
    done: int = 0

    def all(self, make: Callable[[A], T], each: Iterable[A]) -> list[T]:
        """What is made of each."""
        out = []
        for one in self.pool.map(make, each):
            self.done += 1
            self.heed(self.done, max(self.total, self.done), one.hypothesis.effect)
            out.append(one)
        return out


def _fitted(begun: Asked, tried: Sequence[Hypothesis], work: _Work, roughly: bool) -> list[Guess]:
    """All hypotheses fitted; where one leaves only noise, those that are far off, roughly."""
    roughs = sorted(work.all(begun.rough, tried), key=lambda one: one.best.loss)
    guesses = work.all(begun.finished, roughs[:POLISHED])
    if roughly:
        return guesses + work.all(begun.taken, roughs[POLISHED:])
    least = min((one.fit.loss for one in guesses), default=0.0)
    most = FAR * least if least < ENOUGH * begun.judge.samples else np.inf
    near = [one for one in roughs[POLISHED:] if one.best.loss < most]
    far = [one for one in roughs[POLISHED:] if one.best.loss >= most]
    return guesses + work.all(begun.finished, near) + work.all(begun.taken, far)


def _beside(
    begun: Asked, tried: Sequence[Hypothesis], guesses: Sequence[Guess], work: _Work
) -> list[Guess]:
    """Those that may be where the best one was found."""
    alike = [
        beside(h, best)
        for best in _best(guesses)[:1]
        for h in tried
        if {h.effect, best.hypothesis.effect} == WELLS
    ]
    return work.all(begun.finished, work.all(begun.rough, alike))


def _polished(begun: Asked, guesses: Sequence[Guess], work: _Work) -> list[Guess]:
    """The best effects, in every variant that is near, with their numbers tried elsewhere."""
    best = _best(guesses)[:POLISHED]
    names = {one.hypothesis.effect for one in best}
    others = [one for one in guesses if one.hypothesis.effect in names and one is not best[0]]
    moved = work.all(begun.moved, best[:1])
    least = min((one.fit.loss for one in (*guesses, *moved)), default=0.0)
    part = min(QUICK / max(begun.judge.samples, 1.0), 1.0)
    most = max(NEAR * least, part * begun.fit.loss)
    near = [one for one in others if one.fit.loss < most]
    work.total = work.done + len(near)
    return moved + work.all(begun.moved, near)


def _searched(begun: Asked, guesses: Sequence[Guess], work: _Work) -> list[Guess]:
    """The best effects where they leave more than noise, searched without derivatives."""
    best = _best(guesses)[:SEARCHED]
    least = min((one.fit.loss for one in best), default=0.0)
    if least < ENOUGH * begun.judge.samples:
        return []
    near = [one for one in best if one.fit.loss < NEAR * least and len(one.fit.x) <= FEW]
    return work.all(begun.searched, near)


def _told_within(begun: Asked, guesses: Sequence[Guess]) -> bool:
    """Whether windows without knocks tell of an effect, with which only noise is left of them: then
    how bouncy the ends are is asked once that is added."""
    samples = begun.judge.samples
    best = min(guesses, key=lambda one: one.score, default=None)
    if best is None or best.fit.loss > ENOUGH * samples:
        return False
    return begun.fit.loss - best.fit.loss - best.cost > max(TELLS, TELLS_EACH * samples)


def _only_noise(guess: Guess, judge: Judge) -> bool:
    """Whether a guess leaves no more than noise of some windows."""
    return guess.fit.loss < ENOUGH * judge.samples


def _unstuck(begun: Asked, guesses: Sequence[Guess]) -> Asked:
    """The model as it is, fitted from where the best guess is too: it may do as well from there."""
    judge, base = begun.judge, begun.base
    if not guesses:
        return begun
    best = min(guesses, key=lambda one: one.fit.loss).fit
    fit = judge.fit(base.solo, base.unknowns, best.x[: base.count], best.start)
    fit = judge.refit(base.solo, base.unknowns, fit)
    return replace(begun, fit=min(begun.fit, fit, key=lambda one: one.loss))


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


def _scored(judge: Judge, guesses: Sequence[Guess]) -> tuple[tuple[Guess, ...], float, float]:
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
