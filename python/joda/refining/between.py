"""Fits a profile between the jumps of its force, and then the places of the jumps.

A joint crosses a jump in one step or in the next: what it does then is a staircase in every number
and in every start, on which slopes lead nowhere. Windows that keep clear of all jumps are smooth
in the numbers even if they are long. They are fitted with the jumps held; then each jump is moved
to where short windows over it are missed least.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from joda._core import Solo
from joda.diagnosis.cutting import windows_of
from joda.diagnosis.judge import Fit as Found
from joda.diagnosis.judge import Judge, Unknowns
from joda.diagnosis.windows import Windows
from joda.field import evaluate
from joda.joints.parameters import Parameters
from joda.joints.single import Single
from joda.measured.runs import Run
from joda.profile import CHANNELS, Profile

Array = NDArray[np.float64]
Told = Callable[[Array, float], None]
"""After each iteration, the numbers and the RMS misfit (rad or m)."""

LENGTHS = (0.4, 0.2, 0.1)
"""Lengths of windows, s: the longest is taken that leaves enough of them clear of jumps."""
ENOUGH = 0.2
"""Share of the samples that is."""
LEAST = 4
"""Fewest samples of a window that counts."""
CLEAR = 0.01
"""How far from a jump a window is clear of it, in normalised position."""
SIDE = 1e-6
"""How far from a place its two sides are, in normalised position."""
HELD = 1e-4
"""How much less than otherwise a jump may move while the rest is fitted."""
NUDGE = 0.004
"""Step of a number for differences, in its own unit."""
MOVES = (0.016, 0.004, 0.001)
"""By how much jumps are moved, in normalised position."""
STEPS = 4
"""Moves of one size that are tried in either direction."""
LESS = 4.0
"""By how much the loss must fall for a jump to be moved: two standard deviations."""
CHANCE = 3.0
"""By how much per number the loss of two good fits may differ by chance."""


class Between:
    """A joint, what of its profile may change, and its measured runs."""

    def __init__(
        self,
        single: Single,
        parameters: Parameters,
        runs: Sequence[Run],
        sigma: float,
        h: float,
        whole: Callable[[Profile], Profile] = lambda profile: profile,
    ) -> None:
        """Args: the joint; what may change; runs; their noise, rad or m; timestep, s; what makes
        all that acts on the joint of its profile."""
        self.single, self.parameters, self.runs = single, parameters, runs
        self.sigma, self.h, self.whole = sigma, h, whole
        self._cut: dict[float, Windows] = {}

    def fit(self, theta: Array, iterations: int, told: Told) -> Array:
        """The numbers with the least misfit, shape (n,).

        Args:
            theta: where to begin, shape (n,).
            iterations: at most so many; each fits all numbers once, or moves jumps by one size.
            told: see `Told`.
        """
        moves = MOVES if iterations > len(MOVES) + 1 and len(self._ends(theta)) else ()
        rest = iterations - len(moves)
        theta = self._smooth(theta, rest - rest // 2, told)
        for move in moves:
            theta = self._moved(theta, move, told)
        return self._smooth(theta, rest // 2, told)

    def worse(self, theta: Array, than: Array) -> bool:
        """Whether numbers miss windows between the jumps by more than others and chance do."""
        judge = self._clear(than)
        loss, least = self._loss(judge, theta), self._loss(judge, than)
        usual = least / max(int(judge.windows.count[judge.counts].sum()), 1)
        return loss > least + CHANCE * len(theta) * max(usual, 1.0)

    def body(self, theta: Array) -> Single:
        """All of the joint but its profile, with its numbers."""
        slots, scales = self.parameters.slots, self.parameters.scales
        by_slot: dict[str, float] = {s.kind: x for s, x in zip(slots, theta * scales, strict=True)}

        def of(kind: str) -> float:
            return float(by_slot.get(kind, 0.0))

        old = self.single
        return replace(
            old,
            inertia=old.inertia * float(np.exp(of("inertia"))),
            solref=(old.solref[0], old.solref[1] * float(np.exp(of("damping_ratio")))),
        )

    def solo(self, theta: Array) -> Solo:
        """The joint with its numbers."""
        profile = self.whole(self.parameters.written(theta, exact=True))
        # a restitution of both ends is in the solver parameters already
        kept = tuple(e for e in profile.effects if e.key != "end_stop_restitution both")
        return self.body(theta).solo(profile.model_copy(update={"effects": kept}), self.h)

    def about(self, parameters: Parameters) -> "Between":
        """The same joint and runs with other numbers."""
        other = Between(self.single, parameters, self.runs, self.sigma, self.h, self.whole)
        other._cut = self._cut
        return other

    def judge(self, length: float) -> Judge:
        """Of windows of some length, s."""
        windows = self._windows(length)
        return Judge(windows, windows.count >= LEAST, apart=True)

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
        mean = self.parameters.start if held is None else held
        unknowns = self._unknowns(mean, doubt)
        start = judge.started(self.solo(theta)).start

        def heard(fit: Found) -> None:
            told(fit.x, self._rms(judge, fit))

        return judge.fit(self.solo, unknowns, theta, start, iterations, told=heard).x

    def covariance(self, judge: Judge, theta: Array) -> Array:
        """Of the numbers' errors, from windows and the prior, shape (n, n)."""
        doubt = self.parameters.doubt
        unknowns = self._unknowns(self.parameters.start, doubt)
        start = judge.started(self.solo(theta)).start
        H = judge.linear(self.solo, unknowns, theta, start, bend=np.inf).normal()[0]
        return np.asarray(np.linalg.inv(H + np.diag(doubt**-2.0)))

    def rms(self, judge: Judge, theta: Array) -> float:
        """RMS misfit of windows, from starts that are fitted, rad or m."""
        rows = judge.windows.rows[judge.counts]
        return float(np.sqrt(np.mean(self.misfit(judge, theta)[rows[rows >= 0]] ** 2)))

    def misfit(self, judge: Judge, theta: Array) -> Array:
        """Predicted minus measured positions, from starts that are fitted, rad or m, shape (n,)."""
        solo = self.solo(theta)
        return judge.windows.misfit(solo, judge.started(solo).start)

    def _unknowns(self, mean: Array, doubt: Array) -> Unknowns:
        n = len(mean)
        bounds = np.full(n, -np.inf), np.full(n, np.inf)
        return Unknowns(*bounds, np.full(n, NUDGE), mean, doubt, self.parameters.constraints)

    def _smooth(self, theta: Array, iterations: int, told: Told) -> Array:
        """Gauss-Newton over windows between the jumps, which are held."""
        judge = self._clear(theta)
        if not judge.counts.any():
            return theta
        held = np.isin(np.arange(len(theta)), self._ends(theta))
        mean = np.where(held, theta, self.parameters.start)
        doubt = np.where(held, HELD, 1.0) * self.parameters.doubt
        return self.fit_windows(judge, theta, doubt, iterations, told, mean)

    def _moved(self, theta: Array, move: float, told: Told) -> Array:
        """Each jump in turn where short windows over it are missed least, in steps of one size."""
        G, h = self.parameters.constraints.G, self.parameters.constraints.h
        windows, ends = self._windows(LENGTHS[-1]), self._ends(theta)
        over = self._meet(windows, theta[ends], CLEAR + STEPS * move)
        judge = Judge(windows, over & (windows.count >= LEAST))
        best = judge.started(self.solo(theta))
        for end in ends:
            about = theta
            for step in (*range(-STEPS, 0), *range(1, STEPS + 1)):
                trial = about.copy()
                trial[end] += step * move
                if np.any(G @ trial < h):
                    continue
                new = judge.started(self.solo(trial))
                if new.loss < best.loss - LESS:
                    theta, best = trial, new
        told(theta, self._rms(judge, best))
        return theta

    def _jumps(self, theta: Array) -> dict[tuple[str, int, int], float]:
        """Ends of intervals, by channel, component and 0 or 1, where a curve jumps by so much that
        to cross it a step earlier moves the joint by more than the noise: normalised positions."""
        starts = self._windows(LENGTHS[-1]).start
        speed = float(np.sqrt(np.mean(starts[:, 1] ** 2)))
        moved = self.h * LENGTHS[0] / self.single.inertia
        channels = self.parameters.written(theta, exact=True).channels
        out = {}
        for name in CHANNELS:
            channel = getattr(channels, name)
            pace = speed if name == "damping" else 1.0
            for number, component in enumerate(channel.components):
                for index, end in enumerate(component.interval):
                    below, above = evaluate(channel, np.array([end - SIDE, end + SIDE]))[0]
                    if abs(above - below) * pace * moved > self.sigma:
                        out[name, number, index] = end
        return out

    def _ends(self, theta: Array) -> list[int]:
        """Which numbers are places of jumps."""
        jumps, slots = self._jumps(theta), self.parameters.slots
        ends = [k for k, slot in enumerate(slots) if slot.kind == "intervals"]
        return [k for k in ends if (slots[k].channel, slots[k].component, slots[k].index) in jumps]

    def _clear(self, theta: Array) -> Judge:
        """Of windows between the jumps."""
        jumps = np.array(list(self._jumps(theta).values()))
        for length in LENGTHS:
            windows = self._windows(length)
            clear = ~self._meet(windows, jumps, CLEAR)
            judge = Judge(windows, clear & (windows.count >= LEAST), apart=True)
            if windows.count[judge.counts].sum() > ENOUGH * windows.count.sum():
                break
        return judge

    def _meet(self, windows: Windows, places: Array, near: float) -> NDArray[np.bool_]:
        """Which windows come near one of some places, in normalised position."""
        lo, hi = self.parameters.profile.joint.range
        s, real = (windows.position[windows.rows] - lo) / (hi - lo), windows.rows >= 0
        first = np.where(real, s, np.inf).min(axis=1, initial=np.inf)[:, None]
        last = np.where(real, s, -np.inf).max(axis=1, initial=-np.inf)[:, None]
        between = (first - near < places) & (places < last + near)
        return np.asarray(between.any(axis=1))

    def _loss(self, judge: Judge, theta: Array) -> float:
        """Of windows, and of being off the first numbers."""
        off = (theta - self.parameters.start) / self.parameters.doubt
        return judge.started(self.solo(theta)).loss + float(off @ off)

    def _rms(self, judge: Judge, fit: Found) -> float:
        """RMS misfit of windows that count, rad or m."""
        count = int(judge.windows.count[judge.counts].sum())
        return self.sigma * float(np.sqrt(fit.squares[judge.counts].sum() / max(count, 1)))

    def _windows(self, length: float) -> Windows:
        """The runs in windows of some length, s."""
        if length not in self._cut:
            lo, hi = self.parameters.profile.joint.range
            fixed = hi - lo, lo, self.single.inertia, self.h
            sigmas = [self.sigma] * len(self.runs)
            self._cut[length] = windows_of(self.runs, sigmas, *fixed, length, fine=False)
        return self._cut[length]
