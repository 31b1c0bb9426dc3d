"""A law of no catalogue: what it is made of, its numbers, and the profile that it makes.

Force over position, friction, and a resistance over position and velocity that may remember, each
as smooth as a Gaussian process (`joda.diagnosis.learning.gaussian_process`). Where no run has been
there is none of it, and faster than any run it grows no more.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.diagnosis.learning.gaussian_process import modes_of, nearness
from joda.diagnosis.settings import SETTINGS
from joda.effects import LearnedForce
from joda.estimation.least_squares import Inequalities
from joda.estimation.unknowns import Unknowns
from joda.profile import Profile

Array = NDArray[np.float64]
Memory = Literal["none", "position", "speed"]

LABEL = "learned_force"
"""Of the components that are a learned law's part, and name of the effect that is the rest."""
PER_LENGTH = 3.0
"""Control points of a curve over position in the length over which it changes."""
SPEEDS = np.linspace(0, 1, 9)[1:]
"""Roots of the table's speeds, in units of the highest one's: close where friction begins."""
SPEED_LENGTH, ALONG_LENGTH = 0.5, 0.15
"""Over which root of the speed, and which part of the range, a resistance changes."""
ROWS = 9
"""Positions of a table that differs along the way."""
SLOWER = 2.0
"""Largest logarithm of a memory's time in that from which it is sought."""
NO_FRICTION = 1e-6
"""Dry friction up to which there is none, in usual forces."""
STEP = 0.02
"""Of a number, for differences; before the data it is 0 ± 1."""


@dataclass(frozen=True)
class Terms:
    """What a law is made of.

    Attributes:
        position: length over which its force over position changes, normalised; 0: no such force.
        speed: whether it resists motion: dry friction, and a resistance over the speed, either
            direction its own.
        along: whether what resists differs along the way.
        memory: "position": a spring whose far end follows in `time`; "speed": the resistance over
            the speed grows or falls with the speed's mean over that time.
        time: about which that is, s.
    """

    position: float = 0.0
    speed: bool = False
    along: bool = False
    memory: Memory = "none"
    time: float = 1.0


