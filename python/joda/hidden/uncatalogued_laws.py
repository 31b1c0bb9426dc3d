"""Laws that no catalogue has: of speed and position at once, of time, of direction."""

from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Array, Force, Friction


@dataclass(frozen=True)
class FadingWave(Force):
    """A force that is periodic in position and fades with speed: size sin(2 pi periods s + phase) /
    (1 + (v / velocity)²)."""

    size: float
    periods: float
    phase: float
    velocity: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        wave = np.sin(2 * np.pi * self.periods * s + self.phase)
        return np.asarray(self.size * wave / (1 + (v / self.velocity) ** 2))


@dataclass(frozen=True)
class Drift(Force):
    """A force that comes with time, size (1 - exp(-t / time)), as a part warms up and bends."""

    size: float
    time: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return -self.size * np.expm1(-t / self.time)


@dataclass(frozen=True)
class Tremor(Force):
    """A force that nothing about the joint explains: waves in time whose frequencies have no common
    one, of equal amplitude; size is the RMS of their sum.

    Attributes:
        size: N·m or N.
        frequencies: Hz.
        phases: of each.
    """

    size: float
    frequencies: tuple[float, ...]
    phases: tuple[float, ...]

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        waves = [
            np.sin(2 * np.pi * f * t + phase)
            for f, phase in zip(self.frequencies, self.phases, strict=True)
        ]
        return np.asarray(self.size * np.sqrt(2 / len(waves)) * np.sum(waves, axis=0))


@dataclass(frozen=True)
class Ratchet(Friction):
    """A pawl on teeth: against one direction its friction rises along each tooth from 0 to size."""

    size: float
    teeth: float
    direction: int

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return np.asarray(self.size * np.mod(self.teeth * s, 1.0) * (sign == self.direction))
