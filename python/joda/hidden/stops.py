"""Compliant stops at the ends of a range, and the restitution that they make."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

DEAD = 1e-6
"""Coefficient of restitution below which none is told from it."""


class Stop(Protocol):
    """What pushes the joint back into its range."""

    @property
    def stiffness(self) -> float:
        """N·m/rad or N/m."""

    def push(self, depth: Array, rate: Array) -> Array:
        """Force of at least 0, N·m or N, at a depth (>= 0, rad or m) that grows with a rate."""


@dataclass(frozen=True)
class Buffer:
    """Spring and damper in parallel that push and never pull, stiffness x + damping dx/dt.

    Attributes:
        stiffness: N·m/rad or N/m.
        damping: N·m·s/rad or N·s/m.
    """

    stiffness: float
    damping: float

    def push(self, depth: Array, rate: Array) -> Array:
        """See Stop."""
        return np.maximum(self.stiffness * depth + self.damping * rate, 0.0)


@dataclass(frozen=True)
class Pad:
    """An elastic contact, stiffness depth (x / depth)^1.5 (1 + damping dx/dt).

    Hunt and Crossley, J. Appl. Mech. 42 (1975) 440.

    Attributes:
        stiffness: secant at the depth, N·m/rad or N/m.
        depth: rad or m.
        damping: s/rad or s/m.
    """

    stiffness: float
    depth: float
    damping: float

    def push(self, depth: Array, rate: Array) -> Array:
        """See Stop."""
        spring = self.stiffness * self.depth * (depth / self.depth) ** 1.5
        return spring * np.maximum(1 + self.damping * rate, 0.0)


def restitution(ratio: float) -> float:
    """Coefficient of restitution of a buffer of a damping ratio.

    Until its force is zero (Schwager and Pöschel, Granular Matter 9 (2007) 465); 1 gives exp(-2).
    """
    root = np.sqrt(abs(1 - ratio * ratio))
    if root < DEAD:
        return float(np.exp(-2 * ratio))
    if ratio < 1:
        return float(np.exp(-ratio / root * np.arctan2(2 * ratio * root, 2 * ratio * ratio - 1)))
    return float(np.exp(-ratio / root * np.log((ratio + root) / (ratio - root))))


def damping_ratio(coefficient: float) -> float:
    """Of the buffer with a coefficient of restitution between 0.01 and 1."""
    return float(brentq(lambda ratio: restitution(ratio) - coefficient, DEAD, 10.0))


def buffer(inertia: float, frequency: float, ratio: float) -> Buffer:
    """A buffer on which the inertia (kg·m² or kg) swings with a frequency (rad/s)."""
    return Buffer(inertia * frequency**2, 2 * ratio * inertia * frequency)


def pad(inertia: float, frequency: float, speed: float, coefficient: float) -> Pad:
    """A pad that throws back what comes at a speed with a coefficient of restitution below 1.

    At that speed (rad/s or m/s) an undamped buffer of the frequency (rad/s) gives way as far.
    With y = damping speed, y - ln(1 + y) is the same for y and -coefficient y.
    """

    def energy(y: float) -> float:
        return float(y - np.log1p(y))

    most = (1 - DEAD) / coefficient
    y = brentq(lambda y: energy(y) - energy(-coefficient * y), DEAD, most)
    return Pad(inertia * frequency**2, speed / frequency, float(y) / speed)
