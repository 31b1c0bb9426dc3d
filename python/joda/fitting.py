"""Fits the numbers of a joint's profile to measured motions, by gradients.

First over short windows, each from its own measured start, so that errors do not pile up and the
misfit stays smooth in the numbers; then over whole runs, whose starts are fitted too, within their
measurement's error. What the motion does not show is held by a prior at its first value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from joda import smoothing, solo
from joda.least_squares import Inequalities, adam, levenberg_marquardt
from joda.parameters import Parameters, Slot
from joda.runs import Run
from joda.solo import Solo, State, changed

jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call]

Array = NDArray[np.float64]
Traced = Any
"""A NumPy array outside, JAX's own inside a compiled function."""

WINDOW = 0.4
"""Length of a window, s."""
STARTS = 3
"""Iterations that fit the starts of runs."""
FINEST = 2e-5
"""Least noise that is believed, in units of the range."""
BLUR = 0.05
"""Speed below which friction is blurred at first, in ranges per second."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=("force", "position", "index", "weight", "mask"),
    meta_fields=(),
)
@dataclass(frozen=True)
class Stretch:
    """A stretch of a run, filled up to a round size.

    Attributes:
        force: at each step, shape (steps,).
        position: measured, shape (samples,).
        index, weight: of the step before each sample, and how far it is to the next.
        mask: 1 for samples, 0 for filling.
    """

    force: Traced
    position: Traced
    index: Traced
    weight: Traced
    mask: Traced


@dataclass(frozen=True)
class Data:
    """Stretches of runs.

    Attributes:
        parts: the stretches.
        start: measured position and velocity at their beginnings, shape (stretches, 2).
        doubt: their standard deviations, shape (stretches, 2).
    """

    parts: tuple[Stretch, ...]
    start: Array
    doubt: Array

    @property
    def samples(self) -> int:
        """How many there are in all."""
        return int(sum(part.mask.sum() for part in self.parts))


def cut(runs: Sequence[Run], h: float, sigma: float, window: float | None) -> Data:
    """Runs, or windows of them, as arrays.

    Args:
        runs: measured; parts where the force is not known are left out.
        h: timestep, s.
        sigma: noise of the position.
        window: length of the windows, s; None: as long as the runs are.
    """
    parts, starts, doubts = [], [], []
    for run in runs:
        for piece in _known(run):
            time, position, force = run.time[piece], run.position[piece], run.force[piece]
            begins = time[:1]
            if window is not None:
                count = max(int((time[-1] - time[0]) / window), 1)
                begins = time[0] + window * np.arange(count)
            begun = smoothing.smooth(time, position, begins, sigma)
            for k, start in enumerate(begins):
                end = time[-1] if window is None else min(start + window, time[-1])
                inside = (time >= start) & (time <= end + 1e-12)
                if inside.sum() >= 4:
                    inner = time[inside] - start
                    parts.append(_stretch(inner, position[inside], time - start, force, h))
                    starts.append((begun.position[k], begun.velocity[k]))
                    doubts.append((begun.position_error[k], begun.velocity_error[k]))
    return Data(tuple(parts), np.array(starts), np.array(doubts))


def _stretch(time: Array, position: Array, forced: Array, force: Array, h: float) -> Stretch:
    """Samples at times since the start, under a force known at other times since the start."""
    steps = _size(int(np.ceil(time[-1] / h - 1e-9)) + 1)
    place = _fill(time / h, _size(len(time)))
    index = np.clip(np.floor(place + 1e-9), 0, steps - 1).astype(int)
    return Stretch(
        force=np.interp(h * np.arange(steps), forced, force),
        position=_fill(position, len(place)),
        index=index,
        weight=place - index,
        mask=_fill(np.ones(len(time)), len(place), 0.0),
    )


def _size(number: int) -> int:
    """The number rounded up to a power of two, or to three quarters of one."""
    power = 1 << max(number - 1, 1).bit_length()
    return power * 3 // 4 if number <= power * 3 // 4 else power


def _known(run: Run) -> list[NDArray[np.intp]]:
    """Parts of a run in which the force is known, as indices."""
    known = np.flatnonzero(~np.isnan(run.force))
    groups = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    return [group for group in groups if len(group) >= smoothing.LEAST]


def _fill(values: Array, size: int, value: float | None = None) -> Array:
    last = values[-1] if value is None else value
    return np.concatenate([values, np.full(size - len(values), last)])


def _misfit(
    values: jax.Array,
    start: jax.Array,
    part: Stretch,
    first: Solo,
    blur: jax.Array,
    slots: tuple[Slot, ...],
    h: float,
) -> jax.Array:
    """Predicted minus measured positions of one stretch, from a start (position and velocity)."""
    joint = changed(first, slots, values)
    state = State(start[0], start[1], jnp.zeros_like(start[0]))
    path = solo.rollout(joint, state, part.force, h, blur)
    before, after = path[part.index], path[part.index + 1]
    return part.mask * (before + part.weight * (after - before) - part.position)


def _and_misfit(
    values: jax.Array,
    start: jax.Array,
    part: Stretch,
    first: Solo,
    blur: jax.Array,
    slots: tuple[Slot, ...],
    h: float,
) -> tuple[jax.Array, jax.Array]:
    misfit = _misfit(values, start, part, first, blur, slots, h)
    return misfit, misfit


_slopes = jax.jit(
    jax.jacfwd(_and_misfit, argnums=(0, 1), has_aux=True), static_argnames=("slots", "h")
)
"""Derivatives by the values and by the start, and the misfit itself. Compiled once per structure of
the joint and size of the data, which is why sizes are rounded up (`_size`)."""


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
        self.runs = [(run.time[k], run.position[k]) for run in runs for k in _known(run)]
        self.whole = cut(runs, h, self.sigma, None)
        self.windows = cut(runs, h, self.sigma, WINDOW)

    def misfits(
        self, theta: Array, starts: Array, data: Data, blur: float = 0.0
    ) -> tuple[list[Array], list[Array], list[Array]]:
        """Predicted minus measured positions of each stretch, and their derivatives.

        Args:
            theta: the parameters' numbers, shape (n,).
            starts: position and velocity at the beginnings, shape (stretches, 2).
            data: the stretches.
            blur: see `joda.solo.step`.

        Returns:
            per stretch: misfits (samples,), by theta (samples, n), by the start (samples, 2).
        """
        values, scales = theta * self.parameters.scales, self.parameters.scales
        fixed = self.first, blur, self.parameters.slots, self.h
        out: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
        for start, part in zip(starts, data.parts, strict=True):
            slopes, misfit = _slopes(values, start, part, *fixed)
            real = part.mask > 0
            for found, array in zip(
                out, (misfit, np.asarray(slopes[0]) * scales, slopes[1]), strict=True
            ):
                found.append(np.asarray(array)[real])
        return out

    def starts(self, theta: Array, data: Data) -> Array:
        """The starts, within their measurement's errors, from which the prediction fits best."""
        doubt = self._doubt(data)
        x = np.zeros_like(data.start)
        for _ in range(STARTS):
            r, _, slopes = self.misfits(theta, data.start + doubt * x, data)
            for k, (misfit, slope) in enumerate(zip(r, slopes, strict=True)):
                J = slope * doubt[k] / self.sigma
                x[k] -= np.linalg.solve(J.T @ J + np.eye(2), J.T @ misfit / self.sigma + x[k])
        return np.asarray(data.start + doubt * np.clip(x, -4, 4))

    def _doubt(self, data: Data) -> Array:
        return np.maximum(data.doubt, 1e-9 * self.span)

    def rms(self, theta: Array) -> float:
        """RMS misfit of whole runs, from starts that are fitted, rad or m."""
        r = np.concatenate(self.misfits(theta, self.starts(theta, self.whole), self.whole)[0])
        return float(np.sqrt(np.mean(r**2)))

    def paths(self, theta: Array) -> list[Array]:
        """Predicted positions at the times of `runs`, from starts that are fitted."""
        misfits = self.misfits(theta, self.starts(theta, self.whole), self.whole)[0]
        pairs = zip(misfits, self.runs, strict=True)
        return [position + misfit for misfit, (_, position) in pairs]

    def fit(
        self,
        iterations: int,
        method: Literal["lm", "adam"] = "lm",
        told: Callable[[str, int, float], None] = lambda stage, number, rms: None,
    ) -> Fit:
        """Fits in three stages: windows with blurred friction, windows, whole runs.

        Args:
            iterations: at most so many in all.
            method: Levenberg-Marquardt, or Adam as in the paper.
            told: after each, the stage, its number and the stage's RMS misfit.
        """
        history: list[tuple[str, float]] = []
        self._best = self.parameters.start
        most = 2 if method == "lm" else max(iterations // 3, 1)
        stages = (
            ("windows, friction blurred", self.windows, BLUR * self.span, most),
            ("windows", self.windows, 0.0, most),
            ("whole runs", self.whole, 0.0, iterations),
        )
        interrupted = False
        try:
            for name, data, blur, limit in stages:
                count = min(limit, iterations - len(history))

                def heard(misfit: float, name: str = name) -> None:
                    history.append((name, misfit))
                    told(name, len(history), misfit)

                if count > 0:
                    self._stage(data, blur, count, method, heard)
        except KeyboardInterrupt:
            interrupted = True
        return Fit(self._best, self._covariance(self._best), tuple(history), interrupted)

    def _stage(
        self,
        data: Data,
        blur: float,
        iterations: int,
        method: Literal["lm", "adam"],
        told: Callable[[float], None],
    ) -> None:
        """Fits to windows from fixed starts, to whole runs with starts that are fitted too."""
        theta, parameters = self._best, self.parameters
        n = len(theta)
        free = data is self.whole
        count = len(data.start) if free else 0
        doubt = self._doubt(data)

        def split(x: Array) -> tuple[Array, Array]:
            return x[:n], data.start + doubt * x[n:].reshape(-1, 2) if free else data.start

        def residuals(x: Array) -> Array:
            r = np.concatenate(self.misfits(*split(x), data, blur)[0]) / self.sigma
            prior = (x[:n] - parameters.start) / parameters.doubt
            return np.concatenate([np.nan_to_num(r, nan=1e6), prior, x[n:]])

        def jacobian(x: Array) -> Array:
            _, by_theta, by_start = self.misfits(*split(x), data, blur)
            own = [slope * doubt[k] for k, slope in enumerate(by_start[:count])]
            J = np.hstack([np.vstack(by_theta), block_diag(*own)]) if own else np.vstack(by_theta)
            prior = np.diag(np.concatenate([1 / parameters.doubt, np.ones(2 * count)]))
            return np.vstack([J / self.sigma, prior])

        def heard(_: int, x: Array, __: float) -> None:
            self._best = x[:n]
            r = np.concatenate(self.misfits(*split(x), data)[0])
            told(float(np.sqrt(np.mean(r**2))))

        G = parameters.constraints.G
        wide = Inequalities(np.hstack([G, np.zeros((len(G), 2 * count))]), parameters.constraints.h)
        begun = np.concatenate([theta, np.zeros(2 * count)])
        minimise = levenberg_marquardt if method == "lm" else adam
        minimise(residuals, jacobian, begun, wide, iterations, heard)

    def _covariance(self, theta: Array) -> Array:
        """From the curvature at the solution, over windows, whose misfits are nearly linear."""
        by_theta = self.misfits(theta, self.windows.start, self.windows)[1]
        J = np.vstack(by_theta) / self.sigma
        return np.asarray(np.linalg.inv(J.T @ J + np.diag(1 / self.parameters.doubt**2)))
