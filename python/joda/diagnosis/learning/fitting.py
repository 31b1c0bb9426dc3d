"""Fits a law to segments of measured runs, together with the strengths of the model's own parts.

First in short segments and long steps, as a force's error hardly bends a short motion, then in
longer segments at the scene's own step.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.diagnosis.hypothesis_fits import usual
from joda.diagnosis.learning.law import Law, Terms
from joda.diagnosis.shape_refinement import LONGER, checked
from joda.diagnosis.units import units_of
from joda.estimation.base_model import BaseModel, base_of
from joda.estimation.estimator import CAUCHY_SCALE, Fit, SegmentEstimator
from joda.estimation.least_squares import Inequalities
from joda.estimation.problem import as_it_is, segments_for
from joda.estimation.unknowns import Unknowns
from joda.measured.measured_joint import Measured
from joda.measured.runs import QuasiStatic, Run
from joda.profile import Profile

Array = NDArray[np.float64]

ROUNDS = 4
"""Iterations in segments of each length, while segments that are far off count, and after."""
AT_END = 0.02
"""Of the range: what was measured as near to its end goes to the end."""
KNOWN_SPEED_SHARE = 0.995
"""Part of the measured speeds that are within those that a law knows."""


@dataclass(frozen=True)
class Learned:
    """A fitted law.

    Attributes:
        law: what was fitted.
        fit: factors of the model's own strengths, then the law's numbers; and segments' starts.
        estimator: of the segments that it was fitted to.
        profile: the whole one with the law.
    """

    law: Law
    fit: Fit
    estimator: SegmentEstimator
    profile: Profile


class Learner:
    """Fits laws to a joint's runs."""

    def __init__(self, train: Measured) -> None:
        """Args: the joint and runs to fit."""
        self.train = train
        self.joint_model = as_it_is(train)
        usual_length = segments_for(train).length
        lengths = [factor * usual_length for factor in LONGER] if train.runs else [usual_length]
        # at the scene's own step
        self.segments = [segments_for(train, length, fine=False) for length in lengths]
        if train.runs:
            self.segments[0] = self.segments[0].coarser()

    @cached_property
    def base(self) -> BaseModel:
        """The model's own strengths; an actuator's numbers are not among them."""
        own = replace(self.joint_model, servo=None) if self.train.runs else self.joint_model
        return base_of(self.train.profile, own, self.segments[0].h)

    def law(self, terms: Terms) -> Law:
        """A law with these terms where the runs have been."""
        segments, joint = self.segments[0], self.train.profile.joint
        units = units_of(segments, self.train)
        lo, hi = joint.range
        logs: list[Run | QuasiStatic] = [*self.train.runs]
        logs = logs or [one.curve for one in self.train.curves]
        s = (np.concatenate([log.position for log in logs]) - lo) / (hi - lo)
        a, b = float(np.clip(s.min(), 0, 1)), float(np.clip(s.max(), 0, 1))
        interval = a if a > AT_END else 0.0, b if b < 1 - AT_END else 1.0
        speeds = np.abs(segments.start[:, 1])
        fastest = float(np.quantile(speeds, KNOWN_SPEED_SHARE)) if len(speeds) else 0.0
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

    def simulator(self, law: Law, x: Array, h: float) -> JointSimulator:
        """The joint with a law."""
        return self.joint_model.simulator(self.written(law, x), h)

    def learned(self, law: Law, near: Array | None = None) -> Iterator[Learned]:
        """A law fitted in longer and longer segments, after each length.

        Args:
            law: its terms.
            near: where its numbers begin, with the model's own factors; None: with no force.
        """
        unknowns = self.unknowns(law)
        x = unknowns.mean if near is None else near
        for segments in self.segments:
            estimator = SegmentEstimator(segments, segments.usable)
            if estimator.counts.any():
                fit = self._fit(estimator, law, unknowns, x)
                x = fit.x
                yield Learned(law, fit, estimator, checked(self.written(law, x)))

    def _fit(self, estimator: SegmentEstimator, law: Law, unknowns: Unknowns, x: Array) -> Fit:
        def make(y: Array) -> JointSimulator:
            return self.simulator(law, y, estimator.segments.h)

        fit = estimator.fit(make, unknowns, x, iterations=0)
        for cauchy_scale in (CAUCHY_SCALE * usual(estimator, fit), CAUCHY_SCALE):
            fit = estimator.fit(make, unknowns, fit.x, fit.start, ROUNDS, cauchy_scale)
        return estimator.refit(make, unknowns, fit, ROUNDS)