@dataclass(frozen=True)
class Law:
    """A law with unknown numbers, which are 0 ± 1 before the data.

    Attributes:
        terms: what it is made of.
        interval: where runs have been, normalised.
        span: of the joint's range, rad or m.
        fastest: highest speed of the runs, rad/s or m/s.
        force: usual force, N·m or N.
    """

    terms: Terms
    interval: tuple[float, float]
    span: float
    fastest: float
    force: float

    @cached_property
    def unknowns(self) -> Unknowns:
        """The numbers: of the force over position, the friction, the table; and of the memory how
        much it does and the logarithm of its time."""
        n = sum(self._counts)
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        if self.terms.memory != "none":
            low[-2] = -np.inf if self.terms.memory == "speed" else 0.0
            low[-1], high[-1] = -SLOWER, SLOWER
        starts = np.cumsum((0, *self._counts))
        rows = []
        for modes, first in ((self.friction_modes, starts[1]), (self._resists, starts[2])):
            G = np.zeros((len(modes), n))
            G[:, first : first + modes.shape[1]] = modes / self.force
            rows.append(G)
        G = np.concatenate(rows)
        must = Inequalities(G, np.zeros(len(G))) if len(G) else None
        return Unknowns(low, high, np.full(n, STEP), np.zeros(n), np.ones(n), must)

    def written(self, profile: Profile, x: Array) -> Profile:
        """A profile with the law beside what it has."""
        position, friction, table, memory = self._split(x)
        made = profile
        if len(position):
            made = _with(made, "conservative", self._curve(self.force_at(x)))
        rubs = np.maximum(self.friction_modes @ friction, 0.0)
        if np.any(rubs > NO_FRICTION * self.force):
            made = _with(made, "friction", self._curve(rubs))
        if len(table) or len(memory):
            effect = self._effect(self.table_modes @ table, self.gain(x), self.time(x))
            made = made.model_copy(update={"effects": (*made.effects, effect)})
        return made

    @property
    def unremembering(self) -> Array:
        """The memory's numbers with which it does nothing."""
        return np.zeros(self._counts[3])

    def described(self) -> str:
        """What it is made of, for a person who waits."""
        terms = self.terms
        parts = [f"a force over position, smooth over {terms.position:g} of the range"] * bool(
            terms.position
        )
        way = ", along the way" * terms.along
        parts += [f"a resistance over the speed{way}"] * terms.speed
        parts += [f"a memory of {terms.memory}, about {terms.time:.2g} s"] * (
            terms.memory != "none"
        )
        return ", ".join(parts) or "the model's own numbers"

    @cached_property
    def places(self) -> Array:
        """Control points of the force over position, normalised."""
        a, b = self.interval
        count = max(round(PER_LENGTH * (b - a) / self.terms.position), 4)
        return np.linspace(a, b, count + 1)

    @cached_property
    def speeds(self) -> Array:
        """Velocities of the table, rad/s or m/s, without rest."""
        v = self.fastest * SPEEDS**2
        return np.concatenate([-v[::-1], v])

    def force_at(self, x: Array) -> Array:
        """The force over position with some numbers, at `places`, N·m or N."""
        return np.asarray(self.position_modes @ self._split(x)[0])

    def resistance(self, x: Array) -> Array:
        """The force that resists at `speeds`, in the mean along the way, without a memory; N·m or
        N, signed as the velocity."""
        _, friction, table, _ = self._split(x)
        size = np.maximum(self.table_modes @ table, 0.0).reshape(len(self._rows), -1).mean(axis=0)
        rubs = np.maximum(self.friction_modes @ friction, 0.0).mean()
        return np.asarray(np.sign(self.speeds) * (size + rubs))

    def gain(self, x: Array) -> float:
        """Of the memory, in its effect's unit."""
        if self.terms.memory == "none":
            return 0.0
        gain = float(self.remembered(x)[0])
        if self.terms.memory == "speed":
            return gain / self.fastest
        return max(gain, 0.0) * self.force / self.span  # bounds hold but nearly

    def time(self, x: Array) -> float:
        """Of the memory, s."""
        if self.terms.memory == "none":
            return self.terms.time
        slower = np.clip(self.remembered(x)[1], -SLOWER, SLOWER)
        return float(self.terms.time * np.exp(slower))

    def remembered(self, x: Array) -> Array:
        """The memory's numbers."""
        return self._split(x)[3]

    def _split(self, x: Array) -> list[Array]:
        return np.split(x, np.cumsum(self._counts)[:-1])

    @property
    def _counts(self) -> tuple[int, ...]:
        """Of the numbers of each part."""
        own = self.position_modes, self.friction_modes, self.table_modes
        return (*(part.shape[1] for part in own), 2 * (self.terms.memory != "none"))

    @cached_property
    def position_modes(self) -> Array:
        """Modes of the force over position at its control points, N·m or N."""
        if not (length := self.terms.position):
            return np.zeros((0, 0))
        return self.force * modes_of(nearness(self.places, length))

    @cached_property
    def friction_modes(self) -> Array:
        """Modes of the friction at its control points, N·m or N."""
        if not self.terms.speed:
            return np.zeros((0, 0))
        if not self.terms.along:
            return self.force * np.ones((2, 1))
        return self.force * modes_of(1 + nearness(self._rows, ALONG_LENGTH))

    @cached_property
    def _rows(self) -> Array:
        """Positions of the table, normalised."""
        a, b = self.interval
        return np.linspace(a, b, ROWS) if self.terms.along else np.array([a])

    @cached_property
    def table_modes(self) -> Array:
        """Modes of the resistance at the table's points, N·m or N, positive where it resists;
        position by position, in each the negative velocities first."""
        if not self.terms.speed:
            return np.zeros((2 * len(SPEEDS) * len(self._rows), 0))
        u = np.concatenate([-SPEEDS[::-1], SPEEDS])
        either = np.where(u[:, None] * u > 0, 1.0, SETTINGS.learning.directions_alike)
        size = np.abs(u)
        speed = either * size[:, None] * size * nearness(size, SPEED_LENGTH)
        along = 1 + nearness(self._rows, ALONG_LENGTH) if self.terms.along else np.ones((1, 1))
        return self.force * modes_of(np.kron(along, speed))

    @property
    def _resists(self) -> Array:
        """The same where it must not drive; nothing where there is no such resistance."""
        return self.table_modes if self.table_modes.shape[1] else np.zeros((0, 0))

    def _curve(self, y: Array) -> Component:
        x = np.linspace(0, 1, len(y))
        return Component.model_construct(
            label=LABEL, interval=self.interval, x=tuple(map(float, x)), y=tuple(map(float, y))
        )

    def _effect(self, table: Array, gain: float, time: float) -> LearnedForce:
        """The table with its memory."""
        size = np.maximum(table.reshape(len(self._rows), -1), 0.0)
        signed = np.sign(self.speeds) * size
        half = len(SPEEDS)
        y = np.insert(signed, half, 0.0, axis=1)
        return LearnedForce.model_construct(
            memory=self.terms.memory,
            time=time,
            gain=gain,
            interval=self.interval,
            positions=tuple(map(float, self._rows)),
            velocities=tuple(map(float, np.insert(self.speeds, half, 0.0))),
            y=tuple(tuple(map(float, row + 0.0)) for row in y),
        )


def _with(profile: Profile, channel: str, component: Component) -> Profile:
    """The profile with one more component, unchecked."""
    old = getattr(profile.channels, channel)
    new = old.model_copy(update={"components": (*old.components, component)})
    channels = profile.channels.model_copy(update={channel: new})
    return profile.model_copy(update={"channels": channels})
