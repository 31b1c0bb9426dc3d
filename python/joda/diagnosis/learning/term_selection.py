"""Which terms a learned law has: those with which runs that no fit has seen are missed by less.

Simple laws first. A term more is taken only if it makes those runs clearly likelier, and the law as
a whole only by the measure of every other effect (`joda.diagnosis.adding`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from joda.diagnosis.adding import NO_LESS, NOTHING_LEFT, AddedEffect, fallen, replayed
from joda.diagnosis.data_sufficiency import at_rest
from joda.diagnosis.learning.fitting import Learned, Learner
from joda.diagnosis.learning.law import LABEL, Terms
from joda.diagnosis.overlap import divided
from joda.diagnosis.paired_test import worse
from joda.diagnosis.plausible import Needs, implausible
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shape_refinement import Likelihood, clearly
from joda.estimation.estimator import excess
from joda.measured.measured_joint import Measured
from joda.threads import one_blas_thread

LENGTHS = (0.12, 0.05, 0.025)
"""Over which a force over position changes, normalised."""
TIMES = (0.05, 0.3)
"""From which a memory's time is sought, in lengths of the longest run."""


@dataclass(frozen=True)
class Tried:
    """A fitted law, and the loss of the runs held out with it."""

    learned: Learned
    unseen: float

    @property
    def terms(self) -> Terms:
        """Of the law."""
        return self.learned.law.terms


class Learning:
    """Fits laws to some runs and judges them by others."""

    def __init__(self, train: Measured, held: Measured, progress: Callable[[str], None]) -> None:
        """Args: the joint and runs to fit; the same with runs held out; told what is done."""
        self.learner, self.unseen, self.progress = Learner(train), Likelihood(held), progress

    def tried(self, terms: Terms, near: Tried | None = None) -> Tried:
        """A law with these terms, fitted; from one that only lacks the memory, if that is near."""
        law = self.learner.law(terms)
        self.progress(f"learning {law.described()}")
        begin = None
        if near and terms == replace(near.terms, memory=terms.memory, time=terms.time):
            begin = np.append(near.learned.fit.x, law.unremembering)
        every = [
            Tried(one, self.unseen.loss(one.profile)) for one in self.learner.learned(law, begin)
        ]
        return min(every, key=lambda one: one.unseen)

    def chosen(self) -> Tried:
        """The law of the fewest terms that no other is clearly better than."""
        best = self.tried(Terms())
        for more in (self._positions, self._speeds, self._along, self._memories):
            if self.nothing_left(best):
                break
            best = self._best(best, more(best.terms))
        for terms in self._fewer(best.terms):
            if not _worth(best, one := self.tried(terms)):
                return one
        return best

    def _best(self, best: Tried, others: Iterator[Terms]) -> Tried:
        """One, or the best of others with more terms that are worth it."""
        near = best
        for terms in others:
            one = self.tried(terms, near if terms.memory != "none" else None)
            if _worth(one, best):
                best = one
        return best

    def nothing_left(self, found: Tried) -> bool:
        """Whether what was held out is missed by no more than noise."""
        return (
            excess(found.unseen, max(self.unseen.estimator.samples, 1.0))
            < SETTINGS.learning.negligible_excess
        )

    def _positions(self, terms: Terms) -> Iterator[Terms]:
        for length in LENGTHS:
            yield replace(terms, position=length)

    def _speeds(self, terms: Terms) -> Iterator[Terms]:
        """Resistances, which may be all that there is: then no force over position is needed."""
        if self.learner.train.runs:
            for length in dict.fromkeys((0.0, terms.position, LENGTHS[0])):
                yield replace(terms, position=length, speed=True)

    def _along(self, terms: Terms) -> Iterator[Terms]:
        if terms.speed:
            yield replace(terms, along=True)

    def _memories(self, terms: Terms) -> Iterator[Terms]:
        runs = self.learner.train.runs
        longest = max((float(np.ptp(run.time)) for run in runs), default=0.0)
        for time in (part * longest for part in TIMES if longest):
            yield replace(terms, memory="position", time=time)
            yield replace(terms, memory="speed", time=time, speed=True)

    def _fewer(self, terms: Terms) -> Iterator[Terms]:
        """Without what may have stood in for a memory before there was one."""
        if terms.memory == "none":
            return
        if terms.along:
            yield replace(terms, position=0.0, along=False)
        if terms.position and terms.speed and terms.memory == "position":
            yield replace(terms, position=0.0, speed=False, along=False)
        if terms.position:
            yield replace(terms, position=0.0)


def _worth(more: Tried, less: Tried) -> bool:
    """Whether a law is better by so much that its further terms are worth it."""
    return more.unseen < SETTINGS.learning.max_loss * less.unseen and clearly(
        more.unseen, less.unseen
    )


@one_blas_thread
def learn(
    train: Measured, held: Measured, progress: Callable[[str], None] = lambda what: None
) -> tuple[AddedEffect, Learned | None]:
    """Adds a law of no catalogue, if runs held out are clearly better with it.

    Args:
        train: the joint, its profile as it is, and runs to fit.
        held: the same with runs held out.
        progress: what is being done.

    Returns:
        what came of it; and the law, None if none was added.
    """
    before, replays = replayed(held)
    own = train.profile

    def refused(reason: str) -> tuple[AddedEffect, None]:
        return AddedEffect(own, None, before, before, reason), None

    if reason := at_rest(train):
        return refused(reason)
    loss = Likelihood(held).loss(own)
    anew = divided(own, LABEL)[1]  # of a law that was learned before none is left
    best = Learning(train.changed(anew), held.changed(anew), progress).chosen()
    profile = best.learned.profile
    if best.terms == Terms() or not clearly(best.unseen, loss):
        return refused(
            NOTHING_LEFT if before.window < SETTINGS.adding.silent * held.floor else NO_LESS
        )
    if reason := implausible(Needs(train), profile, LABEL) or "":
        return refused(reason)
    after, later = replayed(held, profile)
    if not fallen(before, after):
        return refused(NO_LESS)
    if replays and later and (reason := worse(replays, later) or ""):
        return refused(reason)
    return AddedEffect(profile, LABEL, before, after), best.learned
