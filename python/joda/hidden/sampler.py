"""What draws a hidden effect: sizes at random, in a joint's natural units."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from joda.hidden.laws import Law
from joda.hidden.truth import Joint, Truth

Direction = Literal["both", "positive", "negative"]
WAYS: dict[int, Direction] = {0: "both", 1: "positive", -1: "negative"}


@dataclass(frozen=True)
class Hidden:
    """What is hidden, and what is said of it.

    Attributes:
        laws: that make it.
        interval: where it acts, normalised; [0, 1] of what acts everywhere.
        magnitude: its size.
        unit: of the magnitude.
        direction: of motion in which it acts.
    """

    laws: tuple[Law, ...]
    interval: tuple[float, float]
    magnitude: float
    unit: str
    direction: Direction = "both"


@dataclass(frozen=True)
class Sampler:
    """Draws for one joint.

    Attributes:
        rng: of the draws.
        bare: the joint with nothing hidden.
        vigour: 0 draws sizes from all of their ranges, 1 the largest only.
    """

    rng: np.random.Generator
    bare: Truth
    vigour: float

    @property
    def joint(self) -> Joint:
        """Its mechanics."""
        return self.bare.joint

    def size(self, least: float, most: float) -> float:
        """A size between two, evenly over its logarithm."""
        low, high = np.log(least), np.log(most)
        return float(np.exp(self.rng.uniform(low + self.vigour * (high - low), high)))

    def force(self, least: float = 0.15, most: float = 0.8) -> float:
        """A force, N·m or N, between two in natural forces."""
        return self.joint.force * self.size(least, most)

    def damping(self, least: float = 0.15, most: float = 0.6) -> float:
        """Damping that has such a force at the natural speed, N·m·s/rad or N·s/m."""
        return self.force(least, most) * self.joint.time / self.joint.span

    def between(self, least: float, most: float) -> float:
        """A number, evenly."""
        return float(self.rng.uniform(least, most))

    def chance(self) -> bool:
        """Heads or tails."""
        return bool(self.rng.random() < 0.5)

    def way(self) -> int:
        """1 or -1."""
        return 1 if self.chance() else -1

    def stretch(self, least: float, most: float) -> tuple[float, float]:
        """An interval of a length between two, anywhere."""
        length = self.between(least, most)
        a = self.between(0.03, 0.97 - length)
        return a, a + length

    def edge(self) -> float:
        """Half width of a smooth edge, or 0 of a sharp one."""
        return self.between(0.01, 0.03) if self.chance() else 0.0

    def unit(self, per: str = "") -> str:
        """N·m on a hinge or N on a slide, perhaps with s, s² or of stiffness."""
        hinge, length = self.joint.kind == "hinge", {"": "", "s": "·s", "s²": "·s²", "1": ""}[per]
        below = {"": "", "s": "rad", "s²": "rad²", "1": "rad"}[per]
        if not hinge:
            below = below.replace("rad", "m")
        return ("N·m" if hinge else "N") + length + (f"/{below}" if below else "")


Builder = Callable[[Sampler], Hidden]


def everywhere(law: Law, magnitude: float, unit: str, way: int = 0) -> Hidden:
    """A law that acts in the whole range; way 1 or -1: in one direction only."""
    return Hidden((law,), (0.0, 1.0), magnitude, unit, WAYS[way])
