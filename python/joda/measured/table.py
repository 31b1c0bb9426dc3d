"""CSV files with a header row, as spreadsheets and loggers of many kinds write them."""

import csv
import unicodedata
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.files import text_lines

Array = NDArray[np.float64]

SEPARATORS = ",;\t"
LARGEST, LEAST = 1e30, 1e-30
"""Larger numbers are refused, as their squares overflow; smaller ones are zero."""
SHEET = {"#N/A", "#N/A!", "#NA", "#NULL!", "#DIV/0!", "#VALUE!", "#REF!", "#NUM!", "#NAME?"}
"""What spreadsheets write for a value that there is not."""
SHOWN = 80
"""Characters of a header or a cell that a sentence shows."""


@dataclass(frozen=True)
class Table:
    """Columns of a file.

    Attributes:
        path: of the file.
        lines: in which its rows are, shape (n,).
        columns: by the wanted names, shape (n,) each; NaN where a cell is empty.
        others: names of the columns that were not wanted.
    """

    path: Path
    lines: NDArray[np.intp]
    columns: dict[str, Array]
    others: tuple[str, ...]

    @property
    def has(self) -> str:
        """The columns of the file, in words."""
        return ", ".join((*self.columns, *self.others)) or "none"


def read_table(path: Path, wanted: Sequence[str], expected: str) -> Table:
    """Reads the columns of these names; case does not matter.

    Columns are separated by commas, semicolons or tabs; where not by commas, decimals may be.

    Args:
        path: CSV with a header row; lines beginning with # are comments.
        wanted: the names.
        expected: what the header row should have, in words.

    Raises:
        JodaError: none of them is there, one is there twice, or the file is no such table.
    """
    own = {name.lower(): name for name in wanted}
    rows = _rows(path)
    number, first = next(rows, (0, []))
    if not first:
        raise JodaError(f"{path}: empty, no header row with {expected}.")
    head = _without_end([_seen(cell).strip() for cell in first], 1)
    names = [own.get(cell.lower(), "") for cell in head]
    if not any(names):
        raise JodaError(
            f"{path}, line {number}: no header row with {expected} but "
            f"'{_shown(', '.join(head))}'; the first row must name the columns."
        )
    for name in wanted:
        if names.count(name) > 1:
            raise JodaError(f"{path}, line {number}: column '{name}' is there twice.")
    lines, values = array("q"), {name: array("d") for name in names if name}
    for number, row in rows:
        cells = _without_end(row, len(names))
        if len(cells) != len(names):
            raise JodaError(
                f"{path}, line {number}: {len(cells)} cells, the header has {len(names)} columns"
                f"{'; write decimals with a point' if len(cells) > len(names) else ''}."
            )
        lines.append(number)
        for name, cell in zip(names, cells, strict=True):
            if name:
                values[name].append(_number(path, number, name, cell.strip()))
    return Table(
        path=path,
        lines=np.array(lines, np.intp),
        columns={name: np.array(column) for name, column in values.items()},
        others=tuple(
            _shown(cell) for cell, name in zip(head, names, strict=True) if cell and not name
        ),
    )


def header(path: Path) -> list[str]:
    """The names of a file's columns; raises JodaError if it cannot be read."""
    return [name.strip() for name in next(_rows(path), (0, []))[1]]


def check_filled(table: Table, names: Sequence[str], remedy: str) -> None:
    """Raises JodaError where a cell of these columns is empty."""
    for name in names:
        missing = np.flatnonzero(np.isnan(table.columns.get(name, np.zeros(1))))
        if len(missing):
            line = table.lines[missing[0]]
            raise JodaError(f"{table.path}, line {line}: {name} is empty; {remedy}.")


def check_increasing(table: Table) -> None:
    """Raises JodaError where time stands still or goes back."""
    time = table.columns["time"]
    wrong = np.flatnonzero(np.diff(time) <= 0)
    if not len(wrong):
        return
    k = int(wrong[0])
    before, after = (f"{t:.15g}" for t in time[k : k + 2])
    back = int((np.diff(time) < 0).sum())
    if not np.ptp(time):
        told = f"it is {after} in all rows; give each row its own time in seconds"
    elif after == before:
        told = f"it is {after} as in the row before; write it with more digits, or remove the row"
    elif back == len(time) - 1:
        told = f"it goes back from {before} to {after}, and in all rows; turn their order"
    elif back == 1:
        told = (
            f"it goes back from {before} to {after}; sort the rows by time, or if this is the "
            "beginning of another recording, cut the file there into two"
        )
    else:
        told = (
            f"it goes back from {before} to {after}, and in {back} rows in all; sort the rows by "
            "time, or if two recordings or two clocks are mixed, give each a file of its own"
        )
    line = table.lines[k + 1]
    raise JodaError(f"{table.path}, line {line}: time does not increase: {told}.")


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Rows with the numbers of their lines; comments and empty lines are left out."""
    lines = text_lines(path)
    before, first, end = 0, "", 0
    for first in lines:
        if first.strip() and not first.lstrip().startswith("#"):
            break
        before += 1
    separator = max(SEPARATORS, key=first.count)
    reader = csv.reader(chain([first], lines), delimiter=separator)
    try:
        for row in reader:
            begin, end = end + 1, reader.line_num
            if row and any(map(str.strip, row)) and not _comments(row[0]):
                if separator != ",":
                    row = [cell.replace(",", ".") if cell.count(",") == 1 else cell for cell in row]
                yield before + begin, row
    except csv.Error as error:
        line = before + reader.line_num
        raise JodaError(f"{path}, line {line}: not CSV ({error}).") from None


def _seen(cell: str) -> str:
    """Without characters that nobody sees, such as those that turn the direction of writing."""
    return "".join(letter for letter in cell if unicodedata.category(letter) != "Cf")


def _comments(cell: str) -> bool:
    """Whether a row that begins with this is a comment; a spreadsheet's #N/A is none."""
    begin = cell.lstrip()
    return begin.startswith("#") and begin.rstrip() not in SHEET


def _without_end(cells: list[str], least: int) -> list[str]:
    """Cells without the empty ones at the end, which a separator there makes."""
    count = len(cells)
    while count > least and not cells[count - 1].strip():
        count -= 1
    return cells[:count]


def _number(path: Path, line: int, name: str, text: str) -> float:
    if not text:
        return float("nan")
    try:
        value = float(text.replace("_", "x"))  # Python would read 1_000
    except ValueError:
        value = float("nan")
    if "\n" in text:
        raise JodaError(f"{path}, line {line}: {name} begins with a quote that is not closed.")
    if not abs(value) < LARGEST:
        large = "" if np.isnan(value) or np.isinf(value) else ", too large to be meant"
        empty = "; where it is not known leave the cell empty" if name == "force" else ""
        raise JodaError(
            f"{path}, line {line}: {name} is '{_shown(text)}'{large}; it must be a number{empty}."
        )
    return value if abs(value) > LEAST else 0.0


def _shown(text: str) -> str:
    """Text for a sentence: not too long, and with nothing that a terminal would obey."""
    short = text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in short)
