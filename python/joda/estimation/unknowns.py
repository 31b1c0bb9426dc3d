"""Numbers that are fitted: bounds, steps of differences, and what is known before the data."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from joda.estimation.least_squares import Inequalities

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Unknowns:
    """The numbers of a model, shape (k,) each.

    Attributes:
        low, high: bounds.
        step: for central differences.
        mean, prior_std: what is known before the data; infinite doubt for nothing.
        constraints: what else must hold.
        widest: to which bounds those may be widened that are only usual, shape (2, k), lows first;
            NaN for what cannot be beyond its bound. None for nothing to widen.
    """

    low: Array
    high: Array
    step: Array
    mean: Array
    prior_std: Array
    constraints: Inequalities | None = None
    widest: Array | None = None

    def pressed(self, x: Array) -> bool:
        """Whether a number is as large or as small as is usual, but may be larger or smaller."""
        if self.widest is None:
            return False
        low, high = ~np.isnan(self.widest)
        return bool(np.any(low & (x < self.low + self.step) | high & (x > self.high - self.step)))

    def widened(self) -> "Unknowns":
        """With the widest bounds; itself where these are."""
        if self.widest is None:
            return self
        now = np.stack([self.low, self.high])
        low, high = wide = np.where(np.isnan(self.widest), now, self.widest)
        return self if np.array_equal(wide, now) else replace(self, low=low, high=high)

    def inside(self) -> "Unknowns":
        """With bounds at which no number is pressed."""
        if self.widest is None:
            return self
        low, high = ~np.isnan(self.widest)
        off = np.minimum(2 * self.step, (self.high - self.low) / 2)
        return replace(self, low=self.low + low * off, high=self.high - high * off)

    def and_(self, other: "Unknowns") -> "Unknowns":
        """Both, one after the other."""
        pairs = zip(_parts(self), _parts(other), strict=True)
        low, high, step, mean, prior_std = (np.concatenate(pair) for pair in pairs)
        return Unknowns(low, high, step, mean, prior_std)

    def some(self, kept: NDArray[np.bool_]) -> "Unknowns":
        """Some of them, without what else must hold."""
        low, high, step, mean, prior_std = (part[kept] for part in _parts(self))
        return Unknowns(low, high, step, mean, prior_std)

    def penalty(self, x: Array) -> float:
        """What the numbers lose by being off what was known."""
        return float(np.sum(((x - self.mean) / self.prior_std) ** 2))


EMPTY = np.zeros(0)
NOTHING = Unknowns(EMPTY, EMPTY, EMPTY, EMPTY, EMPTY)
"""No numbers: only starts are fitted."""


def _parts(unknowns: Unknowns) -> tuple[Array, ...]:
    return tuple(getattr(unknowns, name) for name in ("low", "high", "step", "mean", "prior_std"))
