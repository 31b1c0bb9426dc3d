"""Fits the numbers of a joint's profile to measured motions, by gradients.

First over short windows, each from its own measured start, so that errors do not pile up and the
misfit stays smooth in the numbers; then over longer ones; then over whole runs (multiple shooting:
Bock 1983). The starts are fitted too, within their measurement's error. What the motion does not
show is held by a prior at its first value.
"""

from collections.abc import Callable, Collection, Sequence
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

WINDOWS = (0.1, 0.4, 0.8)
"""Lengths of windows, s."""
WINDOW = 1
"""Which of them tells what the data know."""
ROUND = 2
"""Iterations after which a stage asks anew how far off it is."""
STARTS = 6
"""Iterations that fit the starts of runs."""
START = 3.0
"""How far the start of a run may be from the measured one, in its standard deviations."""
FINEST = 2e-5
"""Least noise that is believed, in units of the range."""
ANNEAL = 0.3
"""What is believed of a misfit before it is fitted: this share of it may be the model's."""
GAIN = 0.003
"""Share of the misfit that a round must take away for the stage to go on."""
LEEWAY = 3.0
"""How many standard deviations of what windows taught count as one, when whole runs are fitted."""
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


def cut(
    runs: Sequence[Run], h: float, sigma: float, window: float | None, like: Data | None = None
) -> Data:
    """Runs, or windows of them, as arrays.

    Args:
        runs: measured; parts where the force is not known are left out.
        h: timestep, s.
        sigma: noise of the position.
        window: length of the windows, s; None: as long as the runs are.
        like: stretches whose size to take, if it is not much larger: compiling takes longer.
    """
    sizes = {(len(part.force), len(part.position)) for part in like.parts} if like else set()
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
                    parts.append(_stretch(inner, position[inside], time - start, force, h, sizes))
                    starts.append((begun.position[k], begun.velocity[k]))
                    doubts.append((begun.position_error[k], begun.velocity_error[k]))
    return Data(tuple(parts), np.array(starts), np.array(doubts))


def _stretch(
    time: Array,
    position: Array,
    forced: Array,
    force: Array,
    h: float,
    sizes: Collection[tuple[int, int]],
) -> Stretch:
    """Samples at times since the start, under a force known at other times since the start."""
    steps, count = _size(int(np.ceil(time[-1] / h - 1e-9)) + 1), _size(len(time))
    fits = [size for size in sizes if steps <= size[0] <= 6 * steps and count <= size[1]]
    steps, count = min(fits, default=(steps, count))
    place = _fill(time / h, count)
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
) -> tuple[jax.Array, jax.Array]:
    """Predicted minus measured positions of one stretch, from a start (position and velocity).

    Twice: to be differentiated, and to be handed through.
    """
    joint = changed(first, slots, values)
    state = State(start[0], start[1], jnp.zeros_like(start[0]))
    path = solo.rollout(joint, state, part.force, h, blur)
    before, after = path[part.index], path[part.index + 1]
    misfit = before + part.weight * (after - before) - part.position
    misfit = jnp.where(part.mask > 0, misfit, 0.0)
    return misfit, misfit


