"""Fits a model with unknown numbers to windows of measured runs, and says how well it can.

Gauss-Newton over the numbers and every window's start, which is eliminated window by window. A
window's misfit counts in proportion while it is near the noise and only as its logarithm when it is
far off, so that one bad window, or a slightly wrong law, decides nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from joda.diagnosis.windows import Mover, Windows
from joda.joints.least_squares import Inequalities, bounded_step

Array = NDArray[np.float64]
Make = Callable[[Array], Mover]
"""A joint, or a scene, with its numbers."""

BLAS = "blas"
"""Fits' matrices are small: threads of their own would only be in the way of ours."""
BEND = 20.0
"""Mean square residual from which a window counts as its logarithm."""
TRIALS = 6
"""Shorter and shorter steps that an iteration tries."""
SETTLED = 0.5
"""Decrease of the loss below which there is no more to gain."""
NUDGE = 0.01
"""Of a start's doubt: its step for differences."""
ROWS = ((0, 1), (0, 1))
"""Axes of windows and samples, over which products are summed."""


def excess(loss: float, count: float) -> float:
    """A loss per sample, beyond what noise makes of it."""
    return loss / count - BEND * float(np.log1p(1 / BEND))


@dataclass(frozen=True)
class Unknowns:
    """The numbers of a model, shape (k,) each.

    Attributes:
        low, high: bounds.
        step: for central differences.
        mean, doubt: what is known before the data; infinite doubt for nothing.
        constraints: what else must hold.
        widest: to which bounds those may be widened that are only usual, shape (2, k), lows first;
            NaN for what cannot be beyond its bound. None for nothing to widen.
    """

    low: Array
    high: Array
    step: Array
    mean: Array
    doubt: Array
    constraints: Inequalities | None = None
    widest: Array | None = None

    def pressed(self, x: Array) -> bool:
        """Whether a number is as large or as small as is usual, but may be larger or smaller."""
        if self.widest is None:
            return False
        low, high = ~np.isnan(self.widest)
        return bool(np.any(low & (x < self.low + self.step) | high & (x > self.high - self.step)))

    def widened(self) -> "Unknowns":
        """With the widest bounds; itself where these are."""
        if self.widest is None:
            return self
        now = np.stack([self.low, self.high])
        low, high = wide = np.where(np.isnan(self.widest), now, self.widest)
        return self if np.array_equal(wide, now) else replace(self, low=low, high=high)

    def inside(self) -> "Unknowns":
        """With bounds at which no number is pressed."""
        if self.widest is None:
            return self
        low, high = ~np.isnan(self.widest)
        off = np.minimum(2 * self.step, (self.high - self.low) / 2)
        return replace(self, low=self.low + low * off, high=self.high - high * off)

    def and_(self, other: "Unknowns") -> "Unknowns":
        """Both, one after the other."""
        pairs = zip(_parts(self), _parts(other), strict=True)
        low, high, step, mean, doubt = (np.concatenate(pair) for pair in pairs)
        return Unknowns(low, high, step, mean, doubt)

    def some(self, kept: NDArray[np.bool_]) -> "Unknowns":
        """Some of them, without what else must hold."""
        low, high, step, mean, doubt = (part[kept] for part in _parts(self))
        return Unknowns(low, high, step, mean, doubt)

    def penalty(self, x: Array) -> float:
        """What the numbers lose by being off what was known."""
        return float(np.sum(((x - self.mean) / self.doubt) ** 2))


EMPTY = np.zeros(0)
NOTHING = Unknowns(EMPTY, EMPTY, EMPTY, EMPTY, EMPTY)
"""No numbers: only starts are fitted."""


