"""Analytic laws that a joint may hide.

Positions are normalised, s = (q - lo) / (hi - lo); speeds, forces and times are physical; arrays
have shape (lanes,), one lane per motion that is simulated.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Shape = Callable[[Array], Array]
"""A course over normalised position."""


def window(s: Array, a: float, b: float, edge: float) -> Array:
    """1 within [a, b], 0 outside; the edges are tanh of a half width `edge`, or sharp for 0."""
    if edge == 0:
        return np.asarray((s >= a) & (s <= b), dtype=np.float64)
    return np.asarray(0.5 * (np.tanh((s - a) / edge) - np.tanh((s - b) / edge)))


def bump(u: Array) -> Array:
    """Slope of a Gaussian, -u exp((1 - u²) / 2): largest value 1, at u = -1."""
    return -u * np.exp(0.5 - 0.5 * u * u)


class Law:
    """Something hidden."""


class Force(Law):
    """A force from outside the base model that is continuous in velocity, or vanishes with it."""

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """N·m or N."""
        raise NotImplementedError


class Friction(Law):
    """Dry friction on top of the base model's."""

    def limit(self, s: Array, v: Array, sign: Array, load: Array, t: Array) -> Array:
        """Largest friction, N·m or N.

        Args:
            s: normalised position.
            v: velocity.
            sign: direction of motion, or of the net force at rest: -1, 0 or 1.
            load: gravity and applied force.
            t: s.
        """
        raise NotImplementedError


class State(Law):
    """A law with a state of its own, z."""

    def start(self, s: Array, v: Array) -> Array:
        """Its state before the motion."""
        return np.zeros_like(s)

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """Its state a time h later, at constant velocity."""
        raise NotImplementedError

    def force(self, z: Array, s: Array, v: Array) -> Array | float:
        """N·m or N."""
        return 0.0

    def limit(self, z: Array) -> Array | float:
        """Additional dry friction, N·m or N."""
        return 0.0


@dataclass(frozen=True)
class Constant(Force):
    """A constant force on [a, b]."""

    size: float
    a: float
    b: float
    edge: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return self.size * window(s, self.a, self.b, self.edge)


@dataclass(frozen=True)
class Wells(Force):
    """Gaussian wells of potential (barriers, if size is negative); size is the largest force."""

    size: float
    centres: tuple[float, ...]
    width: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        total = bump((s - self.centres[0]) / self.width)
        for centre in self.centres[1:]:
            total = total + bump((s - centre) / self.width)
        return self.size * total


@dataclass(frozen=True)
class OverCentre(Force):
    """A compressed spring that passes its dead centre `middle`; `arm` is its length there."""

    size: float
    middle: float
    arm: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        x = s - self.middle
        return self.size * x / np.sqrt(x * x + self.arm * self.arm)


@dataclass(frozen=True)
class Magnet(Force):
    """Attraction size / (1 + x / gap)² to an end, x being the distance from it."""

    size: float
    high: bool
    gap: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        if self.high:
            return self.size / (1 + (1 - s) / self.gap) ** 2
        return -self.size / (1 + s / self.gap) ** 2


@dataclass(frozen=True)
class Spring(Force):
    """Pull preload + rate x to an end, x being the distance from it, as far as `reach`."""

    preload: float
    rate: float
    high: bool
    reach: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        x = 1 - s if self.high else s
        pull = (self.preload + self.rate * x) * (x <= self.reach)
        return pull if self.high else -pull


@dataclass(frozen=True)
class Tilt(Force):
    """A weight more: sin(q), cos(q) and constant parts."""

    sin: float
    cos: float
    constant: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return self.sin * np.sin(q) + self.cos * np.cos(q) + self.constant


@dataclass(frozen=True)
class Ripple(Force):
    """A force that is periodic in position; `periods` over the range."""

    size: float
    periods: float
    phase: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return self.size * np.sin(2 * np.pi * self.periods * s + self.phase)


@dataclass(frozen=True)
class Shaking(Force):
    """A force that is periodic in time; frequency in Hz."""

    size: float
    frequency: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return self.size * np.sin(2 * np.pi * self.frequency * t)


@dataclass(frozen=True)
class Switching(Force):
    """A force that changes its sign in time; frequency in Hz."""

    size: float
    frequency: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return np.where(np.mod(t * self.frequency, 1.0) < 0.5, self.size, -self.size)


@dataclass(frozen=True)
class Viscous(Force):
    """Damping of a constant size on [a, b]; direction 1 or -1: only while moving that way."""

    size: float
    a: float
    b: float
    edge: float
    direction: int = 0

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        drag = -self.size * v * window(s, self.a, self.b, self.edge)
        return drag * (v * self.direction > 0) if self.direction else drag


@dataclass(frozen=True)
class Drag(Force):
    """Newton's drag, -size v |v|."""

    size: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return -self.size * v * np.abs(v)


@dataclass(frozen=True)
class Along:
    """A course over position between 0 and 1.

    Attributes:
        shape: bump (Gaussian at `at`, standard deviation `width`), wave (`at` is the phase in
            periods, `width` the period) or ramp (rises from 0 at `at` to 1 at `at` + `width`).
        at, width: in the range; a negative width of a ramp makes it fall.
    """

    shape: str
    at: float
    width: float

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        u = (s - self.at) / self.width
        if self.shape == "bump":
            return np.asarray(np.exp(-0.5 * u * u))
        if self.shape == "wave":
            return np.asarray(0.5 + 0.5 * np.sin(2 * np.pi * u))
        return np.minimum(np.maximum(u, 0.0), 1.0)


@dataclass(frozen=True)
class ViscousAlong(Force):
    """Damping that depends on position; direction as in Viscous."""

    size: float
    course: Shape
    direction: int = 0

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        drag = -self.size * v * self.course(s)
        return drag * (v * self.direction > 0) if self.direction else drag


@dataclass(frozen=True)
class ForceAlong(Force):
    """A conservative force."""

    size: float
    course: Shape

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return self.size * self.course(s)
