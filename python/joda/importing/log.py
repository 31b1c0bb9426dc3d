"""What a log holds, whatever its format: signals by name, recorded once or in many episodes."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError

Array = NDArray[np.float64]

Role = Literal["position", "velocity", "force", "ctrl", ""]
ROLES: tuple[Role, ...] = ("position", "velocity", "force", "ctrl")
LISTED = 12
"""How many names a sentence lists."""


@dataclass(frozen=True)
class Signal:
    """One column of a log.

    Attributes:
        name: whole, as options may name it, such as "action/elbow.pos".
        short: its end, by which options may name it too, such as "elbow.pos".
        role: what it is in a run; empty where the log does not say.
        of: the part of its name that names a joint or an actuator; empty where none does.
        units: in which it may be, see `joda.importing.units`; none where the log tells nothing.
        why: how the log tells, in words.
        group: signals of one group are in one unit, as one calibration made them.
    """

    name: str
    short: str
    role: Role = ""
    of: str = ""
    units: tuple[str, ...] = ()
    why: str = ""
    group: str = ""


@dataclass(frozen=True)
class Clock:
    """When the samples of some signals were taken.

    Attributes:
        time: s, shape (n,).
        place: where the samples are, for sentences: a file, and what of it.
        row: what one of them is called there: line, frame, message.
        numbers: of them, shape (n,).
    """

    time: Array
    place: str
    row: str
    numbers: NDArray[np.intp]

    def at(self, k: int) -> str:
        """Where sample k is, in words."""
        return f"{self.place}, {self.row} {self.numbers[k]}"


@dataclass(frozen=True)
class Track:
    """A signal as recorded: values of shape (n,) at the times of a clock."""

    clock: Clock
    values: Array


@dataclass(frozen=True)
class Recording:
    """What becomes one run: its file's name without the end, and its signals by name."""

    name: str
    tracks: dict[str, Track]


@dataclass(frozen=True)
class Log:
    """A log.

    Attributes:
        path: of its file or folder.
        format: in words.
        signals: its columns.
        recordings: at least one.
        notes: what a reader of it should know, a sentence each.
        times: the column of times, where that is one of the log's own.
    """

    path: Path
    format: str
    signals: tuple[Signal, ...]
    recordings: tuple[Recording, ...]
    notes: tuple[str, ...] = ()
    times: str = ""

    def named(self, name: str, role: Role = "") -> Signal:
        """The signal of a name, whole or short; of several with a short name, that of the role.

        Raises:
            JodaError: there is none, or there are several.
        """
        found = [one for one in self.signals if one.name == name]
        found = found or [one for one in self.signals if one.short == name]
        if len(found) > 1 and role:
            found = [one for one in found if one.role == role] or found
        if not found:
            names = listed(one.name for one in self.signals)
            raise JodaError(f"{self.path}: no column '{name}'; it has {names}.")
        if len(found) > 1:
            names = listed(one.name for one in found)
            raise JodaError(f"{self.path}: '{name}' may be {names}; give the whole name.")
        return found[0]


def listed(names: Iterable[object]) -> str:
    """Names for a sentence, in quotes; of many only the first."""
    quoted = [f"'{name}'" for name in names]
    more = f" and {len(quoted) - LISTED} more" if len(quoted) > LISTED else ""
    return ", ".join(quoted[:LISTED]) + more or "none"
