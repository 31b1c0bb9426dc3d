"""Fits the numbers of a joint's profile to measured motions, by gradients.

First over short windows, each from its own measured start, so that errors do not pile up and the
misfit stays smooth in the numbers; then over longer ones; then between the jumps of the force
(`joda.refining.between`); then over windows that must join into whole runs (multiple shooting:
Bock 1983). The starts are fitted too, within their measurement's error. What the motion does not
show is held by a prior at its first value.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from joda.joints.least_squares import Fit, Inequalities, adam, levenberg_marquardt
from joda.joints.parameters import Parameters
from joda.joints.single import of_solo
from joda.joints.solo import Solo
from joda.measured import smoothing
from joda.measured.runs import Run, known
from joda.refining.between import Between
from joda.refining.misfit import fitted_starts, slopes
from joda.refining.stretches import Stretches, cut

Array = NDArray[np.float64]
Method = Literal["lm", "adam"]

SHORT, LONG = 0.1, 0.4
"""Lengths of windows, s."""
MOST = 150
"""Most windows; long measurements get longer ones."""
HELD = 0.01
"""How much less than later the ends of intervals may move at first."""
FIRST = 6
"""Iterations at most with short windows, the ends of intervals held."""
TURNS, SETTLED = 2, 0.98
"""How often at most short and long windows take turns, and the share of their misfit that must be
left for the last turn."""
FOLLOWS = 0.01
"""Whole runs that are missed by less than this, in ranges, need no windows any more."""
BETWEEN = 12
"""Iterations at most with windows between the jumps."""
MISSED = 1.2
"""Whole runs that are missed by more than so many times the noise leave something to fit."""
OUTLIER = 4.0
"""A window whose misfit is so many times the median one counts less: its start may be wrong."""
ROUND = 2
"""Iterations after which a stage asks anew how far off it is."""
FINEST = 2e-5
"""Least noise that is believed, in units of the range."""
ANNEAL = 0.3
"""What is believed of a misfit before it is fitted: this share of it may be the model's."""
GAIN = 0.0003
"""Share of the misfit that a round must take away for the stage to go on."""


