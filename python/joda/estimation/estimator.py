"""Fits a model with unknown numbers to segments of measured runs, and says how well it can.

Gauss-Newton over the numbers and every segment's start, which is eliminated segment by segment. A
segment's misfit counts in proportion while it is near the noise and only as its logarithm when it
is far off, so that one bad segment, or a slightly wrong law, decides nothing.

SciPy's `least_squares` with the bounds, scales and sparsity of the same problems takes 9.4 times as
long in the median; it ends at less loss in 11 of 23, this in 10
(`python tests/benchmarks scipy_beside 23 1127`). The starts are most of its numbers; here they are
eliminated, and derivatives are only sought anew where a step does not keep what they promise.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from joda.estimation.least_squares import bounded_step
from joda.estimation.segments import Segments, Simulator
from joda.estimation.unknowns import EMPTY, NOTHING, Unknowns

Array = NDArray[np.float64]
Make = Callable[[Array], Simulator]
"""A joint, or a scene, with its numbers."""

CAUCHY_SCALE = 20.0
"""Mean square residual at which the Cauchy loss of a segment bends into a logarithm."""
BACKTRACKS = 6
"""Step lengths that an iteration tries, each shorter than the last."""
LOSS_TOLERANCE = 0.5
"""Decrease of the loss below which a fit has converged."""
LOSS_SHARE = 1e-4
"""The same, of the loss."""
PROMISE = 3.0
"""How many times the decrease that a step promises may come of it and of those after it."""
SECANT, SHORTEST = 0.8, 1e-12
"""Part of a promised decrease that must come for the derivatives to be updated by the step, not
sought anew; and the square of the shortest step that tells of them."""
FIRST_DAMPING, LEAST_DAMPING = 1e-3, 1e-6
"""Of Gauss-Newton's steps, in units of the normal matrix' diagonal."""
STARTED = 0.05
"""Decrease of the squares that is still to be expected, below which starts are fitted."""
EARLY, MISSED, FEW_MISSED = 0.25, 4.0, 0.5
"""By that part of a segment its start is sought too, where it leaves so many times the squares that
noise makes, and no more than a part of all segments does: a joint that runs away soon misses all of
a long one, wherever it began."""
STATE_STEP = 0.01
"""Finite-difference step, in prior standard deviations of the initial state."""
ROWS = ((0, 1), (0, 1))
"""Axes of segments and samples, over which products are summed."""


def excess(loss: float, count: float) -> float:
    """A loss per sample, beyond what noise makes of it."""
    return loss / count - CAUCHY_SCALE * float(np.log1p(1 / CAUCHY_SCALE))


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        x: its numbers, shape (k,).
        start: of the segments, shape (m, d).
        squares: sum of squared residuals of each segment, shape (m,).
        loss: robust, with the numbers' penalty; twice a negative log-likelihood.
        information: inverse covariance of the numbers where the fit made its last step, with what
            is known of them before; shape (k, k). None where it made none.
    """

    x: Array
    start: Array
    squares: Array
    loss: float
    information: Array | None = None


