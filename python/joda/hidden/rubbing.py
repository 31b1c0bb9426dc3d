"""Laws of dry friction that a joint may hide, on top of its base's."""

from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Along, Array, Friction, window


@dataclass(frozen=True)
class FrictionAlong(Friction):
    """Dry friction that depends on position."""

    size: float
    course: Along

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.size * self.course(s)


@dataclass(frozen=True)
class Rub(Friction):
    """Dry friction of a constant size on [a, b]; direction as in Viscous."""

    size: float
    a: float
    b: float
    edge: float
    direction: int = 0

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        rub = self.size * window(s, self.a, self.b, self.edge)
        return rub * (sign == self.direction) if self.direction else rub


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
class Loaded(Friction):
    """coefficient |load|."""

    coefficient: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.coefficient * np.abs(load)


@dataclass(frozen=True)
class RootDamping(Friction):
    """size sqrt|v|."""

    size: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return self.size * np.sqrt(np.abs(v))


@dataclass(frozen=True)
class Cold(Friction):
    """(size + damping |v|) exp(-t / time): what goes as the joint warms up."""

    size: float
    damping: float
    time: float

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """See Friction."""
        return (self.size + self.damping * np.abs(v)) * np.exp(-t / self.time)
