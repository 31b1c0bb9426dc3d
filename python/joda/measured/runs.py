"""Measurements of a joint, one CSV file each: timed runs, and quasi-static curves."""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.files import read_text, write_text
from joda.measured import smoothing

Array = NDArray[np.float64]

COLUMNS = ("time", "position", "velocity", "force")
LEAST = 4
"""Fewest samples that make a run or a curve."""


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
    """

    name: str
    time: Array
    position: Array
    velocity: Array | None
    force: Array
    forced: bool


@dataclass(frozen=True)
class QuasiStatic:
    """Force against position, as with a hand-held gauge; arrays have shape (n,).

    Attributes:
        name: of its file.
        position: rad or m, in the order measured: the direction of travel follows from it.
        force: that slowly moves the joint there, N·m or N.
    """

    name: str
    position: Array
    force: Array


def read_measurement(path: str | Path) -> Run | QuasiStatic:
    """Reads a timed run or, where there is no column `time`, a quasi-static curve.

    Args:
        path: CSV with a header row: `time` and `position`, optionally `velocity` and `force`; or
            `position` and `force`. Other columns are ignored, lines beginning with # are comments.

    Returns:
        the run or the curve.

    Raises:
        JodaError: it cannot be read; file, line and column are named.
    """
    path = Path(path)
    lines, columns = _table(path)
    return _run(path, lines, columns) if "time" in columns else _curve(path, lines, columns)


def read_run(path: str | Path) -> Run:
    """Reads a timed run, as `read_measurement` does; a file without time is refused."""
    path = Path(path)
    lines, columns = _table(path)
    return _run(path, lines, columns)


def _run(path: Path, lines: list[int], columns: dict[str, Array]) -> Run:
    needs = "a run needs time (s) and position (rad or m)"
    _complete(path, lines, columns, ("time", "position"), needs)
    _filled(path, lines, columns, ("time", "position", "velocity"), "only force may be")
    time = columns["time"]
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        line = lines[back[0] + 1]
        raise JodaError(f"{path}, line {line}: time does not increase; sort the rows by time.")
    return Run(
        name=path.name,
        time=time,
        position=columns["position"],
        velocity=columns.get("velocity"),
        force=columns.get("force", np.zeros(len(time))),
        forced="force" in columns,
    )


def _curve(path: Path, lines: list[int], columns: dict[str, Array]) -> QuasiStatic:
    needs = (
        "without time it is a quasi-static curve, which needs position (rad or m) and force "
        "(N·m or N); a timed run needs time (s)"
    )
    _complete(path, lines, columns, ("position", "force"), needs)
    _filled(path, lines, columns, ("position", "force"), "fill it in or leave the row out")
    return QuasiStatic(path.name, columns["position"], columns["force"])


def _complete(
    path: Path, lines: list[int], columns: dict[str, Array], names: tuple[str, ...], needs: str
) -> None:
    """Raises JodaError where a column or samples are missing."""
    for name in names:
        if name not in columns:
            has = ", ".join(columns) or "none"
            raise JodaError(f"{path}: no column '{name}'; it has {has}, and {needs}.")
    if len(lines) < LEAST:
        raise JodaError(f"{path}: {len(lines)} samples; a measurement needs at least {LEAST}.")


def _filled(
    path: Path, lines: list[int], columns: dict[str, Array], names: tuple[str, ...], remedy: str
) -> None:
    """Raises JodaError where a cell is empty."""
    for name in names:
        missing = np.flatnonzero(np.isnan(columns.get(name, np.zeros(1))))
        if len(missing):
            raise JodaError(f"{path}, line {lines[missing[0]]}: {name} is empty; {remedy}.")


def known(run: Run) -> list[NDArray[np.intp]]:
    """Parts of a run in which the force is known, as indices; those too short to smooth are not."""
    numbers = np.flatnonzero(~np.isnan(run.force))
    groups = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [group for group in groups if len(group) >= smoothing.LEAST]


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


def _table(path: Path) -> tuple[list[int], dict[str, Array]]:
    """Line numbers of the rows, and the known columns; NaN where a cell is empty."""
    return read_columns(path, COLUMNS, "time and position (or position and force)")


def read_columns(
    path: Path, wanted: Sequence[str], expected: str
) -> tuple[list[int], dict[str, Array]]:
    """The columns of these names, other columns left out; case does not matter.

    Args:
        path: CSV with a header row.
        wanted: the names.
        expected: what the header row should have, in words.

    Returns:
        line numbers of the rows, and the columns that are there; NaN where a cell is empty.

    Raises:
        JodaError: none of them is there, one is there twice, or the file is no such table.
    """
    own = {name.lower(): name for name in wanted}
    rows = _rows(path)
    number, header = next(rows, (0, []))
    names = [own.get(name.strip().lower(), "") for name in header]
    if not any(names):
        raise JodaError(
            f"{path}: no header row with {expected}; the first row must name the columns."
        )
    for name in wanted:
        if names.count(name) > 1:
            raise JodaError(f"{path}, line {number}: column '{name}' is there twice.")
    lines: list[int] = []
    values: dict[str, list[float]] = {name: [] for name in names if name}
    for number, row in rows:
        if len(row) != len(names):
            raise JodaError(
                f"{path}, line {number}: {len(row)} cells, the header has {len(names)} columns."
            )
        lines.append(number)
        for name, cell in zip(names, row, strict=True):
            if name in values:
                values[name].append(_cell(path, number, name, cell.strip()))
    return lines, {name: np.array(column) for name, column in values.items()}


def header(path: Path) -> list[str]:
    """The names of a file's columns; raises JodaError if it cannot be read."""
    return [name.strip() for name in next(_rows(path), (0, []))[1]]


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Rows with the numbers of their lines; comments and empty lines are left out."""
    reader = csv.reader(StringIO(read_text(path).removeprefix("\ufeff")))
    try:
        for row in reader:
            if row and any(map(str.strip, row)) and not row[0].lstrip().startswith("#"):
                yield reader.line_num, row
    except csv.Error as error:
        raise JodaError(f"{path}, line {reader.line_num}: not CSV ({error}).") from None


def _cell(path: Path, line: int, name: str, text: str) -> float:
    if not text:
        return float("nan")
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise JodaError(f"{path}, line {line}: {name} is '{text}'; it must be a number.")
    return value
