"""Where the fit of an effect begins: an initial guess of its numbers, in a joint's own units."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

Number = tuple[float, float, float] | tuple[float, float, float, float, float]
"""Low, high and step; and where low and high are only usual, how far they may be widened."""
Trial = Sequence[float]
"""Of each number, a value to begin with."""

AnyDirection = Literal["both", "positive", "negative"]

TRIAL = 0.1
"""Strength with which an effect is tried, in usual forces."""
STRENGTH = (0.0, 300.0, 0.005)
"""Bounds and step of a strength, in usual forces: where it is strong, few joints left alone go."""
TINY = 1e-12
"""As good as no force."""
MOVED = 0.9
"""Part of the largest friction per load, or added inertia, from which no force is felt to move the
joint: something else does."""


@dataclass(frozen=True)
class Units:
    """A joint's own units.

    Attributes:
        force: usual force, N·m or N.
        speed: usual speed, rad/s or m/s.
        inertia: kg·m² or kg.
        span: of the range, rad or m.
        visited: part of the range that was measured, normalised.
        friction: usual dry friction of the model, N·m or N; 0 for none.
        forced: whether a force was recorded.
        weight: largest force of gravity, N·m or N.
        hinge: whether it is a hinge.
    """

    force: float
    speed: float
    inertia: float
    span: float
    visited: tuple[float, float]
    friction: float
    forced: bool
    weight: float
    hinge: bool

    def of_force(self, power: int = 0) -> str:
        """Unit of a force, or of one per speed to that power."""
        force, length = ("N·m", "rad") if self.hinge else ("N", "m")
        return force + ("", f"·s/{length}", f"·s²/{length}²")[power]


@dataclass(frozen=True)
class InitialGuess:
    """An effect with unknown numbers, and values to begin with.

    Attributes:
        numbers: what is known of each: strengths in usual forces, places normalised, speeds in the
            usual speed, what may be of any size as its logarithm.
        trials: values to begin with.
        effect: the effect with such numbers.
        magnitude: how large it is then, in `unit`.
        unit: of the magnitude.
        direction: both, positive or negative.
        exact: whether its law is known, or only the rough shape of its curve.
        itself: whether it is, with these numbers, what its name says: of no size at which forces no
            longer count.
        interval: where it acts, in normalised position; None: all over the range.
        kept: how many rough fits are fitted to the end: several where the motion jumps in a number.
    """

    numbers: Sequence[Number]
    trials: Sequence[Trial]
    effect: Callable[[Trial], Any]
    magnitude: Callable[[Trial], float]
    unit: str
    direction: AnyDirection = "both"
    exact: bool = True
    itself: Callable[[Trial], bool] = lambda x: True
    interval: tuple[float, float] | None = None
    kept: int = 1