@dataclass(frozen=True)
class Linearization:
    """A model about one point: residuals and their derivatives, weighted.

    Attributes:
        r: shape (m, n).
        J: by the numbers, shape (m, n, k).
        S: by the starts' prior standard deviations, shape (m, n, d).
        z: how far the starts are from the measured ones, in these, shape (m, d).
        weight: of each segment, shape (m,).
    """

    r: Array
    J: Array
    S: Array
    z: Array
    weight: Array

    @cached_property
    def inverse(self) -> Array:
        """Of the starts' own normal matrices, shape (m, d, d)."""
        return np.asarray(np.linalg.inv(self.start_matrix))

    @property
    def start_matrix(self) -> Array:
        """Normal matrix of each segment's start, shape (m, d, d)."""
        return np.asarray(self.S.transpose(0, 2, 1) @ self.S + np.eye(self.S.shape[2]))

    def start_gradient(self, r: Array) -> Array:
        """The gradient that goes with it, where residuals are r; shape (m, d, 1)."""
        return np.asarray(self.S.transpose(0, 2, 1) @ r[:, :, None] + self.z[:, :, None])

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
        """Each segment's part of the normal equations: shapes (m, k, k) and (m, k)."""
        w = self.weight[:, None, None]
        SJ, Jt = self.S.transpose(0, 2, 1) @ self.J, self.J.transpose(0, 2, 1)
        Sr = self.start_gradient(self.r)
        H = Jt @ self.J - SJ.transpose(0, 2, 1) @ self.inverse @ SJ
        g = Jt @ self.r[:, :, None] - SJ.transpose(0, 2, 1) @ self.inverse @ Sr
        return np.asarray(w * H), np.asarray((w * g)[:, :, 0])

    def squares(self, move: Array) -> Array:
        """What is left of each segment's squares when the numbers move, its start following; shape
        (m,)."""
        own = self.follow(move)
        r = self.r + self.J @ move + (self.S @ own[:, :, None])[:, :, 0]
        return np.asarray((r**2).sum(axis=1) + ((self.z + own) ** 2).sum(axis=1))

    def secant(self, r: Array, z: Array, weight: Array, move: Array, unit: Array) -> Self:
        """About where a step ended, by Broyden's update of the derivatives: they change along the
        step only, as the residuals ask for. Source: Madsen, Nielsen and Tingleff (2004), Methods
        for non-linear least squares problems, section 3.5.

        Args:
            r, z, weight: there, see above.
            move: of the numbers, shape (k,).
            unit: of these, in which steps are measured, shape (k,).
        """
        own, along = z - self.z, move / unit
        missed = r - self.r - self.J @ move - (self.S @ own[:, :, None])[:, :, 0]
        missed /= np.maximum(along @ along + (own**2).sum(axis=1), SHORTEST)[:, None]
        J = self.J + missed[:, :, None] * (along / unit)
        return replace(
            self, r=r, J=J, S=self.S + missed[:, :, None] * own[:, None, :], z=z, weight=weight
        )

    def follow(self, move: Array) -> Array:
        """How the starts move, in prior standard deviations, when the numbers do; shape (m, d)."""
        return np.asarray(-(self.inverse @ self.start_gradient(self.r + self.J @ move))[:, :, 0])


