"""Measurements of a joint, one CSV file each: timed runs, and quasi-static curves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.files import write_text
from joda.measured import smoothing
from joda.measured.table import Table, check_filled, check_increasing, read_table
from joda.scenes.actuators import Drive

Array = NDArray[np.float64]

STOP = 0.004
"""How near an end of the range, in normalised position, counts as touching it, beside noise."""

COLUMNS = ("time", "position", "velocity", "force")
LEAST = 4
"""Fewest samples that make a run or a curve."""
WIDER = 2.5
"""Gaps, in units of the usual one, over which a force is not taken as linear."""
EPOCH = 1e6
"""Times from which on too few digits are left for samples, s: they are counted from the first."""


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
        doubt: standard deviation of the force besides what its samples show, shape (n,); None for
            none.
        command: of the actuators on the joint (`joda.scenes.actuators.Drive`), held from its sample
            to the next, N·m or N; None where none acted.
        among: whether other joints moved meanwhile, and contacts were looked for along that.
        origin: what was subtracted from the file's times, s.
        unread: names of the file's other columns.
    """

    name: str
    time: Array
    position: Array
    velocity: Array | None
    force: Array
    forced: bool
    doubt: Array | None = None
    command: Array | None = None
    among: bool = False
    origin: float = 0.0
    unread: tuple[str, ...] = ()

    def part(self, samples: slice | NDArray[np.intp]) -> Self:
        """The run with some of its samples only."""
        return replace(
            self,
            time=self.time[samples],
            position=self.position[samples],
            velocity=None if self.velocity is None else self.velocity[samples],
            force=self.force[samples],
            doubt=None if self.doubt is None else self.doubt[samples],
            command=None if self.command is None else self.command[samples],
        )

    def force_error(self) -> Array:
        """Standard deviations of the force, N·m or N, shape (n,); it must be known."""
        own = smoothing.force_error(self.time, self.force, self.forced)
        return own if self.doubt is None else np.hypot(own, self.doubt)

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


def read_measurement(path: str | Path, drive: Drive | None = None) -> Run | QuasiStatic:
    """Reads a timed run or, where there is no column `time`, a quasi-static curve.

    Args:
        path: CSV with a header row: `time` and `position`, optionally `velocity` and `force`; or
            `position` and `force`. Other columns are ignored, lines beginning with # are comments.
        drive: of actuators whose signals are columns too, `ctrl:` and their names.

    Returns:
        the run or the curve.

    Raises:
        JodaError: it cannot be read; file, line and column are named.
    """
    table = _table(Path(path), [] if drive is None else drive.columns)
    return _run(table, drive) if "time" in table.columns else _curve(table)


def read_run(path: str | Path) -> Run:
    """Reads a timed run, as `read_measurement` does; a file without time is refused."""
    return _run(_table(Path(path)), None)


def read_together(
    path: str | Path, joint: str, others: Sequence[str], drive: Drive | None = None
) -> tuple[Run, dict[str, Array]]:
    """Reads a run of several joints: columns `position:NAME`, perhaps `velocity:` and `force:`.

    Args:
        path: CSV, as in `read_measurement`.
        joint: whose run it shall be.
        others: whose positions are read besides.
        drive: see `read_measurement`.

    Returns:
        the run, and the positions of the joint and the others by name, shape (n,) each.

    Raises:
        JodaError: it cannot be read; file, line and column are named.
    """
    own = {f"{name}:{joint}": name for name in COLUMNS if name != "time"}
    places = [f"position:{name}" for name in others]
    table = _table(Path(path), [*own, *places, *([] if drive is None else drive.columns)])
    check_filled(table, (f"position:{joint}", *places), "a run needs every position")
    positions = {name: table.columns[f"position:{name}"] for name in (joint, *others)}
    columns = {own.get(name, name): values for name, values in table.columns.items()}
    return _run(replace(table, columns=columns), drive), positions


def _table(path: Path, more: Sequence[str] = ()) -> Table:
    return read_table(path, (*COLUMNS, *more), "time and position (or position and force)")


def _run(table: Table, drive: Drive | None) -> Run:
    needs = "a run needs time (s) and position (rad or m)"
    _complete(table, ("time", "position"), needs)
    check_filled(table, ("time", "position", "velocity"), "only force may be")
    check_increasing(table)
    columns, time = table.columns, table.columns["time"]
    origin = float(time[0]) if np.abs(time).max() > EPOCH else 0.0
    return Run(
        name=table.path.name,
        time=time - origin,
        position=columns["position"],
        velocity=columns.get("velocity"),
        force=columns.get("force", np.zeros(len(time))),
        forced="force" in columns,
        command=None if drive is None else drive.command(_held(table, drive.columns)),
        origin=origin,
        unread=table.others,
    )


