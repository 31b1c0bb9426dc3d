"""Other drags of a fluid than Newton's."""

from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Array, Force, Shape


@dataclass(frozen=True)
class Orifice(Force):
    """Drag that is laminar below a velocity, -size v sqrt(v² + slow²)."""

    size: float
    slow: float

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return -self.size * v * np.hypot(v, self.slow)


@dataclass(frozen=True)
class DragAlong(Force):
    """Drag that depends on position, -size course(s) v |v|."""

    size: float
    course: Shape

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        return -self.size * self.course(s) * v * np.abs(v)
