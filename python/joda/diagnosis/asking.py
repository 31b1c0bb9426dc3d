"""A model fitted to measured runs, and what it may lack, fitted together with it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import (
    Base,
    base_of,
    joined,
    single_for,
    units_of,
    usable,
    windows_for,
)
from joda.diagnosis.guessing import (
    Begin,
    Guess,
    begins,
    finished,
    guessed,
    moved,
    rough,
    searched,
)
from joda.diagnosis.hypotheses import Hypothesis, hypotheses
from joda.diagnosis.judge import Fit, Judge, excess
from joda.diagnosis.knocks import Knocks, Rebound, ends_of, knock_guess, knocks_at
from joda.joints.single import Single
from joda.measured.reading import Measured
from joda.profile import Profile
from joda.template import read_templates

Array = NDArray[np.float64]

CLEARLY, CALM = 10.0, 0.1
"""Gain in loss from which runs tell that friction yields as MuJoCo's own does, and what that may
leave per sample beyond noise."""
RESTITUTION = "end_stop_restitution"
"""Effect that only knocks tell of."""


@dataclass(frozen=True)
class Asked:
    """A model fitted to measured runs, and what it may lack.

    Attributes:
        judge: of the windows.
        base: the model as it is.
        given: the joint with its own ends of the range.
        fit: of its factors alone.
        begins: from where hypotheses are fitted.
        hypotheses: all of the catalogue.
    """

    judge: Judge
    base: Base
    given: Single
    fit: Fit
    begins: tuple[Begin, ...]
    hypotheses: tuple[Hypothesis, ...]

    @cached_property
    def covariance(self) -> Array:
        """Of the fitted factors, with what is left over as noise; shape (k, k)."""
        unknowns = self.base.unknowns
        return self.judge.covariance(self.base.solo, unknowns, self.fit, unknowns.doubt)

    @cached_property
    def knocks(self) -> dict[int, Knocks]:
        """At each end that has some, -1 low and 1 high."""
        return knocks_at(self.judge.windows, self.base, self.given)

    @cached_property
    def rebounds(self) -> dict[int, Rebound]:
        """What the knocks at each end tell of it, where the model is as it was fitted."""
        profile = self.base.written(self.fit.x)
        return {side: knocks.rebound(profile) for side, knocks in self.knocks.items()}

    def tell(self, hypothesis: Hypothesis) -> Guess | None:
        """The hypothesis fitted; None if the data cannot tell of it."""
        if hypothesis.effect == RESTITUTION:
            return self._thrown_back(hypothesis)
        return self.finished(self.rough(hypothesis))

    def bouncy(self, ends: Sequence[Hypothesis], others: Sequence[Profile] = ()) -> list[Guess]:
        """How bouncy the ends are that throw the joint back clearly faster than the model's do.

        Args:
            ends: an end that is bouncy, or both.
            others: what else the joint's profile may be: with all of them that must be so too.
        """
        sure = {
            side
            for side, own in self.rebounds.items()
            if own.bouncier and all(self.knocks[side].rebound(o).bouncier for o in others)
        }
        there = [self._thrown_back(end) for end in ends if sure.issuperset(ends_of(end))]
        return [guess for guess in there if guess]

    def _thrown_back(self, end: Hypothesis) -> Guess | None:
        return knock_guess(self.judge, self.base, self.fit, self.rebounds, end)

    def rough(self, hypothesis: Hypothesis) -> "Rough":
        """The hypothesis fitted roughly, in longer steps, to windows without knocks."""
        judge, base = self.judge.coarser, self.base.coarser()
        return Rough(hypothesis, rough(judge, base, self.begins, hypothesis))

    def finished(self, found: "Rough") -> Guess:
        """The same fitted to the end."""
        return finished(self.judge, self.base, found.hypothesis, found.fits)

    def taken(self, found: "Rough") -> Guess:
        """The same as it is, in usual steps."""
        make, unknowns = joined(self.base, found.hypothesis)
        x, start = found.best.x, found.best.start
        fit = self.judge.fit(make, unknowns, x, start, iterations=0)
        return guessed(self.judge, found.hypothesis, fit)

    def moved(self, found: Guess) -> Guess:
        """The guess with its numbers tried elsewhere."""
        return moved(self.judge, self.base, found)

    def searched(self, found: Guess) -> Guess:
        """The guess after a search without derivatives."""
        return searched(self.judge, self.base, found)


@dataclass(frozen=True)
class Rough:
    """A hypothesis fitted roughly, from one or more beginnings."""

    hypothesis: Hypothesis
    fits: tuple[Fit, ...]

    @property
    def best(self) -> Fit:
        """The best one."""
        return min(self.fits, key=lambda fit: fit.loss)


def _fitted(judge: Judge, base: Base, near: Array | None) -> tuple[Fit, Fit]:
    """A model's strengths fitted, and as they are given."""
    as_it_is = base.unknowns.mean
    given = replace(judge.started(base.solo(as_it_is)), x=as_it_is)
    tried = [(as_it_is, judge.windows.start), (as_it_is, given.start)]
    if near is not None:
        tried.append((near, judge.started(base.solo(near)).start))
    away = [replace(judge.started(base.solo(x)), x=x) for x in base.beginnings()]
    tried += [(one.x, one.start) for one in away if one.loss < given.loss]
    fits = [judge.fit(base.solo, base.unknowns, x, start) for x, start in tried]
    return judge.refit(base.solo, base.unknowns, min(fits, key=lambda f: f.loss)), given


def asked(measured: Measured, length: float | None = None, near: Array | None = None) -> Asked:
    """Fits the model's own strengths.

    Its native friction may yield as MuJoCo's own row does, where the runs are of such a joint; else
    it holds as the plugin's, and as that of real joints.

    Args:
        measured: the joint and its runs.
        length: of the windows, s; None: by the joint's pace.
        near: factors of the strengths with which a fit begins besides, as shorter windows told
            them: in longer ones a model that is far off is fitted less easily.
    """
    windows = windows_for(measured, length)
    judge = Judge(windows, usable(windows))
    single, own = single_for(measured, windows.h), measured.own_row
    base = base_of(measured.profile, single, windows.h, measured.trust)
    fit, given = _fitted(judge, base, near)
    if measured.runs and own and measured.profile.channels.friction.components:
        other = replace(single, friction_row=own)
        yielding = base_of(measured.profile, other, windows.h, measured.trust)
        fit_so, given_so = _fitted(judge, yielding, near)
        calm = excess(fit_so.loss, max(judge.samples, 1.0)) < CALM  # else something else is missing
        if calm and fit_so.loss < fit.loss - CLEARLY:
            base, fit, given = yielding, fit_so, given_so
    every = hypotheses(units_of(windows, measured), read_templates(), measured.profile)
    begun = begins(judge.coarser, base.coarser(), given, fit)
    return Asked(judge, base, measured.single, fit, begun, tuple(every))
