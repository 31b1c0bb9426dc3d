"""Shapes of laws over normalised position: wells, magnets, springs, dead centres, zones.

A positive value of a force pushes towards the high end; sizes are set by who uses a shape.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Array, Shape, bump

GRID = np.linspace(0.0, 1.0, 2001)
NEGLIGIBLE = 0.1
"""Of the peak, where a shape counts as over."""


def peak(shape: Shape) -> float:
    """Largest absolute value in the range."""
    return float(np.max(np.abs(shape(GRID))))


def extent(shape: Shape) -> tuple[float, float]:
    """Where a shape is more than a tenth of its peak, from the first place to the last."""
    inside = np.flatnonzero(np.abs(shape(GRID)) > NEGLIGIBLE * peak(shape))
    return float(GRID[inside[0]]), float(GRID[inside[-1]])


# --- lobes of a well around u = 0, which reach to u = ±1 or vanish beyond
def windowed_sine(u: Array) -> Array:
    """-sin(pi u) cos²(pi u / 2)."""
    return np.asarray(-np.sin(np.pi * u) * np.cos(0.5 * np.pi * u) ** 2 * (np.abs(u) < 1))


def triangle(u: Array) -> Array:
    """Straight from 0 at u = -1 to 1 at -1/2, -1 at 1/2 and 0 at 1."""
    return np.interp(u, (-1.0, -0.5, 0.5, 1.0), (0.0, 1.0, -1.0, 0.0))


def quartic(u: Array) -> Array:
    """-u (1 - u²)²."""
    return np.asarray(-u * (1 - np.minimum(u * u, 1.0)) ** 2)


def gaussian(u: Array) -> Array:
    """Slope of a Gaussian of standard deviation 1/3."""
    return bump(3 * u)


@dataclass(frozen=True)
class Well:
    """A lobe of half a width about a centre; where it pulls down it is `ratio` as strong."""

    lobe: Callable[[Array], Array]
    centre: float
    half: float
    ratio: float = 1.0

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        u = (s - self.centre) / self.half
        return self.lobe(u) * np.where(u > 0, self.ratio, 1.0)


@dataclass(frozen=True)
class Sum:
    """Some shapes together, each with a weight."""

    shapes: tuple[Shape, ...]
    weights: tuple[float, ...]

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        parts = [w * shape(s) for w, shape in zip(self.weights, self.shapes, strict=True)]
        return np.asarray(np.sum(parts, axis=0))


# --- pulls towards an end, over the distance x from it
@dataclass(frozen=True)
class ToEnd:
    """A pull towards the high or the low end."""

    pull: Shape
    high: bool

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        return self.pull(1 - s) if self.high else -self.pull(s)


@dataclass(frozen=True)
class Gap:
    """A magnet, (1 + x / gap)^-power; 4 are two dipoles."""

    gap: float
    power: float

    def __call__(self, x: Array) -> Array:
        """Its value at the distance x."""
        return np.asarray((1 + np.maximum(x, 0.0) / self.gap) ** -self.power)


@dataclass(frozen=True)
class Decay:
    """A magnet in a yoke, exp(-x / length)."""

    length: float

    def __call__(self, x: Array) -> Array:
        """Its value at the distance x."""
        return np.exp(-np.maximum(x, 0.0) / self.length)


@dataclass(frozen=True)
class Lever:
    """A spring on a lever, sin(begin + angle x)."""

    begin: float
    angle: float

    def __call__(self, x: Array) -> Array:
        """Its value at the distance x."""
        return np.sin(self.begin + self.angle * x)


@dataclass(frozen=True)
class TwoRate:
    """A preloaded spring to which a second, of `ratio` times its rate, comes at a distance."""

    preload: float
    knee: float
    ratio: float

    def __call__(self, x: Array) -> Array:
        """Its value at the distance x."""
        return np.asarray(self.preload + x + self.ratio * np.maximum(x - self.knee, 0.0))


@dataclass(frozen=True)
class Progressive:
    """preload + x^power; a spring that stiffens or yields."""

    preload: float
    power: float

    def __call__(self, x: Array) -> Array:
        """Its value at the distance x."""
        return np.asarray(self.preload + np.maximum(x, 0.0) ** self.power)


# --- over a dead centre
@dataclass(frozen=True)
class Cubic:
    """x (1 - x² / rest²) about a middle: it rests at middle ± rest."""

    middle: float
    rest: float

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        x = s - self.middle
        return np.asarray(x * (1 - (x / self.rest) ** 2))


@dataclass(frozen=True)
class Sine:
    """sin(2 pi x / period) about a middle."""

    middle: float
    period: float

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        return np.sin(2 * np.pi * (s - self.middle) / self.period)


@dataclass(frozen=True)
class Strut:
    """A gas strut or spring between a fixed pivot and one on the part.

    With pivots at 1 and `arm` from the hinge, its length is l² = 1 + arm² - 2 arm cos(a), the
    angle a = swing (s - middle); it pushes with slack - l, or a constant force if slack is 0.
    """

    middle: float
    arm: float
    swing: float
    slack: float

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        angle = self.swing * (s - self.middle)
        length = np.sqrt(1 + self.arm**2 - 2 * self.arm * np.cos(angle))
        force = np.maximum(self.slack - length, 0.0) if self.slack else 1.0
        return np.asarray(force * self.arm * np.sin(angle) / length)


# --- zones, from 0 to 1
@dataclass(frozen=True)
class Slope:
    """1 + slope (s - 1/2)."""

    slope: float = 0.0

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        return 1 + self.slope * (s - 0.5)


@dataclass(frozen=True)
class RaisedCosine:
    """(1 + cos) / 2 from a to b, 0 outside."""

    a: float
    b: float

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        u = np.clip((s - self.a) / (self.b - self.a), 0.0, 1.0)
        return 0.5 - 0.5 * np.cos(2 * np.pi * u)


@dataclass(frozen=True)
class Trapezoid:
    """1 from a to b, with straight edges outside of them."""

    a: float
    b: float
    edge: float

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        knots = (self.a - self.edge, self.a, self.b, self.b + self.edge)
        return np.interp(s, knots, (0.0, 1.0, 1.0, 0.0))


@dataclass(frozen=True)
class Logistic:
    """Between a and b, with logistic edges of a width."""

    a: float
    b: float
    width: float

    def __call__(self, s: Array) -> Array:
        """Its value at s."""
        up, down = (np.tanh(0.5 * (s - edge) / self.width) for edge in (self.a, self.b))
        return np.asarray(0.5 * (up - down))
