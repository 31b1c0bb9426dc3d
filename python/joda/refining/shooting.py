"""Fits numbers to segments of measured runs and to their starts (multiple shooting: Bock 1983)."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from joda.estimation.estimator import Fit as Found
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.profile_parameters import Parameters
from joda.estimation.segments import Simulator
from joda.estimation.unknowns import Unknowns
from joda.refining.engine import Engine

Array = NDArray[np.float64]
Progress = Callable[[Array, float], None]
"""After each iteration, the numbers and the RMS misfit (rad or m)."""

MIN_SAMPLES = 4
"""Fewest samples of a segment that counts."""
STRAY = 1.5
"""Segments that leave so many times the squares that noise makes begin elsewhere, perhaps: where a
force jumps, a joint crosses in one step or in the next, and slopes by its start lead nowhere."""
AROUND = np.linspace(-2, 2, 9)
"""Where these may begin, either state, in standard deviations of the measured one."""
NUDGE = 0.004
"""Step of a number for differences, in its own unit."""


class Shooting:
    """What simulates a joint, and what of its profile may change."""

    def __init__(self, engine: Engine, parameters: Parameters) -> None:
        """Takes both."""
        self.engine, self.parameters = engine, parameters

    def about(self, parameters: Parameters) -> "Shooting":
        """The same joint and runs with other numbers."""
        return Shooting(self.engine, parameters)

    def simulator(self, theta: Array) -> Simulator:
        """The joint with its numbers."""
        return self.engine.simulator(self.parameters, theta)

    def estimator(self, length: float) -> SegmentEstimator:
        """Of segments of some length, s."""
        segments = self.engine.segments(length)
        return self.engine.estimator(segments, segments.count >= MIN_SAMPLES)

    def started(self, estimator: SegmentEstimator, theta: Array) -> Found:
        """Starts of segments that suit the joint with its numbers best: those that still stray are
        tried at places around, too."""
        simulator = self.simulator(theta)
        found, segments = estimator.started(simulator), estimator.segments
        stray = estimator.counts & (found.squares > STRAY * segments.count)
        if not (segments.separable and stray.any()):
            return found
        part = segments.only(stray)
        own = SegmentEstimator(part, np.ones(len(part.at), bool))
        begun = best = found.start[stray]
        least = own.squares(simulator, begun)[1]
        for state in product(AROUND, AROUND):
            trial = begun + part.prior_std * state
            squares = own.squares(simulator, trial)[1]
            best = np.where((squares < least)[:, None], trial, best)
            least = np.minimum(squares, least)
        start = found.start.copy()
        start[stray] = best
        anew = estimator.started(simulator, near=start)
        better = anew.squares < found.squares
        squares = np.minimum(anew.squares, found.squares)
        start = np.where(better[:, None], anew.start, found.start)
        return replace(found, start=start, squares=squares, loss=estimator.loss(squares))

    def fit_segments(
        self,
        estimator: SegmentEstimator,
        theta: Array,
        prior_std: Array,
        iterations: int,
        report: Progress = lambda theta, misfit: None,
        held: Array | None = None,
    ) -> Array:
        """Gauss-Newton over segments and their starts, shape (n,).

        Args:
            estimator: of the segments.
            theta: where to begin, shape (n,).
            prior_std: standard deviations before any data, shape (n,).
            iterations: at most so many.
            report: see `Progress`.
            held: about which values; None: those at first.
        """
        unknowns = self.unknowns(held, prior_std)
        start = estimator.started(self.simulator(theta)).start

        def heard(fit: Found) -> None:
            report(fit.x, self.robust(estimator, fit))

        own = self.simulator, unknowns, theta, start, iterations
        return estimator.fit(*own, report=heard, updated=False).x

    def covariance(self, estimator: SegmentEstimator, theta: Array) -> Array:
        """Of the numbers' errors, from segments and the prior, shape (n, n)."""
        prior_std, unknowns = self.parameters.prior_std, self.unknowns()
        start = estimator.started(self.simulator(theta)).start
        about = estimator.linear(self.simulator, unknowns, theta, start, cauchy_scale=np.inf)
        return np.asarray(np.linalg.inv(about.normal()[0] + np.diag(prior_std**-2.0)))

    def rms(self, estimator: SegmentEstimator, theta: Array) -> float:
        """RMS misfit of segments, from starts that are fitted, rad or m."""
        rows = estimator.segments.rows[estimator.counts]
        return float(np.sqrt(np.mean(self.misfit(estimator, theta)[rows[rows >= 0]] ** 2)))

    def misfit(self, estimator: SegmentEstimator, theta: Array) -> Array:
        """Predicted minus measured positions, from starts that are fitted, rad or m, shape (n,)."""
        simulator = self.simulator(theta)
        return estimator.segments.misfit(simulator, estimator.started(simulator).start)

    def unknowns(self, mean: Array | None = None, prior_std: Array | None = None) -> Unknowns:
        """The numbers, about which values and how well they are known; None: as at first."""
        own, n = self.parameters, len(self.parameters.start)
        bounds, steps = (np.full(n, -np.inf), np.full(n, np.inf)), np.full(n, NUDGE)
        return Unknowns(
            *bounds,
            steps,
            own.start if mean is None else mean,
            own.prior_std if prior_std is None else prior_std,
            own.constraints,
        )

    def robust(self, estimator: SegmentEstimator, fit: Found) -> float:
        """RMS misfit of segments that count, rad or m."""
        count = int(estimator.segments.count[estimator.counts].sum())
        return self.engine.sigma * float(
            np.sqrt(fit.squares[estimator.counts].sum() / max(count, 1))
        )