@dataclass(frozen=True)
class SegmentEstimator:
    """Fits models to segments.

    Attributes:
        segments: of the runs.
        counts: which segments count, shape (m,).
    """

    segments: Segments
    counts: NDArray[np.bool_]

    @property
    def samples(self) -> float:
        """How many samples count."""
        return float(self.segments.count[self.counts].sum())

    @cached_property
    def tells(self) -> NDArray[np.bool_]:
        """Segments that count, and those in which the joint stays at an end: they tell that a model
        must not leave it, and nothing of noise; shape (m,)."""
        first = self.segments.rows[:, :1]
        stays = (first >= 0) & (self.segments.stays[first] != 0)
        return np.asarray(self.counts | stays.any(axis=1))

    @cached_property
    def coarser(self) -> "SegmentEstimator":
        """The same in longer steps, see `Segments.coarser`."""
        return replace(self, segments=self.segments.coarser())

    def squares(self, simulator: Simulator, start: Array) -> tuple[Array, Array]:
        """Residuals, and with the starts' prior their sum of squares by segment."""
        segments = self.segments
        r = segments.residuals(segments.misfit(simulator, start))
        z = (start - segments.start) / segments.prior_std
        return r, (r**2).sum(axis=1) + (z**2).sum(axis=1)

    def loss(self, squares: Array, cauchy_scale: float = CAUCHY_SCALE, level: float = 1.0) -> float:
        """Robust sum over the segments that tell, where noise makes squares of `level`."""
        return float(np.sum(self.losses(squares, cauchy_scale, level)[self.tells]))

    def losses(
        self, squares: Array, cauchy_scale: float = CAUCHY_SCALE, level: float = 1.0
    ) -> Array:
        """The same of each segment, shape (m,); of an infinite scale the squares themselves."""
        if np.isinf(cauchy_scale):
            return np.asarray(squares / level)
        room = cauchy_scale * np.maximum(self.segments.count, 1)
        return np.asarray(room * np.log1p(squares / level / room))

    def overdispersion(self, squares: Array) -> float:
        """Robust mean square residual, 1 at least."""
        each = self.loss(squares) / max(self.samples, 1.0)
        return max(each / (CAUCHY_SCALE * float(np.log1p(1 / CAUCHY_SCALE))), 1.0)

    def covariance(self, make: Make, unknowns: Unknowns, fit: Fit, prior_std: Array) -> Array:
        """Of a fit's numbers, with what is left over as noise, if they were known so well before.

        Args:
            make, unknowns, fit: the model, its numbers, and how they were fitted.
            prior_std: their standard deviations before the data, shape (k,).

        Returns:
            shape (k, k).
        """
        H = self.linear(make, unknowns, fit.x, fit.start).normal()[0]
        return np.asarray(
            self.overdispersion(fit.squares) * np.linalg.inv(H + np.diag(prior_std**-2.0))
        )

    def linear(
        self,
        make: Make,
        unknowns: Unknowns,
        x: Array,
        start: Array,
        cauchy_scale: float = CAUCHY_SCALE,
        central: bool = True,
    ) -> Linearization:
        """The model about a point; `central` or one-sided, where slopes are differences."""
        at = self._point(make(x), unknowns, x, start, cauchy_scale)
        return self._about(make, unknowns, at, cauchy_scale, central)

    def _about(
        self, make: Make, unknowns: Unknowns, at: "_Point", cauchy_scale: float, central: bool
    ) -> Linearization:
        J, S = self.slopes(make, at.simulator, unknowns, at.x, at.start, at.r, central)
        return Linearization(at.r, J, S, *self._weighed(at, cauchy_scale))

    def _weighed(self, at: "_Point", cauchy_scale: float) -> tuple[Array, Array]:
        """How far starts are from the measured ones, and how much each segment counts."""
        segments = self.segments
        room = cauchy_scale * np.maximum(segments.count, 1)
        weight = np.where(self.tells, 1 / (1 + at.squares / room), 0.0)
        return (at.start - segments.start) / segments.prior_std, weight

    def slopes(
        self,
        make: Make,
        simulator: Simulator,
        unknowns: Unknowns,
        x: Array,
        start: Array,
        r: Array,
        central: bool,
    ) -> tuple[Array, Array]:
        """Derivatives of the residuals, by central differences or by one-sided ones.

        Args:
            make, simulator: the model, and with the numbers x.
            unknowns: the numbers.
            x, start: the point.
            r: the residuals there.
            central: see above.

        Returns:
            by the numbers and by the starts' prior standard deviations, as in `Linearization`.
        """
        segments, k = self.segments, len(x)
        off = np.diag(unknowns.step)
        up, down = np.minimum(x + off, unknowns.high), np.maximum(x - off, unknowns.low)
        if not central:
            up = np.where((np.diag(up) > x)[:, None], up, down)
        tried = (*up, *down) if central else tuple(up)
        misfits = [segments.misfit(make(y), start) for y in tried]
        ways = np.eye(start.shape[1])
        misfits += [
            segments.misfit(simulator, start + STATE_STEP * segments.prior_std * way)
            for way in ways
        ]
        found = segments.residuals(np.stack(misfits, axis=1))
        base = found[:, :, k : 2 * k] if central else r[:, :, None]
        J = (found[:, :, :k] - base) / (np.diag(up - down) if central else np.diag(up) - x)
        S = (found[:, :, len(tried) :] - r[:, :, None]) / STATE_STEP
        return J, S

    def started(self, simulator: Simulator, iterations: int = 8, near: Array | None = None) -> Fit:
        """Starts fitted to a joint, each segment by itself: where one is stuck, others go on.

        Args:
            simulator: the joint.
            iterations: at most.
            near: starts of a fit nearby, shape (m, d); each segment begins there, at the measured
                one, or at rest, whichever it misses least from.
        """
        segments = self.segments
        start, still = segments.start, segments.start.copy()
        still[:, 1] = 0.0
        squares = self.squares(simulator, start)[1]
        for other in (still,) if near is None else (still, near):
            from_other = self.squares(simulator, other)[1]
            start = np.where((from_other < squares)[:, None], other, start)
            squares = np.minimum(from_other, squares)
        found = self._descended(simulator, start, squares, iterations)
        missed = self.tells & (found.squares > MISSED * segments.count)
        if segments.separable and 0 < missed.sum() < FEW_MISSED * self.tells.sum():
            part = segments.only(missed).first(EARLY)
            early = replace(self, segments=part, counts=np.ones(len(part.at), bool))
            own, start = early.segments.start, found.start.copy()
            begun = early._descended(simulator, own, early.squares(simulator, own)[1], iterations)
            start[missed] = begun.start
            squares = self.squares(simulator, start)[1]
            better = squares < found.squares
            if better.any():
                start = np.where(better[:, None], start, found.start)
                squares = np.minimum(squares, found.squares)
                found = self._descended(simulator, start, squares, iterations)
        return found

    def _descended(
        self, simulator: Simulator, start: Array, squares: Array, iterations: int
    ) -> Fit:
        """Starts from which a joint misses less, each segment by itself, and what is left then."""
        segments = self.segments
        damping, unit = np.full(len(start), FIRST_DAMPING), np.eye(start.shape[1])
        for _ in range(iterations):
            about = self.linear(lambda _: simulator, NOTHING, EMPTY, start)
            A = about.start_matrix * (1 + damping[:, None, None] * unit)
            g = about.start_gradient(about.r)
            step = np.linalg.solve(A, g)
            if (step * g).sum() < STARTED:
                break
            moved = start - segments.prior_std * step[:, :, 0]
            trial = self.squares(simulator, moved)[1]
            better = trial < squares
            start = np.where(better[:, None], moved, start)
            squares = np.where(better, trial, squares)
            damping = np.where(better, np.maximum(damping / 10, 1e-9), 10 * damping)
        return Fit(EMPTY, start, squares, self.loss(squares))

    def begun(self, make: Make, x: Array) -> Fit:
        """The joint with numbers, shape (k,), as they are, from the starts that suit it best."""
        return replace(self.started(make(x)), x=x)

    def refit(self, make: Make, unknowns: Unknowns, found: Fit, iterations: int = 12) -> Fit:
        """A fit that goes on where some segments do better from a start that is sought anew."""
        anew = self.started(simulator := make(found.x))
        better = (anew.squares < found.squares)[:, None]
        start = np.where(better, anew.start, found.start)
        loss = self.loss(self.squares(simulator, start)[1]) + unknowns.penalty(found.x)
        if loss > found.loss - LOSS_TOLERANCE:
            return found
        return self.fit(make, unknowns, found.x, start, iterations)

    def fit(
        self,
        make: Make,
        unknowns: Unknowns,
        x: Array,
        start: Array | None = None,
        iterations: int = 12,
        cauchy_scale: float = CAUCHY_SCALE,
        report: Callable[[Fit], None] = lambda fit: None,
        worth: float = np.inf,
        updated: bool = True,
    ) -> Fit:
        """The numbers and starts with the least loss.

        A segment's start follows the numbers only where that helps the segment, so that one in
        which the joint sticks keeps no other from moving.

        Args:
            make: the joint with its numbers.
            unknowns: the numbers.
            x: where to begin, within the bounds, shape (k,).
            start: of the segments, shape (m, d); None: as measured.
            iterations: at most so many.
            cauchy_scale: mean square residual from which a segment counts as its logarithm.
            report: after each iteration, the best so far.
            worth: loss from which on it ends where the next step promises no less.
            updated: whether a step that keeps what it promised may update the derivatives, which
                takes more iterations, of which most cost little; else each seeks them anew.
        """
        x = np.clip(x, unknowns.low, unknowns.high)
        start = self.segments.start if start is None else start
        at = self._point(make(x), unknowns, x, start, cauchy_scale)
        about: Linearization | None = None
        H, damping, central, done = None, FIRST_DAMPING, False, 0
        while done < iterations:
            fresh = about is None
            if about is None:
                about = self._about(make, unknowns, at, cauchy_scale, central)
            H, gradient = about.normal()
            H, gradient = H + unknowns.known, gradient + unknowns.pull(at.x)
            move = _step(H, gradient, damping, unknowns, at.x)
            left = self.loss(about.squares(move), cauchy_scale) + unknowns.penalty(at.x + move)
            promised, enough = at.loss - left, max(LOSS_TOLERANCE, LOSS_SHARE * at.loss)
            if at.loss - PROMISE * promised > worth:
                break
            before, tried = at, damping
            for _ in range(BACKTRACKS):
                there = self._moved(make, unknowns, about, before, move, cauchy_scale, promised)
                if there.loss < before.loss:
                    at, tried = there, max(tried / 10, LEAST_DAMPING)
                    break
                tried *= 10
                move = _step(H, gradient, tried, unknowns, before.x)
            gained = before.loss - at.loss
            if gained < enough and not fresh:
                about = None
                continue
            done, damping = done + 1, tried
            report(Fit(at.x, at.start, at.squares, at.loss, H))
            if gained < enough:
                if central:
                    break
                about, damping, central = None, FIRST_DAMPING, True  # one-sided ones are biased
            elif central or not updated or gained < SECANT * promised:
                about = None
            else:
                about = about.secant(at.r, *self._weighed(at, cauchy_scale), move, unknowns.step)
        return Fit(at.x, at.start, at.squares, at.loss, H)

    def _point(
        self, simulator: Simulator, unknowns: Unknowns, x: Array, start: Array, cauchy_scale: float
    ) -> "_Point":
        """What a model with numbers misses from starts."""
        r, squares = self.squares(simulator, start)
        loss = self.loss(squares, cauchy_scale) + unknowns.penalty(x)
        return _Point(simulator, x, start, r, squares, loss)

    def _moved(
        self,
        make: Make,
        unknowns: Unknowns,
        about: Linearization,
        at: "_Point",
        move: Array,
        cauchy_scale: float,
        promised: float,
    ) -> "_Point":
        """Where a move of the numbers leads, the starts following; where that does not keep what is
        promised, those only that it helps."""
        x, simulator = at.x + move, make(at.x + move)
        start = at.start + self.segments.prior_std * about.follow(move)
        there = self._point(simulator, unknowns, x, start, cauchy_scale)
        if at.loss - there.loss > SECANT * promised:
            return there
        r, squares = self.squares(simulator, at.start)
        helps = there.squares < squares
        r, start = (np.where(helps[:, None], *pair) for pair in ((there.r, r), (start, at.start)))
        squares = np.minimum(squares, there.squares)
        loss = self.loss(squares, cauchy_scale) + unknowns.penalty(x)
        return replace(there, start=start, r=r, squares=squares, loss=loss)


@dataclass(frozen=True)
class _Point:
    """A model with numbers, from starts, shapes (k,) and (m, d), and what it misses: residuals,
    their squares by segment, and the loss."""

    simulator: Simulator
    x: Array
    start: Array
    r: Array
    squares: Array
    loss: float


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