def _parts(unknowns: Unknowns) -> tuple[Array, ...]:
    return tuple(getattr(unknowns, name) for name in ("low", "high", "step", "mean", "doubt"))


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        x: its numbers, shape (k,).
        start: of the windows, shape (m, d).
        squares: sum of squared residuals of each window, shape (m,).
        loss: robust, with the numbers' penalty; twice a negative log-likelihood.
    """

    x: Array
    start: Array
    squares: Array
    loss: float


@dataclass(frozen=True)
class Linear:
    """A model about one point: residuals and their derivatives, weighted.

    Attributes:
        r: shape (m, n).
        J: by the numbers, shape (m, n, k).
        S: by the starts' doubts, shape (m, n, d).
        z: how far the starts are from the measured ones, in doubts, shape (m, d).
        weight: of each window, shape (m,).
    """

    r: Array
    J: Array
    S: Array
    z: Array
    weight: Array

    @cached_property
    def inverse(self) -> Array:
        """Of the starts' own normal matrices, shape (m, d, d)."""
        A = np.einsum("mni,mnj->mij", self.S, self.S) + np.eye(self.S.shape[2])
        return np.asarray(np.linalg.inv(A))

    def products(self, a: Array, b: Array, za: Array | None = None) -> Array:
        """Weighted inner products of what of a and b no start can take up.

        Args:
            a, b: shapes (m, n, p) and (m, n, q).
            za: a's part on the starts' own rows, shape (m, d, p); None: zero.
        """
        across = self.S.transpose(0, 2, 1)
        Sa, Sb = across @ a, across @ b
        if za is not None:
            Sa = Sa + za
        w = self.weight[:, None, None]
        own, taken = np.tensordot(w * a, b, ROWS), np.tensordot(w * Sa, self.inverse @ Sb, ROWS)
        return np.asarray(own - taken)

    def normal(self) -> tuple[Array, Array]:
        """The normal equations of the numbers: matrix and gradient."""
        gradient = self.products(self.r[:, :, None], self.J, self.z[:, :, None])[0]
        return self.products(self.J, self.J), gradient

    def normals(self) -> tuple[Array, Array]:
        """Each window's part of the normal equations: shapes (m, k, k) and (m, k)."""
        w = self.weight[:, None, None]
        across = self.S.transpose(0, 2, 1)
        SJ, Jt = across @ self.J, self.J.transpose(0, 2, 1)
        Sr = across @ self.r[:, :, None] + self.z[:, :, None]
        H = Jt @ self.J - SJ.transpose(0, 2, 1) @ self.inverse @ SJ
        g = Jt @ self.r[:, :, None] - SJ.transpose(0, 2, 1) @ self.inverse @ Sr
        return np.asarray(w * H), np.asarray((w * g)[:, :, 0])

    def follow(self, move: Array) -> Array:
        """How the starts move, in doubts, when the numbers do; shape (m, d)."""
        g = np.einsum("mni,mn->mi", self.S, self.r + self.J @ move) + self.z
        return np.asarray(-np.einsum("mij,mj->mi", self.inverse, g))


