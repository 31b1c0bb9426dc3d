"""Fits the numbers of a joint's profile to measured motions.

First over short segments, each from its own measured start, so that errors do not pile up and the
misfit stays smooth in the numbers: the components' sizes, then all; then over longer ones; then
between the jumps of the force (`joda.refining.discontinuities`); then over segments that must join
into whole runs (multiple shooting: Bock 1983). The starts are fitted too, within their
measurement's error. What the motion does not show is held by a prior at its first value, of the
size found.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, partial, reduce
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.adding import Error
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.least_squares import Fit
from joda.estimation.profile_parameters import Parameters
from joda.measured.runs import known
from joda.refining.coarse_fit import NOISE, sized
from joda.refining.discontinuities import Between, by_chance
from joda.refining.engine import Engine
from joda.refining.shooting import Shooting

Array = NDArray[np.float64]
Sizes = Literal["near", "none", "far"]
"""How components' sizes are sought before all else: near the first places, not, or farther off."""
Report = Callable[[str, int, float], None]
"""Of an iteration: its stage, its number, the stage's RMS misfit (rad or m)."""
Tried = tuple[Fit, Parameters, Shooting]

SHORT, LONG = 0.1, 0.4
"""Lengths of segments, s."""
MAX_SEGMENTS = 150
"""Most segments; long measurements get longer ones."""
HELD = 0.01
"""How much less than later the ends of intervals may move at first."""
FIRST = 6
"""Iterations at most with short segments, the ends of intervals held."""
TURNS, SETTLED = 2, 0.98
"""How often at most short and long segments take turns, and the share of their misfit that must be
left for the last turn."""
MIN_ITERATIONS = 20
"""Fewest iterations that are to be had for sizes to be fitted first."""
ENDING = "interrupted; ending with the best so far"
"""What is reported then as a stage."""
STUCK = 1.5
"""Short segments that are missed by more than so many times the noise: the fit may have stuck. Of a
scene, whose simulation takes long, it is only then tried once more."""
FOLLOWS = 0.01
"""Whole runs that are missed by less than this, in ranges, need no segments any more."""
BETWEEN = 12
"""Iterations at most with segments between the jumps."""
LONGER = 3.0
"""How many times as long each of the longer segments is as the one before, up to whole runs."""
WHOLE = 15
"""Iterations at most with segments of each of these lengths."""
LOST = 30.0
"""Segments that are missed by more than so many times the noise: the joint parts for a tiny
difference, and longer ones tell no more."""
FOLLOWED = 1.05
"""Whole runs that are missed by less than so many times the noise need no other start."""
MISSED = 1.2
"""Whole runs that are missed by more than so many times the noise leave something to fit."""


def _later(report: Report, by: int) -> Report:
    """One that counts on from a number."""
    return lambda stage, number, rms: report(stage, by + number, rms)


