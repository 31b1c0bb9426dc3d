"""The effect that has no formula: a resistance as data show it, and a memory."""

from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from joda.component import MAX_VALUE, MIN_WIDTH, numbers
from joda.effects.base import TABLE, Effect, Motion, parameter

MIN_STEP = 1e-9
"""Narrowest gap between velocities of a table, rad/s or m/s: less is rest."""
EDGE = 0.02
"""Part of the joint's range within which the table fades to nothing, inside an end of its interval
that is not an end of the range."""

Row = Annotated[tuple[float, ...], Field(min_length=3, max_length=24)]
"""One number for each velocity of a table."""


class LearnedForce(Effect):
    """A resistance over position and velocity that was learned from data, and one memory."""

    NAME = "a law learned from the runs"
    DESCRIPTION = (
        "What no named effect says: a resistance over position and speed as the data show it, and "
        "a memory."
    )
    LAW = (
        "force -R(s, v): y, PCHIP over velocity and linear over position, outermost values beyond "
        "both, 0 outside the interval. memory position: besides -gain x, dx/dt = v - x / time; "
        "memory speed: R times max(0, 1 + gain z), dz/dt = (|v| - z) / time"
    )
    SOURCE = (
        "Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300 for PCHIP; Maxwell, Phil. "
        "Trans. 157 (1867) 49 for the memory of position"
    )
    SHOWS = (
        "Motions that differ from the model's in the same way wherever position, speed and what "
        "was before are the same, and that no named effect explains."
    )

    effect: Literal["learned_force"] = "learned_force"
    memory: Literal["none", "position", "speed"] = Field(
        default="none",
        description="what the joint remembers: the place where it was (it pulls back there), or "
        "how fast it was (it then resists more or less)",
    )
    time: float = parameter("after which 63 % are forgotten", "s", "s", (0.05, 100), default=1.0,
        gt=0)  # fmt: skip
    gain: float = parameter(
        "of the memory: of position a stiffness (N·m/rad or N/m), of speed a change per speed",
        *("N·m/rad, s/rad", "N/m, s/m", (-1, 100)),
        default=0.0,
    )
    power: Literal["passive", "active"] = Field(
        default="passive",
        description="whether it only resists, or also drives where the table says so",
    )
    interval: tuple[float, float] = (0.0, 1.0)
    positions: Annotated[tuple[float, ...], Field(min_length=1, max_length=16)] = (0.0,)
    velocities: Row
    y: Annotated[tuple[Row, ...], Field(min_length=1, max_length=16)] = parameter(
        "resistance, one row for each position, in it one number for each velocity",
        *("N·m", "N", (-50, 50)),
    )

    @model_validator(mode="after")
    def _check_places(self) -> Self:
        a, b = self.interval
        if not (a >= 0 and b <= 1 and b - a >= MIN_WIDTH):
            raise ValueError("interval must lie in 0 to 1 and be at least 1e-9 wide")
        if not _rises(self.positions, MIN_WIDTH) or self.positions[0] < 0 or self.positions[-1] > 1:
            raise ValueError("positions must increase from 0 or more to 1 or less")
        v = self.velocities
        if not _rises(v, MIN_STEP) or 0 not in v[1:-1] or max(-v[0], v[-1]) > MAX_VALUE:
            raise ValueError("velocities must increase from below 0 to above it, with 0 among them")
        return self

    @model_validator(mode="after")
    def _check_table(self) -> Self:
        if len(self.y) != len(self.positions):
            raise ValueError(f"y needs {len(self.positions)} rows, one for each position")
        rest = self.velocities.index(0)
        for row in self.y:
            if len(row) != len(self.velocities):
                raise ValueError(f"each row of y needs {len(self.velocities)} numbers, one for "
                                 "each velocity")  # fmt: skip
            if max(map(abs, row)) > MAX_VALUE:
                raise ValueError("a table's y must lie between -1e15 and 1e15")
            if row[rest] != 0:
                raise ValueError(
                    "y must be 0 at velocity 0; what acts at rest belongs into a channel"
                )
            signed = (r * v for r, v in zip(row, self.velocities, strict=True))
            if self.power == "passive" and any(value < 0 for value in signed):
                raise ValueError(
                    "y must not have the sign opposite to its velocity, which would add energy; "
                    "give power active if the data show that"
                )
        return self

    @model_validator(mode="after")
    def _check_memory(self) -> Self:
        if self.memory == "none" and self.gain != 0:
            raise ValueError("gain is a memory's; give memory position or speed")
        if self.memory == "position" and self.gain < 0:
            raise ValueError("gain of a memory of position must not be negative")
        return self

    def largest_force(self, motion: Motion) -> float:
        """Of the table up to its speed, and of the memory, N·m or N."""
        table = max(float(np.abs(self._up_to(row, motion.speed)).max()) for row in self.y)
        if self.memory == "position":
            return table + self.gain * min(motion.speed * self.time, motion.travel)
        return table * max(1.0, 1.0 + self.gain * motion.speed * (self.memory == "speed"))

    def _up_to(self, row: Row, speed: float) -> NDArray[np.float64]:
        """A row's resistances at speeds up to one, the outermost ones beyond its own."""
        inside = [v for v in self.velocities if abs(v) < speed]
        return np.interp([-speed, *inside, speed], self.velocities, row)

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """Names of its parameters but for the table."""
        return ("memory", "time", "gain", "power")

    def table_text(self) -> str:
        """The table as in the plugin's attribute: a b | positions | velocities | y | y | ..."""
        return " | ".join(numbers(part) for part in (*(getattr(self, k) for k in TABLE), *self.y))

    def text(self) -> str:
        """The effect as in the plugin's attribute."""
        return f"{super().text()}: {self.table_text()}"

    def described(self) -> str:
        """Name and numbers for a person."""
        words = ["learned force", f"up to {max(abs(r) for row in self.y for r in row):.4g}"]
        if self.memory != "none":
            words.append(f"memory of {self.memory}, time {self.time:.4g}, gain {self.gain:.4g}")
        return ", ".join([*words, *(["active"] if self.power == "active" else [])])


def _rises(values: tuple[float, ...], least: float) -> bool:
    return all(right - left >= least for left, right in pairwise(values))
