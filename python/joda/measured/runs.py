"""What was measured of a joint: timed runs, and quasi-static curves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.measured import smoothing

Array = NDArray[np.float64]

CLEAR, LEFT = 3.0, 2.0
"""How far off an end a joint must be, in noises, not to be at it; and by how much farther to have
left it."""
STOP = 0.004
"""How near an end of the range, in normalised position, counts as touching it, beside noise."""

MIN_SAMPLES = 4
"""Fewest samples that make a run or a curve."""
WIDER = 2.5
"""Gaps, in units of the usual one, over which a force is not taken as linear."""


@dataclass(frozen=True)
class Run:
    """A measured motion; all arrays have shape (n,).

    Attributes:
        name: of its file.
        time: s, strictly increasing, perhaps uneven.
        position: rad or m, zero and sign as the joint's qpos.
        velocity: rad/s or m/s; None where it was not measured.
        force: applied to the joint from outside, N·m or N; NaN where it is not known, zero where
            the file has no such column.
        forced: whether the file has the column.
        force_std: standard deviation of the force besides what its samples show, shape (n,);
            None for none.
        command: of the actuators on the joint (`joda.scenes.actuators.Drive`), held from its sample
            to the next, N·m or N; None where none acted.
        among: whether other joints moved meanwhile, and contacts were looked for along that.
        origin: what was subtracted from the file's times, s.
        unread: names of the file's other columns.
        cut: whether samples before the first were left out: it may move there already.
    """

    name: str
    time: Array
    position: Array
    velocity: Array | None
    force: Array
    forced: bool
    force_std: Array | None = None
    command: Array | None = None
    among: bool = False
    origin: float = 0.0
    unread: tuple[str, ...] = ()
    cut: bool = False

    def part(self, samples: slice | NDArray[np.intp]) -> Self:
        """The run with some of its samples only."""
        return replace(
            self,
            time=self.time[samples],
            position=self.position[samples],
            velocity=None if self.velocity is None else self.velocity[samples],
            force=self.force[samples],
            force_std=None if self.force_std is None else self.force_std[samples],
            command=None if self.command is None else self.command[samples],
        )

    def force_error(self) -> Array:
        """Standard deviations of the force, N·m or N, shape (n,); it must be known."""
        own = smoothing.force_error(self.time, self.force, self.forced)
        return own if self.force_std is None else np.hypot(own, self.force_std)

    @property
    def pushed(self) -> bool:
        """Whether anything that is known pushed the joint: a hand, or an actuator."""
        return self.forced or self.command is not None


@dataclass(frozen=True)
class QuasiStatic:
    """Force against position, as with a hand-held gauge; arrays have shape (n,).

    Attributes:
        name: of its file.
        position: rad or m, in the order measured: the direction of travel follows from it.
        force: that slowly moves the joint there, N·m or N.
        unread: names of the file's other columns.
    """

    name: str
    position: Array
    force: Array
    unread: tuple[str, ...] = ()


def known(run: Run) -> list[NDArray[np.intp]]:
    """Parts of a run in which the force is known, as indices; those too short to smooth are not."""
    numbers = np.flatnonzero(~np.isnan(run.force))
    groups = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [group for group in groups if len(group) >= smoothing.MIN_SAMPLES]


def check_known(runs: Sequence[Run]) -> None:
    """Raises JodaError where no run has a stretch in which the force is known."""
    if runs and not any(known(run) for run in runs):
        raise JodaError(
            f"{', '.join(run.name for run in runs)}: nowhere is 'force' filled in for "
            f"{smoothing.MIN_SAMPLES} samples in a row; give the force of each sample, or leave "
            "the column out where nothing moved the joint."
        )


def evened(run: Run) -> tuple[Run, str | None]:
    """A run of which a slower gauge recorded the force, with it at every sample; and a note.

    That is so if there are never two samples in a row, or hardly ever. Between two of them that are
    as near as usual the force is linear.
    """
    there = np.flatnonzero(~np.isnan(run.force))
    gaps = np.diff(there)
    if len(there) < MIN_SAMPLES or np.median(gaps) < 2:
        return run, None
    force = np.interp(run.time, run.time[there], run.force[there])
    usual = float(np.median(gaps))
    edges = [-1, *there, len(force)]
    for first, last in pairwise(edges):
        if last - first > WIDER * usual:
            force[first + 1 : last] = np.nan
    return replace(run, force=force), (
        f"{run.name}: force is known at one sample of {usual:.0f} only; between them it is taken "
        "as linear."
    )


def held(time: Array, values: Array, edges: Array) -> Array:
    """Means between edges of what is held from one sample to the next; shape (m,).

    Args:
        time, values: of the samples, shape (n,); before the first and after the last the same.
        edges: increasing times, s, shape (m + 1,).
    """
    total = np.append(0.0, np.cumsum(values[:-1] * np.diff(time)))
    at = np.clip(np.searchsorted(time, edges, side="right") - 1, 0, len(time) - 1)
    area = total[at] + values[at] * (edges - time[at])
    return np.asarray(np.diff(area) / np.diff(edges))


def until_end(run: Run, span: tuple[float, float], clear: float) -> Run:
    """A run up to where the joint comes to an end of its range from elsewhere.

    What a pressed end does to the joint is not known: where it begins at one, from where it leaves
    that.

    Args:
        run: which may begin at an end.
        span: the range, rad or m.
        clear: how far off an end the joint must be, rad or m, not to be at it.
    """
    away = _away(run, span, clear)
    if not away.any():
        return run
    return run.part(slice(max(int(np.argmax(away)) - 1, 0), arrival(run, span, clear)))


def arrival(run: Run, span: tuple[float, float], clear: float) -> int:
    """The first sample at an end of the range after the joint was off it; else their number.

    Args:
        run: measured.
        span: the range, rad or m.
        clear: how far off an end the joint must be, rad or m, not to be at it.
    """
    away = _away(run, span, clear)
    comes = np.flatnonzero(away[:-1] & ~away[1:])
    return int(comes[0]) + 1 if len(comes) else len(away)


def _away(run: Run, span: tuple[float, float], clear: float) -> NDArray[np.bool_]:
    """Whether the joint is off both ends, shape (n,)."""
    return np.asarray(np.minimum(run.position - span[0], span[1] - run.position) > clear)


def visits(
    run: Run, span: tuple[float, float], clear: float, around: tuple[float, float]
) -> list[slice]:
    """Each time that the joint comes to an end of its range, or begins at one.

    Args:
        run: measured.
        span: the range, rad or m.
        clear: how far off an end the joint must be, rad or m, not to be at it.
        around: how much of the run before and after a visit belongs to it, s; less where the joint
            was at an end before, or comes to one again.
    """
    inside = np.minimum(run.position - span[0], span[1] - run.position)
    near = inside <= LEFT * clear
    edges = np.flatnonzero(np.diff(np.concatenate([[0], near, [0]]).astype(int)))
    there = [inside[a:b].min() <= clear for a, b in zip(edges[::2], edges[1::2], strict=True)]
    comes, leaves = edges[::2][there], edges[1::2][there]
    before = np.append(0, leaves)[:-1]
    after = np.append(comes, len(run.time))[1:]
    out = []
    for come, leave, first, end in zip(comes, leaves, before, after, strict=True):
        earliest, latest = run.time[come] - around[0], run.time[leave - 1] + around[1]
        first = max(first, int(np.searchsorted(run.time, earliest)))
        out.append(slice(first, min(end, int(np.searchsorted(run.time, latest, side="right")))))
    return out
