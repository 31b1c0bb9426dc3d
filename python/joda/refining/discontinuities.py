"""Fits a profile between the jumps of its force, and then the places of the jumps.

A joint crosses a jump in one step or in the next: what it does then is a staircase in every number
and in every start, on which slopes lead nowhere. Segments that keep clear of all jumps are smooth
in the numbers even if they are long. They are fitted with the jumps held; then each jump is moved
to where short segments over it are missed least, and in the end finely by long ones.
"""

import numpy as np
from numpy.typing import NDArray

from joda.estimation.estimator import SegmentEstimator
from joda.estimation.segments import Segments
from joda.field import evaluate
from joda.profile import CHANNELS
from joda.refining.shooting import MIN_SAMPLES, Progress, Shooting

Array = NDArray[np.float64]

LENGTHS = (0.4, 0.2, 0.1)
"""Lengths of segments, s: the longest is taken that leaves enough of them clear of jumps."""
MIN_SHARE = 0.2
"""Share of the samples that is."""
CLEAR = 0.01
"""How far from a jump a segment is clear of it, in normalised position."""
SIDE = 1e-6
"""How far from a place its two sides are, in normalised position."""
HELD = 1e-4
"""How much less than otherwise a jump may move while the rest is fitted."""
MOVES, FINE = (0.016, 0.004, 0.001), (0.001, 0.0002)
"""By how much jumps are moved by short segments, and in the end by long ones, in normalised
position."""
STEPS = 4
"""Moves of one size that are tried in either direction."""
LESS = 4.0
"""By how much the loss must fall for a jump to be moved: two standard deviations."""
CHANCE = 3.0
"""By how much per number the loss of two good fits may differ by chance."""


def by_chance(least: float, estimator: SegmentEstimator, numbers: int) -> float:
    """By how much the loss of a good fit of so many numbers may be above the least by chance."""
    return CHANCE * numbers * max(least / max(estimator.samples, 1.0), 1.0)


