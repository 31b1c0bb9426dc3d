"""Masses that move with a joint: through a linkage, on a spring, behind a play."""

from dataclasses import dataclass

import numpy as np

from joda.hidden.laws import Array, Force, State


@dataclass(frozen=True)
class Linkage(Force):
    """More inertia, which a linkage makes depend on position: size (1 + swing cos(pi s)).

    Its force is -dI/dq v² / 2, so that no energy is lost.

    Attributes:
        size: kg·m² or kg.
        swing: between -1 and 1.
        span: of the range, rad or m.
    """

    size: float
    swing: float
    span: float

    def inertia(self, s: Array) -> Array:
        """kg·m² or kg."""
        return self.size * (1 + self.swing * np.cos(np.pi * s))

    def force(self, s: Array, q: Array, v: Array, t: Array) -> Array:
        """See Force."""
        slope = -self.size * self.swing * np.pi * np.sin(np.pi * s) / self.span
        return -0.5 * slope * v * v


@dataclass(frozen=True)
class Attached(State):
    """A mass on a spring and a damper; z is how far it is ahead, and its velocity.

    Attributes:
        inertia: kg·m² or kg.
        stiffness: N·m/rad or N/m.
        damping: N·m·s/rad or N·s/m.
    """

    inertia: float
    stiffness: float
    damping: float

    def start(self, s: Array, v: Array) -> Array:
        """See State."""
        return np.stack([np.zeros_like(v), v])

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State; a semi-implicit step."""
        ahead, own = z
        own = own - (h / self.inertia) * self.force(z, s, v)
        return np.stack([ahead + h * (own - v), own])

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        return np.asarray(self.stiffness * z[0] + self.damping * (z[1] - v))


@dataclass(frozen=True)
class Behind(State):
    """A part of the joint behind a play: what is pushed and measured is on this side of it.

    z is how far the part is ahead, and its velocity. Flanks give way and damp, and never pull; the
    part's dry friction is set-valued, by an implicit step.

    Attributes:
        width: of the play, rad or m.
        inertia: of the part, kg·m² or kg, out of the joint's.
        friction, damping: of the part, out of the joint's, N·m or N, N·m·s/rad or N·s/m.
        stiffness: of the flanks, N·m/rad or N/m.
        flank_damping: of the flanks, N·m·s/rad or N·s/m.
    """

    width: float
    inertia: float
    friction: float
    damping: float
    stiffness: float
    flank_damping: float

    def start(self, s: Array, v: Array) -> Array:
        """See State."""
        return np.stack([np.zeros_like(v), v])

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        ahead, own = z
        part = h / self.inertia
        own = own - part * (self.force(z, s, v) + self.damping * own)
        own = np.sign(own) * np.maximum(np.abs(own) - part * self.friction, 0.0)
        return np.stack([ahead + h * (own - v), own])

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        ahead, own = z
        reach = 0.5 * self.width
        over = ahead - np.minimum(np.maximum(ahead, -reach), reach)
        push = self.stiffness * np.abs(over) + self.flank_damping * np.sign(over) * (own - v)
        return np.asarray(np.sign(over) * np.maximum(push, 0.0))