def read_signals(path: str | Path, names: Sequence[str]) -> Array:
    """Columns of a log, held from one sample to the next, shape (n, k); raises JodaError."""
    return _held(read_table(Path(path), names, "signals"), names)


def _held(table: Table, names: Sequence[str]) -> Array:
    """The signals, shape (n, k): an empty cell is as the one above; raises JodaError."""
    out = []
    for name in names:
        signal = table.columns[name]
        last = np.maximum.accumulate(np.where(np.isnan(signal), -1, np.arange(len(signal))))
        if last[0] < 0:
            raise JodaError(
                f"{table.path}, line {table.lines[0]}: no {name}; the first cell must tell it, and "
                "an empty one below is held from the one above."
            )
        out.append(signal[last])
    return np.stack(out, axis=1)


def _curve(table: Table) -> QuasiStatic:
    needs = (
        "without time it is a quasi-static curve, which needs position (rad or m) and force "
        "(N·m or N); a timed run needs time (s)"
    )
    _complete(table, ("position", "force"), needs)
    check_filled(table, ("position", "force"), "fill it in or leave the row out")
    columns = table.columns
    return QuasiStatic(table.path.name, columns["position"], columns["force"], table.others)


def _complete(table: Table, names: tuple[str, ...], needs: str) -> None:
    """Raises JodaError where a column or samples are missing."""
    for name in names:
        if name not in table.columns:
            raise JodaError(f"{table.path}: no column '{name}'; it has {table.has}, and {needs}.")
    if len(table.lines) < LEAST:
        count = len(table.lines)
        raise JodaError(f"{table.path}: {count} samples; a measurement needs at least {LEAST}.")


def known(run: Run) -> list[NDArray[np.intp]]:
    """Parts of a run in which the force is known, as indices; those too short to smooth are not."""
    numbers = np.flatnonzero(~np.isnan(run.force))
    groups = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [group for group in groups if len(group) >= smoothing.LEAST]


def check_known(runs: Sequence[Run]) -> None:
    """Raises JodaError where no run has a stretch in which the force is known."""
    if runs and not any(known(run) for run in runs):
        raise JodaError(
            f"{', '.join(run.name for run in runs)}: nowhere is 'force' filled in for "
            f"{smoothing.LEAST} samples in a row; give the force of each sample, or leave the "
            "column out where nothing moved the joint."
        )


def evened(run: Run) -> tuple[Run, str | None]:
    """A run of which a slower gauge recorded the force, with it at every sample; and a note.

    That is so if there are never two samples in a row, or hardly ever. Between two of them that are
    as near as usual the force is linear.
    """
    there = np.flatnonzero(~np.isnan(run.force))
    gaps = np.diff(there)
    if len(there) < LEAST or np.median(gaps) < 2:
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

    What a pressed end does to the joint is not known: where it begins beyond its range, from where
    it comes back.

    Args:
        run: which may begin at an end.
        span: the range, rad or m.
        clear: how far off an end the joint must be, rad or m, not to be at it.
    """
    inside = np.minimum(run.position - span[0], span[1] - run.position)
    begin = int(np.argmax(inside >= 0)) if inside[0] < -clear else 0
    away = inside[begin:] > clear
    left = int(np.argmax(away)) if away.any() else len(away)
    back = np.flatnonzero(~away[left:])
    return run.part(slice(begin, begin + left + int(back[0]) if len(back) else None))


def write_run(path: Path, run: Run) -> None:
    """Writes a run as `read_run` reads it."""
    write_text(path, run_text(run))


def run_text(run: Run, comment: str = "") -> str:
    """A run's file, with comments: the given one, and the units."""
    columns = {"time": run.time, "position": run.position}
    if run.velocity is not None:
        columns["velocity"] = run.velocity
    if run.forced:
        columns["force"] = run.force
    rows = zip(*columns.values(), strict=True)
    lines = [",".join("" if np.isnan(x) else f"{x:.9g}" for x in row) for row in rows]
    header = "".join(f"# {line}\n" for line in comment.splitlines())
    header += "# s, rad or m, rad/s or m/s, N·m or N"
    return "\n".join([header, ",".join(columns), *lines]) + "\n"