class Problem:
    """A joint, its parameters and its measured runs.

    Attributes:
        parameters: what may change; after a fit, about the sizes that it found.
        sigma: noise of the position, rad or m.
        runs: measured times (s) and positions (rad or m), where the force is known.
        axes: what these are.
        notes: none.
    """

    notes: tuple[str, ...] = ()

    def __init__(self, engine: Engine, parameters: Parameters) -> None:
        """Args: what simulates the joint; what may change."""
        self.parameters, self.sigma = parameters, engine.sigma
        self.span = float(np.ptp(engine.range))
        self.runs = [(run.time[k], run.position[k]) for run in engine.runs for k in known(run)]
        self.axes = "time (s)", f"position ({parameters.profile.joint.unit})"
        self.shooting = Shooting(engine, parameters)
        durations = [float(np.ptp(time)) for time, _ in self.runs]
        least = sum(durations) / MAX_SEGMENTS
        lengths = [max(SHORT, least), max(LONG, least), max(durations) + engine.h]
        self.short, self.long, self.whole = map(self.shooting.estimator, lengths)
        self._lengths = lengths[1:]

    @cached_property
    def longer(self) -> list[SegmentEstimator]:
        """Of segments that are longer and longer, up to whole runs."""
        length, most = self._lengths
        out = []
        while (length := LONGER * length) < most:
            out.append(self.shooting.estimator(length))
        return out

    @property
    def between(self) -> Between:
        """Fits between the jumps of the force."""
        return Between(self.shooting)

    def rms(self, theta: Array) -> float:
        """RMS misfit of whole runs, from starts that are fitted, rad or m."""
        return self.shooting.rms(self.whole, theta)

    def error(self, theta: Array) -> Error:
        """How far the joint is off, from starts that are fitted."""
        missed = []
        for estimator in (self.whole, self.long):
            rows, own = (
                estimator.segments.rows[estimator.counts],
                sum(len(time) for time, _ in self.runs),
            )
            kept = rows[(rows >= 0) & (rows < own)]
            missed.append(
                float(np.sqrt(np.mean(self.shooting.misfit(estimator, theta)[kept] ** 2)))
            )
        return Error(*missed)

    def paths(self, theta: Array) -> list[Array]:
        """Predicted positions at the times of `runs`, from starts that are fitted."""
        path = self.whole.segments.position + self.shooting.misfit(self.whole, theta)
        return np.split(path, np.cumsum([len(time) for time, _ in self.runs]))[: len(self.runs)]

    def fit(
        self,
        iterations: int,
        report: Report = lambda stage, number, rms: None,
    ) -> Fit:
        """Fits sizes and then all. Where runs are missed then, it is tried again from the first
        numbers without sizes, and from sizes that are sought farther off; the best is kept.

        Args:
            iterations: at most so many, of each; of a fit of sizes each start counts as one.
            report: after each, the stage, its number and the stage's RMS misfit.
        """
        begun = self.parameters, self.shooting
        sizes = iterations >= MIN_ITERATIONS and "values" in self.parameters.kinds
        ways: tuple[Sizes, ...] = ("near", "none") if sizes else ("none",)
        if sizes and any(slot.kind == "intervals" for slot in self.parameters.slots):
            ways = (*ways, "far")
        tried: list[Tried] = []
        history: tuple[tuple[str, float], ...] = ()
        for way in ways:
            self.parameters, self.shooting = begun
            found = self._fit(iterations, _later(report, len(history)), way)
            tried.append((found, self.parameters, self.shooting))
            history += found.history
            if found.interrupted or way == ways[-1] or not self._again(found, way):
                break
        fit, self.parameters, self.shooting = reduce(self._better, tried)
        return replace(fit, history=history, interrupted=tried[-1][0].interrupted)

    def _again(self, found: Fit, way: Sizes) -> bool:
        """Whether another start may do better: short segments or whole runs are missed by more than
        noise; of a scene, short ones by much more, and it was tried but once."""
        short = self.shooting.rms(self.short, found.theta)
        if not self.shooting.engine.quick:
            return way == "near" and short > STUCK * self.sigma
        return short >= NOISE * self.sigma or self.rms(found.theta) >= FOLLOWED * self.sigma

    def _better(self, one: Tried, other: Tried) -> Tried:
        """The one that misses short segments less, by more than chance; else long ones; else whole
        runs."""
        for estimator in (self.short, self.long, self.whole):
            losses = [
                estimator.started(shooting.simulator(fit.theta)).loss
                for fit, _, shooting in (one, other)
            ]
            chance = by_chance(min(losses), estimator, len(one[0].theta))
            if abs(losses[1] - losses[0]) > chance:
                break
        return other if losses[1] < losses[0] else one

    def _fit(
        self,
        iterations: int,
        report: Report,
        sizes: Sizes,
    ) -> Fit:
        """Fits short segments, longer ones, between the jumps, whole runs.

        Whole runs that nearly follow after the first segments need no more of them; only if some of
        their misfit is left then, they are fitted like the others too.

        Args:
            iterations, report: see `fit`.
            sizes: how they are sought before all else.
        """
        history: list[tuple[str, float]] = []
        self._best = self.parameters.start
        interrupted = False
        free = self.parameters.prior_std
        ends = np.array([slot.kind == "intervals" for slot in self.parameters.slots])
        held = np.where(ends, HELD * free, free)

        def heard(name: str, theta: Array, misfit: float) -> None:
            self._best = theta
            history.append((name, misfit))
            report(name, len(history), misfit)

        def run(name: str, estimator: SegmentEstimator, most: int, prior_std: Array = free) -> None:
            if count := min(most, iterations - len(history)):
                self.shooting.fit_segments(
                    estimator, self._best, prior_std, count, partial(heard, name)
                )

        def segments() -> None:
            self._alternate(run, iterations)
            if count := min(BETWEEN, iterations - len(history)):
                self.between.fit(self._best, count, partial(heard, "between jumps"))

        def whole() -> bool:
            """Whether some misfit is left."""
            before = self._best
            stages = [("longer segments", one) for one in self.longer]
            for name, estimator in (*stages, ("whole runs", self.whole)):
                if count := min(WHOLE, iterations - len(history)):
                    self.between.held(estimator, self._best, count, partial(heard, name))
                if self.shooting.rms(estimator, self._best) > LOST * self.sigma:
                    break
            if len(history) < iterations:
                self.between.placed(self._best, partial(heard, "jumps"))
            missed = self.rms(self._best) > MISSED * self.sigma
            if missed and self.between.worse(self._best, before):
                self._best = before  # a run snapped to another side than it did
            return missed

        def size(parameters: Parameters, misfit: float) -> None:
            self.parameters, self.shooting = parameters, self.shooting.about(parameters)
            heard("sizes", parameters.start, misfit)

        try:
            if sizes != "none":
                sized(self.shooting, self.short, FIRST, size, sizes == "far")
            run("short segments, intervals held", self.short, min(FIRST, iterations // 3), held)
            follows = self.rms(self._best) < FOLLOWS * self.span
            if not follows:
                segments()
            if whole() and follows:
                before = self._best
                segments()
                whole()
                if not self.between.worse(before, self._best):
                    self._best = min(before, self._best, key=self.rms)
        except KeyboardInterrupt:
            interrupted = True
            report(ENDING, iterations, history[-1][1] if history else 0.0)
        covariance = self.shooting.covariance(self.long, self._best)
        return Fit(self._best, covariance, tuple(history), interrupted)

    def _alternate(
        self, run: Callable[[str, SegmentEstimator, int], None], iterations: int
    ) -> None:
        """Short and long segments in turn, their starts measured anew: each leaves the places where
        the other gets stuck, at jumps and where the joint sticks. Keeps the best."""
        best, least = self._best, np.inf
        for _ in range(TURNS):
            run("short segments", self.short, max(iterations // 12, 1))
            run("long segments", self.long, max(iterations // 6, 1))
            misfits = [
                self.shooting.rms(estimator, self._best) for estimator in (self.short, self.long)
            ]
            misfit = float(np.prod(misfits))
            if misfit < least:
                best = self._best
            if misfit > SETTLED * least:
                break
            least = misfit
        self._best = best
