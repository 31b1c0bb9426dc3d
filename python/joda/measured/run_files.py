"""Measurements of a joint, one CSV file each: timed runs, and quasi-static curves."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.files import write_text
from joda.measured.runs import MIN_SAMPLES, QuasiStatic, Run
from joda.measured.table import Table, check_filled, check_increasing, read_table
from joda.scenes.actuators import Drive

Array = NDArray[np.float64]

COLUMNS = ("time", "position", "velocity", "force")
EPOCH = 1e6
"""Times from which on too few digits are left for samples, s: they are counted from the first."""


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
    if len(table.lines) < MIN_SAMPLES:
        count = len(table.lines)
        raise JodaError(
            f"{table.path}: {count} samples; a measurement needs at least {MIN_SAMPLES}."
        )


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
