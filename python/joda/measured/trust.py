"""How far off the numbers of a model and of a measurement may be: what a user says of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from types import MappingProxyType

from joda.errors import JodaError

RELATIVE = (
    *("mass", "inertia", "gravity", "damping", "frictionloss", "stiffness"),
    *("force_scale", "actuator_gain"),
)
"""Numbers whose width is a part of them."""
ABSOLUTE = ("center_of_mass", "force_offset", "time_delay", "position_offset")
"""Numbers whose width is in their unit: rad, N·m or N, s, rad or m."""
KEYS = (*RELATIVE, *ABSOLUTE)


@dataclass(frozen=True)
class Trust:
    """Standard deviations of what is believed, by the numbers' names.

    Attributes:
        widths: of those that somebody told; of `RELATIVE` ones parts of the number, of `ABSOLUTE`
            ones in its unit. 0 trusts a number fully: it is never changed.
    """

    widths: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def width(self, name: str, usual: float) -> float:
        """Of a number; the usual one where nothing was told."""
        return self.widths.get(name, usual)


USUAL = Trust()
"""Of whom nobody said anything."""


def trusting(told: Mapping[str, float]) -> Trust:
    """The trust of numbers by name; raises JodaError for an unknown name or no width."""
    for name, width in told.items():
        if name not in KEYS:
            raise JodaError(f"trust: no number '{name}'; there are {', '.join(KEYS)}.")
        if not (isfinite(width) and width >= 0):
            raise JodaError(
                f"trust: {name}={width:g} is no width; give a standard deviation, 0 or more."
            )
    return Trust(MappingProxyType(dict(told)))


def read_trust(texts: Sequence[str]) -> dict[str, float]:
    """Widths from words such as "mass=0.05"; raises JodaError where one is not so."""
    out: dict[str, float] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        try:
            width = float(value)
        except ValueError:
            width = float("nan")
        if not sign or width != width:
            raise JodaError(f"--trust '{text}': give NAME=WIDTH, as in mass=0.05.")
        out[name.strip()] = width
    return out
