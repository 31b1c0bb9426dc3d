"""Units that logs are in, and which of them a signal is in where nothing but its range tells."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from joda.errors import JodaError

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
ANGLES = {"rad": 1.0, "deg": math.pi / 180, "turn": 2 * math.pi}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
RANGES = {"0..1": (0.0, 1.0), "0..100": (0.0, 100.0), "-100..100": (-100.0, 100.0)}
"""Units that count from one end of a joint's calibrated range to the other."""
MODEL, RAW = "model", "raw"
"""Rad or m, whichever the joint has; and as it is, in whatever the model wants there."""
ALIASES = {"percent": "0..100", "degrees": "deg", "radians": "rad", "degree": "deg", "%": "0..100"}
SLACK = 0.1
"""How far beyond a joint's range, in parts of it, measured positions may lie in the right unit."""
MIN_RANGE_SHARE = 0.05
"""Least part of a range, or of a unit's whole scale, that the joint which moves most has moved: a
log in radians read as degrees moves less, and so does one read as percents."""
FULL = 0.95
"""Part of their scale to which positions in -100..100 go, as no other unit makes them."""


@dataclass(frozen=True)
class Linear:
    """What makes the model's number of a log's: scale * x + offset."""

    scale: float
    offset: float = 0.0

    def of(self, x: float) -> float:
        """Of one number."""
        return self.scale * x + self.offset


def checked(text: str, where: str) -> str:
    """A unit as users write it, with "-" before it for the other direction; raises JodaError."""
    name, sign = text.strip(), ""
    if name not in RANGES and name.startswith("-"):
        name, sign = name[1:], "-"
    name = ALIASES.get(name.lower(), name)
    if name not in (*ANGLES, *LENGTHS, *RANGES, *TIMES, RAW):
        units = ", ".join((*ANGLES, *LENGTHS, *RANGES, RAW))
        raise JodaError(
            f"{where}: no unit '{text}'; give one of {units} (with - before it for the other "
            "direction), or of times s, ms, us, ns."
        )
    return sign + name


def linear(
    unit: str, hinge: bool, limits: tuple[float, float] | None, zero: float, where: str
) -> Linear:
    """What makes positions in a unit the model's.

    Args:
        unit: as `checked` returns it.
        hinge: whether the joint is one; else a slide.
        limits: its range, rad or m; None if it has none.
        zero: what the log has where the model has 0, in the log's unit.
        where: for sentences.

    Raises:
        JodaError: the unit is not one of such a joint's.
    """
    name = unit if unit in RANGES else unit.removeprefix("-")
    other = name != unit
    if name in RANGES:
        if limits is None:
            raise JodaError(
                f"{where}: {name} counts a joint's range, and it has none in the model; add "
                'range="lo hi" to the joint, or give another unit.'
            )
        (lo, hi), (first, last) = limits, RANGES[name]
        lo, hi = (hi, lo) if other else (lo, hi)
        scale = (hi - lo) / (last - first)
        return Linear(scale, lo - scale * (first + zero))
    factors = {**(ANGLES if hinge else LENGTHS), RAW: 1.0}
    if name not in factors:
        kind = "hinge" if hinge else "slide"
        fit = ", ".join((*factors, *RANGES))
        raise JodaError(f"{where}: {name} is no unit of a {kind}'s position; give one of {fit}.")
    scale = -factors[name] if other else factors[name]
    return Linear(scale, -scale * zero)


@dataclass(frozen=True)
class LoggedRange:
    """Positions of a joint as they stand in a log.

    Attributes:
        name: of the signal.
        low, high: least and largest value.
        hinge: whether the joint is one.
        limits: its range in the model, rad or m; None if it has none.
        zero: as in `linear`.
    """

    name: str
    low: float
    high: float
    hinge: bool
    limits: tuple[float, float] | None
    zero: float = 0.0

    def within(self, unit: str) -> bool:
        """Whether all of them can be the joint's in this unit."""
        if unit in RANGES:
            first, last = RANGES[unit]
            slack = 0.01 * (last - first)
            within = first - slack <= self.low and self.high <= last + slack
            return within and self.limits is not None
        lo, hi = self.ends
        a, b = (linear(unit, self.hinge, self.limits, self.zero, "").of(x) for x in self.span)
        slack = SLACK * (hi - lo)
        return lo - slack <= a and b <= hi + slack

    def part(self, unit: str) -> float:
        """The part of its range that it moves, read in this unit."""
        if unit in RANGES:
            return (self.high - self.low) / (RANGES[unit][1] - RANGES[unit][0])
        lo, hi = self.ends
        scale = linear(unit, self.hinge, self.limits, 0.0, "").scale
        return abs(scale) * (self.high - self.low) / (hi - lo)

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest value."""
        return self.low, self.high

    @property
    def ends(self) -> tuple[float, float]:
        """The joint's range; where it has none, a turn to either side, or a metre."""
        return self.limits or ((-2 * math.pi, 2 * math.pi) if self.hinge else (-1.0, 1.0))


def decided(seen: Sequence[LoggedRange], units: Sequence[str]) -> tuple[str, str]:
    """The unit in which all of these positions are, and how that is known.

    Args:
        seen: positions of joints of one kind, hinges or slides, that share a unit.
        units: that come into question.

    Raises:
        JodaError: none fits, or several do; the option that settles it is named.
    """
    fit = [unit for unit in units if _fits(seen, unit)]
    if len(fit) == 1 and (fit[0] in ("rad", "m") or _sure(seen, fit[0], units)):
        others = ", ".join(unit for unit in units if unit != fit[0])
        return fit[0], f"by its range: not {others}" if others else "no other is possible"
    told = fit if len(fit) > 1 else units
    shown = max(seen, key=lambda x: (sum(not x.within(unit) for unit in told), x.high - x.low))
    readings = [_reading(shown, unit) for unit in told]
    what = f"{len(fit)} units fit" if len(fit) > 1 else "its unit is not sure"
    name = shown.name if len(seen) == 1 else f"{shown.name} and {len(seen) - 1} more"
    raise JodaError(
        f"{name}: {what}: it goes from {shown.low:.4g} to {shown.high:.4g}, which would be "
        f"{'; '.join(readings)}{_model(shown)}. Say --unit '{shown.name}={' or '.join(told)}'"
        f"{_several(seen)}."
    )


def _fits(seen: Sequence[LoggedRange], unit: str) -> bool:
    return all(one.within(unit) for one in seen) and any(
        one.part(unit) >= MIN_RANGE_SHARE for one in seen
    )


def _sure(seen: Sequence[LoggedRange], unit: str, units: Sequence[str]) -> bool:
    """Whether a unit that alone fits is told by more than another zero would change."""
    if unit not in RANGES:
        return True
    largest = max(max(abs(one.low), abs(one.high)) for one in seen)
    return largest >= FULL * RANGES[unit][1]


def _reading(seen: LoggedRange, unit: str) -> str:
    if unit in RANGES and seen.limits is None:
        return f"in {unit} nothing, as the joint has no range"
    a, b = (linear(unit, seen.hinge, seen.limits, seen.zero, "").of(x) for x in seen.span)
    return f"in {unit} {a:.4g} to {b:.4g} {'rad' if seen.hinge else 'm'}"


def _model(seen: LoggedRange) -> str:
    if seen.limits is None:
        return ", and the model's joint has no range"
    lo, hi = seen.limits
    return f", and the model's range is {lo:.4g} to {hi:.4g}"


def _several(seen: Sequence[LoggedRange]) -> str:
    return "; NAME may be a pattern, as '*.pos'" if len(seen) > 1 else ""