class Problem:
    """A joint, its parameters and its measured runs.

    Attributes:
        parameters: what may change.
        sigma: noise of the position, rad or m.
        runs: measured times (s) and positions (rad or m), where the force is known.
        axes: what these are.
        notes: none.
    """

    notes: tuple[str, ...] = ()

    def __init__(self, first: Solo, parameters: Parameters, runs: Sequence[Run], h: float) -> None:
        """Args: the joint as it is; what may change; measured runs; timestep, s."""
        self.first, self.parameters, self.h = first, parameters, h
        self.span = float(first.range[1] - first.range[0])
        noises = [smoothing.noise(run.time, run.position) for run in runs]
        self.sigma = max(float(np.median(noises)), FINEST * self.span)
        self.runs = [(run.time[k], run.position[k]) for run in runs for k in known(run)]
        least = sum(time[-1] - time[0] for time, _ in self.runs) / MOST
        unit = parameters.profile.joint.unit
        self.axes = "time (s)", f"position ({unit})"
        self.between = Between(of_solo(first), parameters, runs, self.sigma, h)
        self.whole = cut(runs, h, self.sigma, None)
        self.short, self.long = (
            cut(runs, h, self.sigma, max(length, least)) for length in (SHORT, LONG)
        )

    def rms(self, theta: Array) -> float:
        """RMS misfit of whole runs, from starts that are fitted, rad or m."""
        return self._rms(theta, self.whole)

    def rms_window(self, theta: Array) -> float:
        """The same of windows of 0.4 s."""
        return self._rms(theta, self.long)

    def windows(self, theta: Array) -> tuple[float, float] | None:
        """The same at first and with these numbers."""
        return self.rms_window(self.parameters.start), self.rms_window(theta)

    def _rms(self, theta: Array, data: Stretches) -> float:
        return float(np.sqrt(np.mean(self._misfits(theta, data)[data.real] ** 2)))

    def paths(self, theta: Array) -> list[Array]:
        """Predicted positions at the times of `runs`, from starts that are fitted."""
        misfits = self._misfits(theta, self.whole)
        rows = zip(misfits, self.whole.real, self.runs, strict=True)
        return [position + misfit[real] for misfit, real, (_, position) in rows]

    def _misfits(self, theta: Array, data: Stretches) -> Array:
        """Predicted minus measured positions, from the starts that fit best."""
        fixed = self.first, self.parameters.slots, self.h
        return fitted_starts(
            theta * self.parameters.scales, data, self.sigma, self._doubt(data), *fixed
        )

    def _doubt(self, data: Stretches) -> Array:
        return np.maximum(data.doubt, 1e-9 * self.span)

    def fit(
        self,
        iterations: int,
        method: Method = "lm",
        told: Callable[[str, int, float], None] = lambda stage, number, rms: None,
    ) -> Fit:
        """Fits short windows, longer ones, between the jumps, whole runs.

        Whole runs that nearly follow after the first windows need no more of them; only if some of
        their misfit is left then, they are fitted between the jumps too.

        Args:
            iterations: at most so many in all.
            method: Levenberg-Marquardt, or Adam as in the paper, which does not go between jumps.
            told: after each, the stage, its number and the stage's RMS misfit.
        """
        history: list[tuple[str, float]] = []
        self._best = self.parameters.start
        self._moved: dict[int, Array] = {}  # by data, how far its starts are from the measured
        interrupted = False
        free = self.parameters.doubt
        ends = np.array([slot.kind == "intervals" for slot in self.parameters.slots])
        held = np.where(ends, HELD * free, free)

        def heard(name: str, misfit: float) -> None:
            history.append((name, misfit))
            told(name, len(history), misfit)

        def run(name: str, data: Stretches, most: int, doubt: Array = free) -> None:
            if count := min(most, iterations - len(history)):
                self._stage(data, doubt, count, method, partial(heard, name))

        def between() -> None:
            def better(theta: Array, misfit: float) -> None:
                self._best = theta
                heard("between jumps", misfit)

            if count := min(BETWEEN, iterations - len(history)):
                self.between.fit(self._best, count, better)

        def whole() -> bool:
            """Whether some misfit is left."""
            before = self._best
            run("whole runs", self.whole, iterations)
            missed = self.rms(self._best) > MISSED * self.sigma
            if missed and self.between.worse(self._best, before):
                self._best = before  # a run snapped to another side than it did
            return missed

        try:
            run("short windows, intervals held", self.short, min(FIRST, iterations // 3), held)
            follows = self.rms(self._best) < FOLLOWS * self.span
            if not follows:
                self._alternate(run, iterations)
                if method == "lm":
                    between()
            if whole() and follows and method == "lm":
                before = self._best
                between()
                whole()
                if not self.between.worse(before, self._best):
                    self._best = min(before, self._best, key=self.rms)
        except KeyboardInterrupt:
            interrupted = True
        return Fit(self._best, self._covariance(), tuple(history), interrupted)

    def _alternate(self, run: Callable[[str, Stretches, int], None], iterations: int) -> None:
        """Short and long windows in turn, their starts measured anew: each leaves the places where
        the other gets stuck, at jumps and where the joint sticks. Keeps the best."""
        best, least = self._best, np.inf
        for _ in range(TURNS):
            self._moved = {}
            run("short windows", self.short, max(iterations // 12, 1))
            run("long windows", self.long, max(iterations // 6, 1))
            misfit = self._rms(self._best, self.short) * self._rms(self._best, self.long)
            if misfit < least:
                best = self._best
            if misfit > SETTLED * least:
                break
            least = misfit
        self._best = best

    def _stage(
        self,
        data: Stretches,
        doubt: Array,
        iterations: int,
        method: Method,
        told: Callable[[float], None],
    ) -> None:
        """Rounds with some stretches, until one gains too little.

        Args:
            data: the stretches.
            doubt: standard deviations of the parameters before any data, shape (n,).
            iterations: at most so many.
            method: as for `fit`.
            told: after each iteration, the RMS misfit.
        """
        size = ROUND if method == "lm" else iterations
        told_so_far: list[float] = []

        def heard(rms: float) -> None:
            told_so_far.append(rms)
            told(rms)

        while len(told_so_far) < iterations:
            before = told_so_far[-1] if told_so_far else np.inf
            count = min(size, iterations - len(told_so_far))
            self._round(data, doubt, count, method, heard)
            if not told_so_far or told_so_far[-1] > (1 - GAIN) * before:
                break

    def _round(
        self,
        data: Stretches,
        doubt: Array,
        iterations: int,
        method: Method,
        told: Callable[[float], None],
    ) -> None:
        """Fits the parameters, and the starts of the stretches.

        While the misfit is larger than the noise, it counts as if that were the noise.
        """
        n = len(self._best)
        x = np.concatenate([self._best, self._moved.get(id(data), np.zeros(data.start.size))])
        misfit = self._slopes(x, data)[0]
        misfits = np.sqrt((misfit**2).sum(axis=1) / data.real.sum(axis=1))
        usual = float(np.median(misfits))
        sigma = max(self.sigma, ANNEAL * float(np.sqrt(np.mean(misfit[data.real] ** 2))))
        sigmas = sigma * np.sqrt(np.maximum(misfits / max(OUTLIER * usual, self.sigma), 1.0))
        last: list[tuple[Array, tuple[Array, Array, float]]] = []

        def linear(x: Array) -> tuple[Array, Array, float]:
            if not last or not np.array_equal(last[0][0], x):
                last[:] = [(x, self._linear(x, data, sigmas, doubt))]
            return last[0][1]

        def heard(_: int, x: Array, __: float) -> None:
            self._best, self._moved[id(data)] = x[:n], x[n:]
            told(linear(x)[2])

        G, h = self.parameters.constraints.G, self.parameters.constraints.h
        wide = Inequalities(np.hstack([G, np.zeros((len(G), len(x) - n))]), h)
        minimise = levenberg_marquardt if method == "lm" else adam
        minimise(lambda x: linear(x)[0], lambda x: linear(x)[1], x, wide, iterations, heard)

    def _linear(
        self, x: Array, data: Stretches, sigmas: Array, doubt: Array
    ) -> tuple[Array, Array, float]:
        """Residuals of samples, of the prior and of the starts; their derivatives; RMS misfit.

        Args:
            x: the parameters' numbers, then how far the starts are from the measured ones.
            data: the stretches.
            sigmas: what counts as noise of each.
            doubt: standard deviations of the parameters before any data.
        """
        n, real = len(doubt), data.real
        misfit, by_theta, by_start = self._slopes(x, data)
        rows = zip(by_start / sigmas[:, None, None], real, strict=True)
        own = block_diag(*(part[there] for part, there in rows))
        weighted = (misfit / sigmas[:, None])[real], (by_theta / sigmas[:, None, None])[real]
        prior = (x[:n] - self.parameters.start) / doubt
        J = np.vstack(
            [np.hstack([weighted[1], own]), np.diag(1 / np.append(doubt, np.ones(len(x) - n)))]
        )
        r = np.concatenate([weighted[0], prior, x[n:]])
        return r, J, float(np.sqrt(np.mean(misfit[real] ** 2)))

    def _slopes(self, x: Array, data: Stretches) -> tuple[Array, Array, Array]:
        """Misfits, and their derivatives by the parameters and by the starts' moves."""
        parameters, count = self.parameters, len(data.start)
        n = len(parameters.start)
        doubt = self._doubt(data)
        starts = data.start + doubt * x[n:].reshape(-1, 2)
        fixed = self.first, parameters.slots, self.h
        out, J = slopes(x[:n] * parameters.scales, data.filled(starts), data.batch, *fixed)
        misfit = np.nan_to_num(np.asarray(out)[:count], nan=1e6)
        J = np.nan_to_num(np.asarray(J)[:count])
        return misfit, J[:, :, :n] * parameters.scales, J[:, :, n:] * doubt[:, None, :]

    def _covariance(self) -> Array:
        """From the curvature at the solution, over windows, whose misfits are nearly linear."""
        data = self.long
        x = np.concatenate([self._best, self._moved.get(id(data), np.zeros(data.start.size))])
        sigmas = np.full(len(data.start), self.sigma)
        J = self._linear(x, data, sigmas, self.parameters.doubt)[1]
        n = len(self._best)
        return np.asarray(np.linalg.inv(J.T @ J)[:n, :n])
