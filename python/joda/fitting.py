"""Fits the numbers of a joint's profile to measured motions, by gradients.

First over short windows, each from its own measured start, so that errors do not pile up and the
misfit stays smooth in the numbers; then over longer ones; then over windows that must join into
whole runs (multiple shooting: Bock 1983). The starts are fitted too, within their measurement's
error. What the motion does not show is held by a prior at its first value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from joda import smoothing
from joda.least_squares import Inequalities, adam, levenberg_marquardt
from joda.misfit import slopes, start_slopes
from joda.parameters import Parameters
from joda.runs import Run
from joda.solo import Solo
from joda.stretches import Stretches, cut, known

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
TURNS, SETTLED = 3, 0.98
"""How often at most short and long windows take turns, and the share of their misfit that must be
left for the last turn."""
FOLLOWS = 0.01
"""Whole runs that are missed by less than this, in ranges, need no windows any more."""
UNDONE = 1.05
"""Whole runs may not make the misfit of windows larger by more than this factor: a run may snap to
another side than it did, and its misfit then points anywhere."""
OUTLIER = 4.0
"""A window whose misfit is so many times the median one counts less: its start may be wrong."""
ROUND = 2
"""Iterations after which a stage asks anew how far off it is."""
STARTS = 10
"""Iterations that fit the starts of runs."""
START = 3.0
"""How far the start of a run may be from the measured one, in its standard deviations."""
FINEST = 2e-5
"""Least noise that is believed, in units of the range."""
ANNEAL = 0.3
"""What is believed of a misfit before it is fitted: this share of it may be the model's."""
GAIN = 0.0003
"""Share of the misfit that a round must take away for the stage to go on."""


@dataclass(frozen=True)
class Fit:
    """A fit.

    Attributes:
        theta: the parameters' numbers.
        covariance: of its errors, from the data and the prior; shape (n, n).
        history: per iteration: stage, RMS misfit of that stage's stretches (rad or m).
        interrupted: whether the user stopped it; theta is then the best so far.
    """

    theta: Array
    covariance: Array
    history: tuple[tuple[str, float], ...]
    interrupted: bool = False


class Problem:
    """A joint, its parameters and its measured runs.

    Attributes:
        parameters: what may change.
        sigma: noise of the position, rad or m.
        runs: measured times (s) and positions (rad or m), where the force is known.
    """

    def __init__(self, first: Solo, parameters: Parameters, runs: Sequence[Run], h: float) -> None:
        """Args: the joint as it is; what may change; measured runs; timestep, s."""
        self.first, self.parameters, self.h = first, parameters, h
        self.span = float(first.range[1] - first.range[0])
        noises = [smoothing.noise(run.time, run.position) for run in runs]
        self.sigma = max(float(np.median(noises)), FINEST * self.span)
        self.runs = [(run.time[k], run.position[k]) for run in runs for k in known(run)]
        least = sum(time[-1] - time[0] for time, _ in self.runs) / MOST
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

    def _windows(self, theta: Array) -> Array:
        """RMS misfits of short and long windows."""
        return np.array([self._rms(theta, data) for data in (self.short, self.long)])

    def _rms(self, theta: Array, data: Stretches) -> float:
        misfit = self._misfits(theta, self.starts(theta, data), data)[0][data.real]
        return float(np.sqrt(np.mean(misfit**2)))

    def paths(self, theta: Array) -> list[Array]:
        """Predicted positions at the times of `runs`, from starts that are fitted."""
        misfits, _ = self._misfits(theta, self.starts(theta, self.whole), self.whole)
        rows = zip(misfits, self.whole.real, self.runs, strict=True)
        return [position + misfit[real] for misfit, real, (_, position) in rows]

    def starts(self, theta: Array, data: Stretches) -> Array:
        """The starts, within their measurement's errors, from which the prediction fits best."""
        doubt = self._doubt(data)
        x = np.zeros_like(doubt)
        damping = np.full(len(x), 1e-3)

        def fitted(x: Array) -> tuple[Array, Array, Array]:
            r, J = self._misfits(theta, data.start + doubt * x, data)
            r, J = r / self.sigma, J * doubt[:, None, :] / self.sigma
            return r, J, (r**2).sum(axis=1) + (x**2).sum(axis=1)

        r, J, cost = fitted(x)
        for _ in range(STARTS):
            A = np.einsum("kia,kib->kab", J, J) + np.eye(2)
            A = A * (1 + damping[:, None, None] * np.eye(2))
            g = np.einsum("kia,ki->ka", J, r) + x
            trial = np.clip(x - np.linalg.solve(A, g[..., None])[..., 0], -START, START)
            new = fitted(trial)
            better = new[2] < cost
            damping = np.where(better, np.maximum(damping / 10, 1e-9), damping * 10)
            x = np.where(better[:, None], trial, x)
            r, J = (
                np.where(better[:, *(None,) * (old.ndim - 1)], n, old)
                for n, old in zip(new[:2], (r, J), strict=True)
            )
            settled = np.all(cost - new[2] < 1e-4 * cost)
            cost = np.where(better, new[2], cost)
            if settled:
                break
        return np.asarray(data.start + doubt * x)

    def _misfits(self, theta: Array, starts: Array, data: Stretches) -> tuple[Array, Array]:
        """Predicted minus measured positions, and their derivatives by the starts."""
        values = theta * self.parameters.scales
        fixed = self.first, self.parameters.slots, self.h
        misfit, J = start_slopes(values, data.filled(starts), data.batch, *fixed)
        n = len(starts)
        return np.nan_to_num(np.asarray(misfit)[:n], nan=1e6), np.nan_to_num(np.asarray(J)[:n])

    def _doubt(self, data: Stretches) -> Array:
        return np.maximum(data.doubt, 1e-9 * self.span)

    def fit(
        self,
        iterations: int,
        method: Method = "lm",
        told: Callable[[str, int, float], None] = lambda stage, number, rms: None,
    ) -> Fit:
        """Fits short windows, longer ones, whole runs.

        Args:
            iterations: at most so many in all.
            method: Levenberg-Marquardt, or Adam as in the paper.
            told: after each, the stage, its number and the stage's RMS misfit.
        """
        history: list[tuple[str, float]] = []
        self._best = self.parameters.start
        self._moved: dict[int, Array] = {}  # by data, how far its starts are from the measured
        interrupted = False
        free = self.parameters.doubt
        ends = np.array([slot.kind == "intervals" for slot in self.parameters.slots])
        held = np.where(ends, HELD * free, free)

        def run(name: str, data: Stretches, most: int, doubt: Array = free) -> None:
            count = min(most, iterations - len(history))

            def heard(misfit: float) -> None:
                history.append((name, misfit))
                told(name, len(history), misfit)

            if count > 0:
                self._stage(data, doubt, count, method, heard)

        try:
            run("short windows, intervals held", self.short, min(FIRST, iterations // 3), held)
            if self.rms(self._best) > FOLLOWS * self.span:
                self._alternate(run, iterations)
            before, shown = self._best, self._windows(self._best)
            run("whole runs", self.whole, iterations)
            if np.any(self._windows(self._best) > UNDONE * shown):
                self._best = before
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
            misfit = float(np.prod(self._windows(self._best)))
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
