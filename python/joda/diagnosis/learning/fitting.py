"""Fits a law to windows of measured runs, together with the strengths of the model's own parts.

First in short windows and long steps, as a force's error hardly bends a short motion, then in
longer windows at the scene's own step.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from joda._core import Solo
from joda.diagnosis.baseline import Base, as_it_is, base_of, units_of, usable, windows_for
from joda.diagnosis.guessing import usual
from joda.diagnosis.judge import BEND, Fit, Judge, Unknowns
from joda.diagnosis.learning.law import Law, Terms
from joda.diagnosis.reshaping import LONGER, checked
from joda.joints.least_squares import Inequalities
from joda.measured.reading import Measured
from joda.measured.runs import QuasiStatic, Run
from joda.profile import Profile

Array = NDArray[np.float64]

ROUNDS = 4
"""Iterations in windows of each length, while windows that are far off count, and after."""
AT_END = 0.02
"""Of the range: what was measured as near to its end goes to the end."""
BEYOND = 0.995
"""Part of the measured speeds that are within those that a law knows."""


@dataclass(frozen=True)
class Learned:
    """A fitted law.

    Attributes:
        law: what was fitted.
        fit: factors of the model's own strengths, then the law's numbers; and windows' starts.
        judge: of the windows that it was fitted to.
        profile: the whole one with the law.
    """

    law: Law
    fit: Fit
    judge: Judge
    profile: Profile


class Learner:
    """Fits laws to a joint's runs."""

    def __init__(self, train: Measured) -> None:
        """Args: the joint and runs to fit."""
        self.train = train
        self.single = as_it_is(train)
        usual_length = windows_for(train).length
        lengths = [factor * usual_length for factor in LONGER] if train.runs else [usual_length]
        # at the scene's own step
        self.windows = [windows_for(train, length, fine=False) for length in lengths]
        if train.runs:
            self.windows[0] = self.windows[0].coarser()

    @cached_property
    def base(self) -> Base:
        """The model's own strengths; an actuator's numbers are not among them."""
        own = replace(self.single, servo=None) if self.train.runs else self.single
        return base_of(self.train.profile, own, self.windows[0].h)

    def law(self, terms: Terms) -> Law:
        """A law with these terms where the runs have been."""
        windows, joint = self.windows[0], self.train.profile.joint
        units = units_of(windows, self.train)
        lo, hi = joint.range
        logs: list[Run | QuasiStatic] = [*self.train.runs]
        logs = logs or [one.curve for one in self.train.curves]
        s = (np.concatenate([log.position for log in logs]) - lo) / (hi - lo)
        a, b = float(np.clip(s.min(), 0, 1)), float(np.clip(s.max(), 0, 1))
        interval = a if a > AT_END else 0.0, b if b < 1 - AT_END else 1.0
        speeds = np.abs(windows.start[:, 1])
        fastest = float(np.quantile(speeds, BEYOND)) if len(speeds) else 0.0
        return Law(terms, interval, hi - lo, fastest or units.speed, units.force)

    def unknowns(self, law: Law) -> Unknowns:
        """The numbers of the model's own strengths and of a law."""
        both = self.base.unknowns.and_(law.unknowns)
        if (must := law.unknowns.constraints) is None:
            return both
        each, low, high = np.eye(len(both.low)), np.isfinite(both.low), np.isfinite(both.high)
        G = must.G @ each[self.base.count :]
        every = Inequalities(
            np.concatenate([G, each[low], -each[high]]),
            np.concatenate([must.h, both.low[low], -both.high[high]]),
        )
        return replace(both, constraints=every)

    def numbers(self, learned: Learned) -> Array:
        """The law's own numbers, without the model's factors."""
        return learned.fit.x[self.base.count :]

    def written(self, law: Law, x: Array) -> Profile:
        """The whole profile with a law."""
        n, bounds = self.base.count, self.base.unknowns
        own = np.clip(x[:n], bounds.low, bounds.high)  # constraints hold but nearly
        return law.written(self.base.written(own), x[n:])

    def solo(self, law: Law, x: Array, h: float) -> Solo:
        """The joint with a law."""
        return self.single.solo(self.written(law, x), h)

    def learned(self, law: Law, near: Array | None = None) -> Iterator[Learned]:
        """A law fitted in longer and longer windows, after each length.

        Args:
            law: its terms.
            near: where its numbers begin, with the model's own factors; None: with no force.
        """
        unknowns = self.unknowns(law)
        x = unknowns.mean if near is None else near
        for windows in self.windows:
            judge = Judge(windows, usable(windows))
            if judge.counts.any():
                fit = self._fit(judge, law, unknowns, x)
                x = fit.x
                yield Learned(law, fit, judge, checked(self.written(law, x)))

    def _fit(self, judge: Judge, law: Law, unknowns: Unknowns, x: Array) -> Fit:
        def make(y: Array) -> Solo:
            return self.solo(law, y, judge.windows.h)

        fit = judge.fit(make, unknowns, x, iterations=0)
        for bend in (BEND * usual(judge, fit), BEND):
            fit = judge.fit(make, unknowns, fit.x, fit.start, ROUNDS, bend)
        return judge.refit(make, unknowns, fit, ROUNDS)
