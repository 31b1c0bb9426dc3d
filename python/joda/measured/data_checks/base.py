"""What a check says: something that looks wrong, of one kind, as a sentence."""

from dataclasses import dataclass
from typing import Literal

from joda.measured.runs import QuasiStatic, Run

Kind = Literal[
    "short",
    "still",
    "degrees",
    "millimetres",
    "sign",
    "zero",
    "outside",
    "stray",
    "resolution",
    "clock",
    "origin",
    "unread",
    "ticks",
    "wrapped",
    "force_size",
    "uneven_time",
    "gap",
    "stale",
    "slow_sampling",
    "velocity",
    "force_sign",
    "driven",
]

FATAL = {
    *("short", "clock", "degrees", "millimetres", "ticks", "wrapped", "sign", "zero"),
    "force_size",
}


@dataclass(frozen=True)
class DataCheck:
    """Something that looks wrong.

    Attributes:
        kind: in one word.
        sentence: names the file, says what is wrong, with numbers and units, and what to do.
        fatal: the data cannot be used as they are.
    """

    kind: Kind
    sentence: str
    fatal: bool


def suspect(run: Run | QuasiStatic, kind: Kind, told: str) -> DataCheck:
    """What looks wrong in a file; fatal by its kind."""
    return DataCheck(kind, f"{run.name}: {told}.", kind in FATAL)
