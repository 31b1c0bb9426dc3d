"""Laws that remember: presliding in several elements, wear, cushions, lost motion."""

from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Array, State
from joda.hidden.truth import Presliding


@dataclass(frozen=True)
class Slips(Presliding):
    """Springs in parallel, each behind a contact that slips (Maxwell-slip; Iwan 1966).

    z has shape (elements, lanes): how far each is stretched.

    Attributes:
        frictions: at which each slips, N·m or N.
        stiffnesses: N·m/rad or N/m.
    """

    frictions: tuple[float, ...]
    stiffnesses: tuple[float, ...]

    @property
    def stiffness(self) -> float:
        """Of all together, N·m/rad or N/m."""
        return sum(self.stiffnesses)

    def start(self, s: Array, v: Array) -> Array:
        """See State."""
        return np.zeros((len(self.frictions), len(s)))

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        most = np.divide(self.frictions, self.stiffnesses)[:, None]
        return np.minimum(np.maximum(z + h * v, -most), most)

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        return np.asarray(-np.dot(self.stiffnesses, z))


def slips(friction: float, stiffness: float, count: int) -> Slips:
    """So many elements that slip one after the other, the last at twice friction / stiffness."""
    ends = np.linspace(0.5, 2.0, count) * friction / stiffness
    shares = np.linspace(1.0, 0.4, count)
    frictions = friction * shares / shares.sum()
    return Slips(tuple(map(float, frictions)), tuple(map(float, frictions / ends)))


@dataclass(frozen=True)
class BrittleBristle(Presliding):
    """Dahl's bristle with an exponent between 0 and 1 (Dahl, TOR-0158 (1968)).

    dz/dt = v |1 - sign(v) stiffness z / friction|^exponent.

    Attributes:
        friction: N·m or N.
        stiffness: N·m/rad or N/m.
        exponent: 1 is `Bristle`, 0 a spring that slips.
    """

    friction: float
    stiffness: float
    exponent: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        most, way = self.friction / self.stiffness, np.sign(v)
        power = 1 - self.exponent
        left = np.maximum(1 - way * z / most, 0.0) ** power
        left = np.maximum(left - np.abs(v) * (power * h / most), 0.0) ** (1 / power)
        return np.where(way == 0, z, way * most * (1 - left))

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        return -self.stiffness * z


@dataclass(frozen=True)
class RunningIn(State):
    """Dry friction size exp(-z / path) that goes with the way z made; path in rad or m."""

    size: float
    path: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        return z + h * np.abs(v)

    def limit(self, z: Array) -> Array:
        """See State."""
        return self.size * np.exp(-z / self.path)


@dataclass(frozen=True)
class Cushion(State):
    """Air that is caught before the high end, and leaks; z is its force, which never pulls.

    Attributes:
        stiffness: N·m/rad or N/m.
        begin: where it is closed, normalised.
        time: in which it leaks to 37 %, s.
    """

    stiffness: float
    begin: float
    time: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        left = float(np.exp(-h / self.time))
        grown = left * z + (self.stiffness * self.time * (1 - left)) * v
        return np.where(s > self.begin, np.maximum(grown, 0.0), 0.0)

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        return -z


@dataclass(frozen=True)
class LostMotion(State):
    """A damper behind a play; z is how far its piston is ahead.

    Attributes:
        damping: N·m·s/rad or N·s/m.
        width: of the play, rad or m.
    """

    damping: float
    width: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        reach = 0.5 * self.width
        return np.minimum(np.maximum(z - h * v, -reach), reach)

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        return -self.damping * v * (z * np.sign(v) <= -0.5 * self.width)
