"""Laws of dry friction that a joint may hide, on top of its base's."""

from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Array, Friction, Shape, window


@dataclass(frozen=True)
class PositionFriction(Friction):
    """Dry friction that depends on position; direction as in Viscous."""

    size: float
    course: Shape
    direction: int = 0

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        limit = self.size * self.course(s)
        return limit * (sign == self.direction) if self.direction else limit


@dataclass(frozen=True)
class IntervalFriction(Friction):
    """Dry friction of a constant size on [a, b]; direction as in Viscous."""

    size: float
    a: float
    b: float
    edge: float
    direction: int = 0

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        limit = self.size * window(s, self.a, self.b, self.edge)
        return limit * (sign == self.direction) if self.direction else limit


@dataclass(frozen=True)
class Stribeck(Friction):
    """size exp(-(v / velocity)²)."""

    size: float
    velocity: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        u = v / self.velocity
        return self.size * np.exp(-u * u)


@dataclass(frozen=True)
class PowerStribeck(Friction):
    """size exp(-|v / velocity|^exponent) (Bo and Pavelescu, Wear 82 (1982) 277)."""

    size: float
    velocity: float
    exponent: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.size * np.exp(-(np.abs(v / self.velocity) ** self.exponent))


@dataclass(frozen=True)
class RationalStribeck(Friction):
    """size / (1 + (v / velocity)²) (Hess and Soom, J. Tribol. 112 (1990) 147)."""

    size: float
    velocity: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        u = v / self.velocity
        return self.size / (1 + u * u)


@dataclass(frozen=True)
class LoadFriction(Friction):
    """coefficient |load|."""

    coefficient: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.coefficient * np.abs(load)


@dataclass(frozen=True)
class LoadedContact(Friction):
    """coefficient reference (|load| / reference)^(2/3), of a round contact under load."""

    coefficient: float
    reference: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.coefficient * self.reference * (np.abs(load) / self.reference) ** (2 / 3)


@dataclass(frozen=True)
class LoadedBearing(Friction):
    """coefficient (sqrt(load² + side²) - side), of a bearing with a force from the side."""

    coefficient: float
    side: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.coefficient * (np.hypot(load, self.side) - self.side)


@dataclass(frozen=True)
class Governor(Friction):
    """Brake shoes that fly out above a velocity, size min((v / velocity)² - 1, 3)."""

    size: float
    velocity: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.size * np.clip((v / self.velocity) ** 2 - 1, 0.0, 3.0)


@dataclass(frozen=True)
class RootDamping(Friction):
    """size sqrt|v|."""

    size: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.size * np.sqrt(np.abs(v))


@dataclass(frozen=True)
class WarmingFriction(Friction):
    """(size + damping |v|) exp(-t / time): what goes as the joint warms up."""

    size: float
    damping: float
    time: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return (self.size + self.damping * np.abs(v)) * np.exp(-t / self.time)
