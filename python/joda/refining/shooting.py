"""Fits numbers to windows of measured runs and to their starts (multiple shooting: Bock 1983)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.judge import Fit as Found
from joda.diagnosis.judge import Judge, Unknowns
from joda.diagnosis.windows import Mover
from joda.joints.parameters import Parameters
from joda.refining.engine import Engine

Array = NDArray[np.float64]
Told = Callable[[Array, float], None]
"""After each iteration, the numbers and the RMS misfit (rad or m)."""

LEAST = 4
"""Fewest samples of a window that counts."""
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

    def mover(self, theta: Array) -> Mover:
        """The joint with its numbers."""
        return self.engine.mover(self.parameters, theta)

    def judge(self, length: float) -> Judge:
        """Of windows of some length, s."""
        windows = self.engine.windows(length)
        return self.engine.judge(windows, windows.count >= LEAST, apart=True)

    def fit_windows(
        self,
        judge: Judge,
        theta: Array,
        doubt: Array,
        iterations: int,
        told: Told = lambda theta, misfit: None,
        held: Array | None = None,
    ) -> Array:
        """Gauss-Newton over windows and their starts, shape (n,).

        Args:
            judge: of the windows.
            theta: where to begin, shape (n,).
            doubt: standard deviations before any data, shape (n,).
            iterations: at most so many.
            told: see `Told`.
            held: about which values; None: those at first.
        """
        unknowns = self.unknowns(held, doubt)
        start = judge.started(self.mover(theta)).start

        def heard(fit: Found) -> None:
            told(fit.x, self.robust(judge, fit))

        return judge.fit(self.mover, unknowns, theta, start, iterations, told=heard).x

    def covariance(self, judge: Judge, theta: Array) -> Array:
        """Of the numbers' errors, from windows and the prior, shape (n, n)."""
        doubt, unknowns = self.parameters.doubt, self.unknowns()
        start = judge.started(self.mover(theta)).start
        H = judge.linear(self.mover, unknowns, theta, start, bend=np.inf).normal()[0]
        return np.asarray(np.linalg.inv(H + np.diag(doubt**-2.0)))

    def rms(self, judge: Judge, theta: Array) -> float:
        """RMS misfit of windows, from starts that are fitted, rad or m."""
        rows = judge.windows.rows[judge.counts]
        return float(np.sqrt(np.mean(self.misfit(judge, theta)[rows[rows >= 0]] ** 2)))

    def misfit(self, judge: Judge, theta: Array) -> Array:
        """Predicted minus measured positions, from starts that are fitted, rad or m, shape (n,)."""
        mover = self.mover(theta)
        return judge.windows.misfit(mover, judge.started(mover).start)

    def unknowns(self, mean: Array | None = None, doubt: Array | None = None) -> Unknowns:
        """The numbers, about which values and how well they are known; None: as at first."""
        own, n = self.parameters, len(self.parameters.start)
        bounds, steps = (np.full(n, -np.inf), np.full(n, np.inf)), np.full(n, NUDGE)
        return Unknowns(
            *bounds,
            steps,
            own.start if mean is None else mean,
            own.doubt if doubt is None else doubt,
            own.constraints,
        )

    def robust(self, judge: Judge, fit: Found) -> float:
        """RMS misfit of windows that count, rad or m."""
        count = int(judge.windows.count[judge.counts].sum())
        return self.engine.sigma * float(np.sqrt(fit.squares[judge.counts].sum() / max(count, 1)))
