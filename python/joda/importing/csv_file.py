"""CSV files with columns of any names."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from joda.errors import JodaError
from joda.importing.log import Clock, Log, Recording, Signal, Track, listed
from joda.importing.names import own, read_name
from joda.importing.units import MODEL, RAW, TIMES
from joda.measured.table import header, read_table

TIME_NAMES = ("time", "t", "timestamp", "stamp", "time_s", "sec", "seconds", "elapsed")
"""Names of a column of times; with _ms, _us or _ns behind it, in that unit."""
SECONDS = 0.5
"""Longest usual interval that is taken for seconds."""


def read_csv(path: Path, wanted: Sequence[str], time: str, units: Mapping[str, str]) -> Log:
    """Reads a CSV.

    Args:
        path: of it.
        wanted: names of columns that are to be read although their names do not say what they are.
        time: name of the column of times; empty for the only one that has such a name.
        units: of columns by name; only that of the times is used here.

    Raises:
        JodaError: it is no such file, a wanted column is not there, or it has no times.
    """
    names = list(dict.fromkeys(filter(None, header(path))))
    clock = _time_column(path, names, time)
    missing = [name for name in wanted if name not in names]
    if missing:
        raise JodaError(f"{path}: no column '{missing[0]}'; it has {listed(names)}.")
    signals = tuple(_signal(name) for name in names if name != clock)
    read = [one.name for one in signals if one.role or one.name in wanted]
    table = read_table(path, [clock, *read], "columns that have names")
    if not len(table.lines):
        raise JodaError(f"{path}: has a header and no rows.")
    times = table.columns[clock]
    seconds = _time_unit(path, clock, times, units)
    if np.isnan(times).any():
        line = table.lines[int(np.flatnonzero(np.isnan(times))[0])]
        raise JodaError(f"{path}, line {line}: {clock} is empty; give each row its time.")
    shared = Clock(times * TIMES[seconds], str(path), "line", table.lines)
    tracks = {name: Track(shared, table.columns[name]) for name in read}
    return Log(path, "CSV", signals, (Recording(path.stem, tracks),), times=clock)


def _signal(name: str) -> Signal:
    if found := own(name):
        role, of = found
        units = (RAW,) if role in ("ctrl", "force") else (MODEL,)
        return Signal(name, name, role, of, units, "joda's own column")
    if name.strip().lower() in ("position", "velocity", "force"):  # of the joint of --joint
        role = name.strip().lower()  # type: ignore[assignment]
        units = (RAW,) if role == "force" else (MODEL,)
        return Signal(name, name, role, "", units, "joda's own column")
    role, of, unit = read_name(name)
    return Signal(name, name, role, of if role else "", (unit,) if unit else (), "its name")


def _time_column(path: Path, names: Sequence[str], asked: str) -> str:
    """The name of the column of times."""
    if asked and asked in names:
        return asked
    if asked:
        raise JodaError(f"{path}: no column '{asked}'; it has {listed(names)}.")
    found = [name for name in names if _stem(name)[0] in TIME_NAMES]
    found = [name for name in found if name.lower() == "time"] or found
    if len(found) == 1:
        return found[0]
    which = f"may be any of {listed(found)}" if found else f"is not among {listed(names)}"
    raise JodaError(f"{path}: the column of times {which}; say --column time=NAME.")


def _stem(name: str) -> tuple[str, str]:
    """A name of times without its unit, and the unit, "" where there is none."""
    text = name.strip().lower().rstrip(")]").replace(" ", "_").replace("(", "_").replace("[", "_")
    head, _, unit = text.rpartition("_")
    return (head.rstrip("_"), unit) if head and unit in TIMES else (text, "")


def _time_unit(path: Path, name: str, times: np.ndarray, units: Mapping[str, str]) -> str:
    if (unit := units.get(name)) is not None:
        if unit not in TIMES:
            raise JodaError(f"--unit {name}={unit}: times are in {listed(TIMES)}.")
        return unit
    if unit := _stem(name)[1]:
        return unit
    usual = float(np.median(np.abs(np.diff(times)))) if len(times) > 1 else 0.0
    if usual > SECONDS:
        raise JodaError(
            f"{path}: column '{name}' goes in steps of {usual:.4g}, too far apart for seconds; say "
            f"--unit {name}=ms, us or ns, or --unit {name}=s if they are."
        )
    return "s"