class Between:
    """Fits between the jumps of a joint's force."""

    def __init__(self, shooting: Shooting) -> None:
        """Takes what simulates the joint, and what of its profile may change."""
        self.shooting, self.parameters = shooting, shooting.parameters

    def fit(self, theta: Array, iterations: int, report: Progress) -> Array:
        """The numbers with the least misfit, shape (n,).

        Args:
            theta: where to begin, shape (n,).
            iterations: at most so many; each fits all numbers once, or moves jumps by one size.
            report: see `Progress`.
        """
        count = len(MOVES) + len(FINE)
        jumps = iterations > count + 1 and bool(self._ends(theta))
        rest = iterations - count * jumps
        theta = self._smooth(theta, rest - rest // 2, report)
        for move in MOVES * jumps:
            theta = self._moved(theta, move, LENGTHS[-1], report)
        theta = self._smooth(theta, rest // 2, report)
        return self.placed(theta, report) if jumps else theta

    def placed(self, theta: Array, report: Progress) -> Array:
        """The numbers with jumps moved a little to where long segments over them are missed least;
        see `fit`."""
        for move in FINE:
            theta = self._moved(theta, move, LENGTHS[0], report)
        return theta

    def worse(self, theta: Array, than: Array) -> bool:
        """Whether numbers miss segments between the jumps, or short ones anywhere, by more than
        others and chance do."""
        for estimator in (self._clear(than), self.shooting.estimator(LENGTHS[-1])):
            loss, least = self._loss(estimator, theta), self._loss(estimator, than)
            if loss > least + by_chance(least, estimator, len(theta)):
                return True
        return False

    def _smooth(self, theta: Array, iterations: int, report: Progress) -> Array:
        """Gauss-Newton over segments between the jumps, which are held."""
        estimator = self._clear(theta)
        if not estimator.counts.any():
            return theta
        return self.held(estimator, theta, iterations, report)

    def held(
        self, estimator: SegmentEstimator, theta: Array, iterations: int, report: Progress
    ) -> Array:
        """Gauss-Newton over segments with the jumps held, see `Shooting.fit_segments`."""
        held = np.isin(np.arange(len(theta)), self._ends(theta))
        mean = np.where(held, theta, self.parameters.start)
        prior_std = np.where(held, HELD, 1.0) * self.parameters.prior_std
        return self.shooting.fit_segments(estimator, theta, prior_std, iterations, report, mean)

    def _moved(self, theta: Array, move: float, length: float, report: Progress) -> Array:
        """Each jump in turn where segments over it are missed least, in steps of one size."""
        G, h = self.parameters.constraints.G, self.parameters.constraints.h
        segments, ends = self.shooting.engine.segments(length), self._ends(theta)
        over = self._meet(segments, theta[ends], CLEAR + STEPS * move)
        over &= segments.count >= MIN_SAMPLES
        if not over.any():
            return theta
        if segments.separable:
            segments, over = segments.only(over), np.ones(int(over.sum()), bool)
        estimator = self.shooting.engine.estimator(segments, over)
        best = self.shooting.started(estimator, theta)
        for end in ends:
            about = theta
            for step in (*range(-STEPS, 0), *range(1, STEPS + 1)):
                trial = about.copy()
                trial[end] += step * move
                if np.any(G @ trial < h):
                    continue
                new = self.shooting.started(estimator, trial)
                if new.loss < best.loss - LESS:
                    theta, best = trial, new
        report(theta, self.shooting.robust(estimator, best))
        return theta

    def _jumps(self, theta: Array) -> dict[tuple[str, int, int], float]:
        """Ends of intervals, by channel, component and 0 or 1, where a curve jumps by so much that
        to cross it a step earlier moves the joint by more than the noise: normalised positions."""
        engine = self.shooting.engine
        starts = engine.segments(LENGTHS[-1]).start
        speed = float(np.sqrt(np.mean(starts[:, 1] ** 2)))
        moved = engine.h * LENGTHS[0] / engine.inertia
        channels = self.parameters.written(theta, exact=True).channels
        out = {}
        for name in CHANNELS:
            channel = getattr(channels, name)
            pace = speed if name == "damping" else 1.0
            for number, component in enumerate(channel.components):
                for index, end in enumerate(component.interval):
                    below, above = evaluate(channel, np.array([end - SIDE, end + SIDE]))[0]
                    if abs(above - below) * pace * moved > engine.sigma:
                        out[name, number, index] = end
        return out

    def _ends(self, theta: Array) -> list[int]:
        """Which numbers are places of jumps."""
        jumps, slots = self._jumps(theta), self.parameters.slots
        ends = [k for k, slot in enumerate(slots) if slot.kind == "intervals"]
        return [k for k in ends if (slots[k].channel, slots[k].component, slots[k].index) in jumps]

    def _clear(self, theta: Array) -> SegmentEstimator:
        """Of segments between the jumps."""
        jumps = np.array(list(self._jumps(theta).values()))
        for length in LENGTHS:
            segments = self.shooting.engine.segments(length)
            clear = ~self._meet(segments, jumps, CLEAR)
            estimator = self.shooting.engine.estimator(
                segments, clear & (segments.count >= MIN_SAMPLES)
            )
            if segments.count[estimator.counts].sum() > MIN_SHARE * segments.count.sum():
                break
        return estimator

    def _meet(self, segments: Segments, places: Array, near: float) -> NDArray[np.bool_]:
        """Which segments come near one of some places, in normalised position."""
        lo, hi = self.parameters.profile.joint.range
        s, real = (segments.position[segments.rows] - lo) / (hi - lo), segments.rows >= 0
        first = np.where(real, s, np.inf).min(axis=1, initial=np.inf)[:, None]
        last = np.where(real, s, -np.inf).max(axis=1, initial=-np.inf)[:, None]
        between = (first - near < places) & (places < last + near)
        return np.asarray(between.any(axis=1))

    def _loss(self, estimator: SegmentEstimator, theta: Array) -> float:
        """Of segments, and of being off the first numbers."""
        off = (theta - self.parameters.start) / self.parameters.prior_std
        return estimator.started(self.shooting.simulator(theta)).loss + float(off @ off)
