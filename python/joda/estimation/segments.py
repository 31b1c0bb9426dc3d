"""Measured runs in short segments for the joint by itself in C++, and how much they are missed.

Each segment begins at a state of its own, which is fitted with everything else: errors do not pile
up, and the misfit stays smooth in a model's numbers. What has a memory (friction, play) keeps it
from segment to segment. Noise of the recorded force moves the joint too; residuals are weighted
with the covariance of both noises.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

GRID = 3
"""Segments of runs begin and end at multiples of so many steps: they can be simulated in as many
times longer ones."""
STAYS = 4.0
"""Noises by which a model must leave an end, at which the joint stays, to miss that."""
MIN_SAMPLES = 4
"""Fewest samples of a segment that counts."""
LOOSE = 10.0
"""How much further than its measurement's error a start may be from the measured one."""


class Simulator(Protocol):
    """What moves under a force from the states that it is put to: a joint by itself in C++
    (`joda._core.JointSimulator`), or a scene."""

    def replay(
        self,
        force: ArrayLike,
        at: ArrayLike,
        start: ArrayLike,
        fresh: ArrayLike,
        h: float,
        command: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Positions before and after each step; the arguments are those of `Segments`."""
        ...


@dataclass(frozen=True)
class Segments:
    """Segments of runs, simulated side by side.

    Attributes:
        h: step, s.
        length: of a usual segment, s; impacts and jolts make some shorter.
        force: at each step, N·m or N, shape (steps,); of a scene all that is put into it, shape
            (steps, inputs).
        command: of an actuator there, see `Servo`; None where none acted.
        at: step at which each segment begins, shape (m,).
        fresh: whether it begins a run, shape (m,).
        start: measured position and velocity there, shape (m, 2); of several joints of a scene one
            after the other, shape (m, 2 joints).
        prior_std: their standard deviations, of the same shape.
        step, share: step of each sample, and how far it is into it; shape (n,).
        position: measured, rad or m, shape (n,).
        time: s, shape (n,).
        run: number of each segment's run, shape (m,).
        rows: sample of each place, -1 for filling; shape (m, most samples).
        sharpness: one by the standard deviation of each sample's own noise, 0 for filling; shape
            (m, most samples).
        shared: what of the noise, in those deviations, a segment's samples share: directions V, so
            that (1 - V Vᵀ) leaves residuals of variance 1; shape (m, most samples, r).
        impacts: whether the joint hits an end of its range there, shape (m,).
        rests: whether it only rests at one, which tells of the stop and not of the joint.
        stays: at which end a sample's segment stays though nothing but the recorded force holds it,
            -1 low, 1 high, 0 elsewhere; shape (n,). A model that leaves the end there misses it;
            what is beyond it, the stop alone decides.
    """

    h: float
    length: float
    force: Array
    at: Integers
    fresh: NDArray[np.bool_]
    start: Array
    prior_std: Array
    step: Integers
    share: Array
    position: Array
    time: Array
    run: Integers
    rows: Integers
    sharpness: Array
    shared: Array
    impacts: NDArray[np.bool_]
    rests: NDArray[np.bool_]
    stays: Integers
    command: Array | None = field(default=None, kw_only=True)

    @property
    def pushed(self) -> bool:
        """Whether a hand or an actuator moved the joint."""
        return self.command is not None or bool(self.force.any())

    @property
    def separable(self) -> bool:
        """Whether some can be simulated without the others: those of one joint, see `only`."""
        return bool(self.start.shape[1] == 2)

    @cached_property
    def count(self) -> Integers:
        """Samples of each segment, shape (m,)."""
        return np.asarray((self.rows >= 0).sum(axis=1))

    @property
    def long_enough(self) -> NDArray[np.bool_]:
        """Which segments have enough samples to tell of the joint, shape (m,)."""
        return np.asarray(self.count >= MIN_SAMPLES)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Which segments tell of the joint, shape (m,): enough samples, and neither an impact at an
        end of the range nor nothing but rest there."""
        return np.asarray(self.long_enough & ~self.impacts & ~self.rests)

    def coarser(self) -> "Segments":
        """The same in steps that are `GRID` times longer; commands are the mean over each, forces
        that about its begin, which is where a step takes them to act."""
        own, steps = self.command, np.arange(0, len(self.force), GRID)
        about = steps[:, None] + np.arange(GRID) - GRID // 2
        begins = self.at[self.fresh]
        about = np.maximum(about, begins[np.searchsorted(begins, steps, side="right") - 1, None])
        return replace(
            self,
            h=GRID * self.h,
            force=self.force[about].mean(axis=1),
            command=None if own is None else own.reshape(-1, GRID).mean(axis=1),
            at=self.at // GRID,
            step=self.step // GRID,
            share=(self.step % GRID + self.share) / GRID,
        )

    def only(self, kept: NDArray[np.bool_]) -> "Segments":
        """Some of them, each with the steps up to the next one; shape of `kept`: (m,)."""
        ends = np.append(self.at[1:], len(self.force))
        steps = [np.arange(a, b) for a, b in zip(self.at[kept], ends[kept], strict=True)]
        at = np.cumsum([0, *map(len, steps)])[:-1]
        old = self.rows[kept]
        there = old >= 0
        samples, of = old[there], np.nonzero(there)[0]
        rows = np.full(old.shape, -1)
        rows[there] = np.arange(len(samples))
        own = np.concatenate(steps)
        return replace(
            self,
            force=self.force[own],
            command=None if self.command is None else self.command[own],
            at=at,
            fresh=np.ones(len(at), bool),
            start=self.start[kept],
            prior_std=self.prior_std[kept],
            step=self.step[samples] - self.at[kept][of] + at[of],
            share=self.share[samples],
            position=self.position[samples],
            time=self.time[samples],
            stays=self.stays[samples],
            run=self.run[kept],
            rows=rows,
            sharpness=self.sharpness[kept],
            shared=self.shared[kept],
            impacts=self.impacts[kept],
            rests=self.rests[kept],
        )

    def first(self, part: float) -> "Segments":
        """The same with that part of each segment's samples only, from its begin, and a force as if
        it had no noise: it has hardly moved the joint yet."""
        many = np.maximum(part * self.count, MIN_SAMPLES)
        kept = np.arange(self.rows.shape[1]) < many[:, None]
        return replace(
            self,
            rows=np.where(kept, self.rows, -1),
            sharpness=np.where(kept, self.sharpness, 0.0),
            shared=self.shared[:, :, :0],
        )

    def misfit(self, simulator: Simulator, start: Array) -> Array:
        """Predicted minus measured positions, rad or m, shape (n,); where the joint stays at an
        end, only how far it is said to leave that by more than noise."""
        starts = self.at, start, self.fresh
        moved = simulator.replay(self.force, *starts, self.h, self.command)
        misfit = self.sampled(*moved) - self.position
        at, side, room = self._staying
        misfit[at] = side * np.minimum(side * misfit[at] + room, 0.0)
        return misfit

    @cached_property
    def _staying(self) -> tuple[Integers, Integers, Array]:
        """Samples at which the joint stays at an end, which that is, and what noise makes there."""
        there = self.rows >= 0
        there[there] = self.stays[self.rows[there]] != 0
        at = self.rows[there]
        return at, self.stays[at], STAYS / self.sharpness[there]

    def sampled(self, before: Array, after: Array) -> Array:
        """What is known before and after each step, shape (steps, ...), at the samples."""
        here, share = before[self.step], self.share
        share = share.reshape(-1, *[1] * (here.ndim - 1))
        return np.asarray(here + share * (after[self.step] - here))

    def residuals(self, misfit: Array) -> Array:
        """Of variance 1 where the model is true; filling is 0.

        Args:
            misfit: one, shape (n,), or several, shape (n, k).

        Returns:
            shape (m, most samples) or (m, most samples, k).
        """
        found = self.whitened(misfit)
        np.clip(found, -HUGE, HUGE, out=found)
        np.copyto(found, HUGE, where=np.isnan(found))
        return found

    def whitened(self, misfit: Array) -> Array:
        """The same, however large: of misfits, or of their derivatives."""
        each = misfit.reshape(len(misfit), -1)
        own = self.sharpness[:, :, None] * each[self.rows]
        own -= self.shared @ (self.shared.transpose(0, 2, 1) @ own)
        return np.asarray(own.reshape(*self.rows.shape, *misfit.shape[1:]))


HUGE = 1e4
"""Largest residual: a simulation that goes astray counts as one that is far off."""


def evenly(
    simulator: Simulator,
    force: Array,
    position: Array,
    velocity: Array,
    free: NDArray[np.bool_],
    h: float,
    length: float,
    sigma: float,
) -> Segments:
    """Segments of what a joint does under a force, without noise.

    Args:
        simulator: the joint.
        force: at each step, shape (n,).
        position, velocity: where a segment begins, the joint is put there; shape (n,).
        free: steps at which it is not: it goes on by itself.
        h: step, s.
        length: of the segments, s.
        sigma: noise to which misfits are compared, rad or m.
    """
    n = len(force)
    each = max(round(length / h), 2)
    at = np.arange(0, max(n - each // 2, 1), each)
    own = at[~free[at]]
    path = simulator.replay(
        force, own, np.stack([position[own], velocity[own]], axis=1), own == 0, h
    )[0]
    speed = np.gradient(path, h)
    start = np.stack([path[at], np.where(free[at], speed[at], velocity[at])], axis=1)
    segment = np.searchsorted(at, np.arange(n), side="right") - 1
    rows = rows_of(segment, len(at))
    return Segments(
        h=h,
        length=length,
        force=force,
        at=at,
        fresh=at == 0,
        start=start,
        prior_std=np.tile([LOOSE * sigma, LOOSE * sigma / length], (len(at), 1)),
        step=np.arange(n),
        share=np.zeros(n),
        position=path,
        time=np.asarray(h * np.arange(n)),
        run=np.zeros(len(at), int),
        rows=rows,
        sharpness=np.where(rows >= 0, 1 / sigma, 0.0),
        shared=np.zeros((*rows.shape, 0)),
        impacts=np.zeros(len(at), bool),
        rests=np.zeros(len(at), bool),
        stays=np.zeros(n, int),
    )


def rows_of(segment: Integers, count: int) -> Integers:
    """Samples of each segment, filled up with -1."""
    groups = [np.flatnonzero(segment == k) for k in range(count)]
    out = np.full((count, max(map(len, groups), default=0)), -1)
    for row, group in zip(out, groups, strict=True):
        row[: len(group)] = group
    return out
