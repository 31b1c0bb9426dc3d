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
        mean, prior_std: what is known before the data; infinite for nothing.
        constraints: what else must hold.
        widest: to which bounds those may be widened that are only usual, shape (2, k), lows first;
            NaN for what cannot be beyond its bound. None for nothing to widen.
        rough: combinations of what the numbers are off their means, of which standard normal values
            are known before the data, shape (r, k); None for none.
    """

    low: Array
    high: Array
    step: Array
    mean: Array
    prior_std: Array
    constraints: Inequalities | None = None
    widest: Array | None = None
    rough: Array | None = None

    @property
    def _widest(self) -> Array:
        return np.full((2, len(self.low)), np.nan) if self.widest is None else self.widest

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
        before, after = (0, len(other.low)), (len(self.low), 0)
        own = [(self.rough, before), (other.rough, after)]
        padded = [np.pad(part, ((0, 0), sides)) for part, sides in own if part is not None]
        rough = np.vstack(padded) if padded else None
        widest = np.hstack([self._widest, other._widest])
        return Unknowns(low, high, step, mean, prior_std, widest=widest, rough=rough)

    def some(self, kept: NDArray[np.bool_]) -> "Unknowns":
        """Some of them, without what else must hold."""
        low, high, step, mean, prior_std = (part[kept] for part in _parts(self))
        alone = None if self.rough is None else ~self.rough[:, ~kept].any(axis=1)
        rough = None if self.rough is None else self.rough[alone][:, kept]
        return Unknowns(low, high, step, mean, prior_std, rough=rough)

    def penalty(self, x: Array) -> float:
        """What the numbers lose by being off what was known."""
        off = x - self.mean
        own = float(np.sum((off / self.prior_std) ** 2))
        return own if self.rough is None else own + float(np.sum((self.rough @ off) ** 2))

    @property
    def known(self) -> Array:
        """Inverse covariance of the numbers before the data, shape (k, k)."""
        own = np.diag(self.prior_std**-2.0)
        return own if self.rough is None else own + self.rough.T @ self.rough

    def pull(self, x: Array) -> Array:
        """Half the penalty's gradient."""
        off = x - self.mean
        own = off / self.prior_std**2
        return own if self.rough is None else own + self.rough.T @ (self.rough @ off)


EMPTY = np.zeros(0)
NOTHING = Unknowns(EMPTY, EMPTY, EMPTY, EMPTY, EMPTY)
"""No numbers: only starts are fitted."""


def _parts(unknowns: Unknowns) -> tuple[Array, ...]:
    return tuple(getattr(unknowns, name) for name in ("low", "high", "step", "mean", "prior_std"))
