"""What a joint truly does: the base model's mechanics, laws with a state, and what is hidden."""

from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np

from joda.hidden.laws import Array, Law, State
from joda.hidden.masses import Attached, Behind
from joda.hidden.stops import Stop

RESTITUTION_EFFECT = "end_stop_restitution"
"""Name of the effect that a joint shows only at the ends of its range."""
RESTITUTION = 0.135
"""Of the base's ends: exp(-2), as of MuJoCo's limit, critically damped and never pulling."""


class Presliding(State):
    """Friction with a state, in place of the base's dry friction."""


@dataclass(frozen=True)
class Bristle(Presliding):
    """Dahl's bristle, or LuGre's where damping is not 0.

    dz/dt = v - stiffness |v| z / friction; force -stiffness z - damping dz/dt (Canudas de Wit et
    al., IEEE TAC 40 (1995) 419, without its Stribeck term).

    Attributes:
        friction: N·m or N.
        stiffness: N·m/rad or N/m.
        damping: N·m·s/rad or N·s/m.
    """

    friction: float
    stiffness: float
    damping: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        full = np.sign(v) * (self.friction / self.stiffness)
        return full + (z - full) * np.exp(np.abs(v) * (-h * self.stiffness / self.friction))

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        rate = v - np.abs(v) * z * (self.stiffness / self.friction)
        return -self.stiffness * z - self.damping * rate


@dataclass(frozen=True)
class Maxwell(State):
    """Spring and dashpot in series: force -stiffness z, dz/dt = v - z / time."""

    stiffness: float
    time: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        left = float(np.exp(-h / self.time))
        return left * z + (self.time * (1 - left)) * v

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        return -self.stiffness * z


@dataclass(frozen=True)
class Ageing(State):
    """Dry friction size z / (z + time); the contact's age z grows at rest.

    dz/dt = 1 - |v| z / slip (Dieterich, J. Geophys. Res. 84 (1979) 2161); slip in rad or m.
    """

    size: float
    time: float
    slip: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        return (z + h) / (1 + np.abs(v) * (h / self.slip))

    def limit(self, z: Array) -> Array:
        """See State."""
        return self.size * z / (z + self.time)


@dataclass(frozen=True)
class Cable(State):
    """A slack cable: taut beyond `taut`, it pulls back as a square, then drags its far end along.

    Attributes:
        size: force at which the far end gives way, N·m or N.
        taut: where it becomes taut, of the range.
        stretch: its lengthening at that force, of the range.
        time: s in which the far end goes back, to 37 %.
    """

    size: float
    taut: float
    stretch: float
    time: float

    def advance(self, z: Array, s: Array, v: Array, h: float) -> Array:
        """See State."""
        return np.maximum(z * (1 - h / self.time), s - (self.taut + self.stretch))

    def force(self, z: Array, s: Array, v: Array) -> Array:
        """See State."""
        x = np.maximum((s - z - self.taut) / self.stretch, 0.0)
        return -self.size * x * x


@dataclass(frozen=True)
class Inertia(Law):
    """More inertia, kg·m² or kg."""

    size: float


@dataclass(frozen=True)
class Bounce(Law):
    """Another coefficient of restitution at the ends."""

    restitution: float


@dataclass(frozen=True)
class Rebound(Law):
    """Another stop at the high or the low end."""

    high: bool
    stop: Stop


@dataclass(frozen=True)
class Play(Law):
    """The force acts on a handle of its own inertia that has play (rad or m, whole width)."""

    width: float
    inertia: float


@dataclass(frozen=True)
class Delay(Law):
    """The force acts late, by a time in s."""

    time: float


@dataclass(frozen=True)
class Joint:
    """A joint's base mechanics.

    Attributes:
        kind: of the joint.
        lo, hi: its range, rad or m.
        inertia: kg·m² or kg.
        gravity_cos, gravity_sin: torque of gravity gravity_cos cos(q) + gravity_sin sin(q); on a
            slide gravity_cos is the force and the other is 0.
        time: natural time of a motion through the range, s.
        force: natural size of forces on it, N·m or N.
    """

    kind: Literal["hinge", "slide"]
    lo: float
    hi: float
    inertia: float
    gravity_cos: float
    gravity_sin: float
    time: float
    force: float

    @property
    def span(self) -> float:
        """Of the range, rad or m."""
        return self.hi - self.lo


@dataclass(frozen=True)
class Truth:
    """Everything about a joint.

    Attributes:
        joint: its mechanics.
        friction: true dry friction of the base, N·m or N.
        damping: true damping of the base, N·m·s/rad or N·s/m.
        hidden: laws that the base model lacks.
        friction_model, damping_model: what the base model believes.
        stops: at the low and the high end; None for rigid ends.
        spring: stiffness (N·m/rad or N/m) and position of rest of a return spring, which the base
            model has.
        limit_model: the base model's solreflimit; None for MuJoCo's default.
        tight: whether the base model holds its dry friction tightly.
        believed: the mechanics that the base model has instead; None for the true ones.
    """

    joint: Joint
    friction: float
    damping: float
    hidden: tuple[Law, ...] = ()
    friction_model: float = 0.0
    damping_model: float = 0.0
    stops: tuple[Stop, Stop] | None = None
    spring: tuple[float, float] = (0.0, 0.0)
    limit_model: tuple[float, float] | None = None
    tight: bool = False
    believed: Joint | None = None

    def bare(self) -> Self:
        """The same without what is hidden."""
        return replace(self, hidden=())

    @property
    def inertia(self) -> float:
        """True inertia, kg·m² or kg, without a handle, and without what is behind a play."""
        more = sum(law.size for law in self.hidden if isinstance(law, Inertia))
        less = sum(law.inertia for law in self.hidden if isinstance(law, Behind))
        return self.joint.inertia + more - less

    @property
    def ends(self) -> tuple[Stop, ...]:
        """The stops at the low and the high end, as they truly are; none if these are rigid."""
        if self.stops is None:
            return ()
        found = {law.high: law.stop for law in self.hidden if isinstance(law, Rebound)}
        return found.get(False, self.stops[0]), found.get(True, self.stops[1])

    @property
    def fastest(self) -> float:
        """Frequency on the stiffest of its springs, rad/s, or more."""
        springs = (*self.ends, *self.hidden)
        stiffness = max((getattr(spring, "stiffness", 0.0) for spring in springs), default=0.0)
        masses = [law.inertia for law in self.hidden if isinstance(law, Behind | Attached)]
        return float(np.sqrt(stiffness / min([self.inertia, *masses])))