@dataclass(frozen=True)
class Judge:
    """Fits models to windows.

    Attributes:
        windows: of the runs.
        counts: which windows count, shape (m,).
        apart: whether a window's start follows the numbers only where that helps the window, so
            that one in which the joint sticks keeps no other from moving.
    """

    windows: Windows
    counts: NDArray[np.bool_]
    apart: bool = False

    @property
    def samples(self) -> float:
        """How many samples count."""
        return float(self.windows.count[self.counts].sum())

    @cached_property
    def coarser(self) -> "Judge":
        """The same in longer steps, see `Windows.coarser`."""
        return replace(self, windows=self.windows.coarser())

    def squares(self, solo: Mover, start: Array) -> tuple[Array, Array]:
        """Residuals, and with the starts' prior their sum of squares by window."""
        windows = self.windows
        r = windows.residuals(windows.misfit(solo, start))
        z = (start - windows.start) / windows.doubt
        return r, (r**2).sum(axis=1) + (z**2).sum(axis=1)

    def loss(self, squares: Array, bend: float = BEND, level: float = 1.0) -> float:
        """Robust sum over the windows that count, where noise makes squares of `level`."""
        room = bend * np.maximum(self.windows.count, 1)
        return float(np.sum((room * np.log1p(squares / level / room))[self.counts]))

    def overdispersion(self, squares: Array) -> float:
        """Robust mean square residual, 1 at least."""
        each = self.loss(squares) / max(self.samples, 1.0)
        return max(each / (BEND * float(np.log1p(1 / BEND))), 1.0)

    def covariance(self, make: Make, unknowns: Unknowns, fit: Fit, doubt: Array) -> Array:
        """Of a fit's numbers, with what is left over as noise, if they were known so well before.

        Args:
            make, unknowns, fit: the model, its numbers, and how they were fitted.
            doubt: their standard deviations before the data, shape (k,).

        Returns:
            shape (k, k).
        """
        H = self.linear(make, unknowns, fit.x, fit.start).normal()[0]
        return np.asarray(
            self.overdispersion(fit.squares) * np.linalg.inv(H + np.diag(doubt**-2.0))
        )

    def linear(
        self,
        make: Make,
        unknowns: Unknowns,
        x: Array,
        start: Array,
        bend: float = BEND,
        central: bool = True,
    ) -> Linear:
        """The model about a point; `central` or one-sided, where slopes are differences."""
        windows, solo = self.windows, make(x)
        r, squares = self.squares(solo, start)
        J, S = self.slopes(make, solo, unknowns, x, start, r, central)
        room = bend * np.maximum(windows.count, 1)
        weight = np.where(self.counts, 1 / (1 + squares / room), 0.0)
        z = (start - windows.start) / windows.doubt
        return Linear(r, J, S, z, weight)

    def slopes(
        self,
        make: Make,
        solo: Mover,
        unknowns: Unknowns,
        x: Array,
        start: Array,
        r: Array,
        central: bool,
    ) -> tuple[Array, Array]:
        """Derivatives of the residuals, by central differences or by one-sided ones.

        Args:
            make, solo: the model, and with the numbers x.
            unknowns: the numbers.
            x, start: the point.
            r: the residuals there.
            central: see above.

        Returns:
            by the numbers and by the starts' doubts, as in `Linear`.
        """
        windows, k = self.windows, len(x)
        off = np.diag(unknowns.step)
        up, down = np.minimum(x + off, unknowns.high), np.maximum(x - off, unknowns.low)
        if not central:
            up = np.where((np.diag(up) > x)[:, None], up, down)
        tried = (*up, *down) if central else tuple(up)
        misfits = [windows.misfit(make(y), start) for y in tried]
        ways = np.eye(start.shape[1])
        misfits += [windows.misfit(solo, start + NUDGE * windows.doubt * way) for way in ways]
        found = windows.residuals(np.stack(misfits, axis=1))
        base = found[:, :, k : 2 * k] if central else r[:, :, None]
        J = (found[:, :, :k] - base) / (np.diag(up - down) if central else np.diag(up) - x)
        S = (found[:, :, len(tried) :] - r[:, :, None]) / NUDGE
        return J, S

    def started(self, solo: Mover, iterations: int = 8) -> Fit:
        """Starts fitted to a joint, each window by itself: where one is stuck, others go on."""
        windows = self.windows
        start = windows.start
        squares = self.squares(solo, start)[1]
        damping, unit = np.full(len(start), 1e-3), np.eye(start.shape[1])
        for _ in range(iterations):
            about = self.linear(lambda _: solo, NOTHING, EMPTY, start)
            A = np.einsum("mni,mnj->mij", about.S, about.S) + unit
            A = A * (1 + damping[:, None, None] * unit)
            g = np.einsum("mni,mn->mi", about.S, about.r) + about.z
            moved = start - windows.doubt * np.linalg.solve(A, g[:, :, None])[:, :, 0]
            trial = self.squares(solo, moved)[1]
            better = trial < squares
            start = np.where(better[:, None], moved, start)
            squares = np.where(better, trial, squares)
            damping = np.where(better, np.maximum(damping / 10, 1e-9), 10 * damping)
        return Fit(EMPTY, start, squares, self.loss(squares))

    def refit(self, make: Make, unknowns: Unknowns, found: Fit, iterations: int = 12) -> Fit:
        """A fit that goes on where some windows do better from a start that is sought anew."""
        anew = self.started(solo := make(found.x))
        better = (anew.squares < found.squares)[:, None]
        start = np.where(better, anew.start, found.start)
        loss = self.loss(self.squares(solo, start)[1]) + unknowns.penalty(found.x)
        if loss > found.loss - SETTLED:
            return found
        return self.fit(make, unknowns, found.x, start, iterations)

    def fit(
        self,
        make: Make,
        unknowns: Unknowns,
        x: Array,
        start: Array | None = None,
        iterations: int = 12,
        bend: float = BEND,
        told: Callable[[Fit], None] = lambda fit: None,
    ) -> Fit:
        """The numbers and starts with the least loss.

        Args:
            make: the joint with its numbers.
            unknowns: the numbers.
            x: where to begin, within the bounds, shape (k,).
            start: of the windows, shape (m, d); None: as measured.
            iterations: at most so many.
            bend: mean square residual from which a window counts as its logarithm.
            told: after each iteration, the best so far.
        """
        windows = self.windows
        start = windows.start if start is None else start
        x = np.clip(x, unknowns.low, unknowns.high)
        squares = self.squares(make(x), start)[1]
        loss = self.loss(squares, bend) + unknowns.penalty(x)
        damping, central = 1e-3, False
        for _ in range(iterations):
            about = self.linear(make, unknowns, x, start, bend, central)
            H, gradient = about.normal()
            H = H + np.diag(unknowns.doubt**-2.0)
            gradient = gradient + (x - unknowns.mean) / unknowns.doubt**2
            before = loss
            for _ in range(TRIALS):
                move = _step(H, gradient, damping, unknowns, x)
                solo, moved = make(x + move), start + windows.doubt * about.follow(move)
                trial = self.squares(solo, moved)[1]
                if self.apart:
                    stayed = self.squares(solo, start)[1]
                    moved = np.where((trial < stayed)[:, None], moved, start)
                    trial = np.minimum(trial, stayed)
                new = self.loss(trial, bend) + unknowns.penalty(x + move)
                if new < loss:
                    x, start, squares, loss = x + move, moved, trial, new
                    damping = max(damping / 10, 1e-6)
                    break
                damping *= 10
            told(Fit(x, start, squares, loss))
            if before - loss < SETTLED:
                if central:
                    break
                damping, central = 1e-3, True  # one-sided differences are cheap, but biased
        return Fit(x, start, squares, loss)