_slopes = jax.jit(jax.jacfwd(_misfit, argnums=(0, 1), has_aux=True), static_argnames=("slots", "h"))
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
        short, middle, long = WINDOWS
        wide = cut(runs, h, self.sigma, long, self.whole)
        near = cut(runs, h, self.sigma, middle)
        self.cuts = (cut(runs, h, self.sigma, short, near), near, wide)
        self.windows = self.cuts[WINDOW]

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
        found = data.start.copy()
        near = Inequalities(np.vstack([np.eye(2), -np.eye(2)]), np.full(4, -START))
        for k, part in enumerate(data.parts):
            one = Data((part,), data.start[k : k + 1], doubt[k : k + 1])

            def residuals(x: Array, one: Data = one) -> Array:
                r = self.misfits(theta, one.start + one.doubt * x, one)[0][0]
                return np.concatenate([r / self.sigma, x])

            def jacobian(x: Array, one: Data = one) -> Array:
                J = self.misfits(theta, one.start + one.doubt * x, one)[2][0] * one.doubt[0]
                return np.vstack([J / self.sigma, np.eye(2)])

            best = levenberg_marquardt(residuals, jacobian, np.zeros(2), near, STARTS)
            found[k] += doubt[k] * best
        return found

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
        """Fits windows with blurred friction, windows longer and longer, whole runs.

        Args:
            iterations: at most so many in all.
            method: Levenberg-Marquardt, or Adam as in the paper.
            told: after each, the stage, its number and the stage's RMS misfit.
        """
        history: list[tuple[str, float]] = []
        self._best = self.parameters.start
        self._moved: dict[int, Array] = {}  # by data, how far its starts are from the measured
        self._prior = self.parameters.start, np.diag(1 / self.parameters.doubt)
        share = max(iterations // 5, 1)
        blur = BLUR * self.span
        names = [f"windows of {length:g} s" for length in WINDOWS]
        stages = (
            (f"{names[0]}, friction blurred", self.cuts[0], blur, min(share, ROUND)),
            *((name, data, 0.0, share) for name, data in zip(names, self.cuts, strict=True)),
            ("whole runs", self.whole, 0.0, iterations),
        )
        interrupted = False
        try:
            for name, data, blurred, limit in stages:
                count = min(limit, iterations - len(history))

                def heard(misfit: float, name: str = name) -> None:
                    history.append((name, misfit))
                    told(name, len(history), misfit)

                if count > 0:
                    if data is self.whole:
                        self._prior = self._learnt()
                    self._stage(data, blurred, count, method, heard)
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
        """Rounds of a stage, until one gains too little."""
        size = ROUND if method == "lm" else iterations
        told_so_far: list[float] = []

        def heard(rms: float) -> None:
            told_so_far.append(rms)
            told(rms)

        while len(told_so_far) < iterations:
            before = told_so_far[-1] if told_so_far else np.inf
            self._round(data, blur, min(size, iterations - len(told_so_far)), method, heard)
            if not told_so_far or told_so_far[-1] > (1 - GAIN) * before:
                break

    def _round(
        self,
        data: Data,
        blur: float,
        iterations: int,
        method: Literal["lm", "adam"],
        told: Callable[[float], None],
    ) -> None:
        """Fits the parameters, and the starts of the stretches within their errors.

        While the misfit is larger than the noise, the prior counts as if that were the noise.
        """
        theta, parameters = self._best, self.parameters
        centre, root = self._prior
        n, count = len(theta), len(data.start)
        doubt = self._doubt(data)
        moved = self._moved.get(id(data), np.zeros(2 * count))
        starts = data.start + doubt * moved.reshape(-1, 2)
        begun = np.concatenate(self.misfits(theta, starts, data, blur)[0])
        sigma = max(
            self.sigma, ANNEAL * float(np.sqrt(np.mean(np.nan_to_num(begun, nan=1e6) ** 2)))
        )

        def split(x: Array) -> tuple[Array, Array]:
            return theta + x[:n], data.start + doubt * x[n:].reshape(-1, 2)

        def residuals(x: Array) -> Array:
            at, starts = split(x)
            r = np.concatenate(self.misfits(at, starts, data, blur)[0]) / sigma
            prior = root @ (at - centre)
            return np.concatenate([np.nan_to_num(r, nan=1e6), prior, x[n:]])

        def jacobian(x: Array) -> Array:
            _, by_theta, by_start = self.misfits(*split(x), data, blur)
            own = [slope * doubt[k] for k, slope in enumerate(by_start)]
            J = np.hstack([np.vstack(by_theta), block_diag(*own)]) / sigma
            return np.vstack([J, block_diag(root, np.eye(2 * count))])

        def heard(_: int, x: Array, __: float) -> None:
            self._best, self._moved[id(data)] = split(x)[0], x[n:]
            r = np.concatenate(self.misfits(*split(x), data)[0])
            told(float(np.sqrt(np.mean(r**2))))

        G = parameters.constraints.G
        wide = Inequalities(
            np.hstack([G, np.zeros((len(G), 2 * count))]),
            parameters.constraints.h - G @ theta,
        )
        minimise = levenberg_marquardt if method == "lm" else adam
        minimise(residuals, jacobian, np.concatenate([np.zeros(n), moved]), wide, iterations, heard)

    def _learnt(self) -> tuple[Array, Array]:
        """What windows have taught, as a prior for whole runs: centre and root of its information.

        A whole run may snap to another side than it did, and its misfit then points anywhere.
        """
        data = self.cuts[-1]
        r = np.concatenate(self.misfits(self._best, self.starts(self._best, data), data)[0])
        sigma = max(self.sigma, float(np.sqrt(np.mean(r**2))))
        root = np.linalg.cholesky(self._information(self._best, data, sigma)).T
        return self._best, np.asarray(root / LEEWAY, float)

    def _information(self, theta: Array, data: Data, sigma: float) -> Array:
        """Of stretches and the first prior about the numbers, their starts being unknown too."""
        starts, doubt = self.starts(theta, data), self._doubt(data)
        total = np.diag(1 / self.parameters.doubt**2)
        _, by_theta, by_start = self.misfits(theta, starts, data)
        for J, S, d in zip(by_theta, by_start, doubt, strict=True):
            own = S * d / sigma
            left = J / sigma
            cross = left.T @ own
            total += left.T @ left - cross @ np.linalg.solve(own.T @ own + np.eye(2), cross.T)
        return np.asarray(0.5 * (total + total.T))

    def _covariance(self, theta: Array) -> Array:
        """From the curvature at the solution, over windows, whose misfits are nearly linear."""
        return np.asarray(np.linalg.inv(self._information(theta, self.windows, self.sigma)))