def _step(H: Array, gradient: Array, damping: float, unknowns: Unknowns, x: Array) -> Array:
    """The damped Newton step from x within the bounds and constraints."""
    if (must := unknowns.constraints) is None:
        return _bounded(H, gradient, damping, unknowns.low - x, unknowns.high - x)
    scale = np.maximum(np.diag(H), 1e-12)
    R = np.asarray(np.linalg.cholesky(H + np.diag(damping * scale + 1e-12 * scale.max())).T)
    target = solve_triangular(R, -gradient, trans="T")
    return bounded_step(R, target, must.G, must.h - must.G @ x)


def _bounded(H: Array, gradient: Array, damping: float, low: Array, high: Array) -> Array:
    """The damped Newton step within bounds; numbers that would leave them stop there."""
    scale = np.maximum(np.diag(H), 1e-12)
    A = H + damping * np.diag(scale)
    free = np.ones(len(gradient), bool)
    move = np.zeros(len(gradient))
    for _ in range(len(gradient)):
        if not free.any():
            break
        fixed = ~free
        target = -gradient[free] - A[np.ix_(free, fixed)] @ move[fixed]
        step = np.linalg.lstsq(A[np.ix_(free, free)], target, rcond=None)[0]
        out = (step < low[free] - 1e-12) | (step > high[free] + 1e-12)
        move[free] = np.clip(step, low[free], high[free])
        if not out.any():
            break
        free[np.flatnonzero(free)[out]] = False
    return move
