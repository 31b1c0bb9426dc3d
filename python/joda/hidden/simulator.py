"""Motions of a joint with hidden laws, many at a time, with exact sticking and slipping.

Explicit midpoint steps of second order. Where the velocity would change its sign within a step the
joint stops there: it then stays while the net force is within friction, and breaks away in the
direction of the net force. Ends are rigid, with a coefficient of restitution.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from joda.hidden.laws import Array, Force, Friction, Law, State
from joda.hidden.truth import RESTITUTION, Bounce, Bristle, Delay, Inertia, Play, Truth

Flags = NDArray[np.bool_]


class Push(Protocol):
    """What pushes the joint, or its handle."""

    def at(self, k: int, q: Array, v: Array) -> Array:
        """Force at step k, N·m or N, shape (lanes,)."""


@dataclass(frozen=True)
class Tape:
    """A push that is known beforehand; force has shape (steps + 1, lanes)."""

    force: Array

    def at(self, k: int, q: Array, v: Array) -> Array:
        """See Push."""
        return np.asarray(self.force[k])


@dataclass(frozen=True)
class Trace:
    """Simulated motions; arrays of shape (steps + 1, lanes).

    Attributes:
        position: rad or m.
        velocity: rad/s or m/s.
        force: pushed with, N·m or N.
    """

    position: Array
    velocity: Array
    force: Array


def simulate(
    truth: Truth, push: Push, q: Array, v: Array, steps: int, h: float, clock: Array | None = None
) -> Trace:
    """Simulates motions side by side.

    Args:
        truth: the joint.
        push: what acts on it.
        q, v: position and velocity at the beginning, shape (lanes,).
        steps: how many.
        h: length of a step, s.
        clock: time at the beginning, s, shape (lanes,); 0 if None.

    Returns:
        the motions.
    """
    q, v = np.array(q, dtype=np.float64), np.array(v, dtype=np.float64)
    trace = Trace(*(np.empty((steps + 1, len(q))) for _ in range(3)))
    stepper = _Stepper(truth, q, h)
    handle = _Handle(truth, q, v, h)
    late = round(sum(law.time for law in truth.hidden if isinstance(law, Delay)) / h)
    time = np.zeros_like(q) if clock is None else clock
    before: Array | None = None
    for k in range(steps + 1):
        applied = push.at(k, q + handle.offset, handle.velocity if handle.loose else v)
        trace.position[k], trace.velocity[k], trace.force[k] = q, v, applied
        if late:
            applied = trace.force[max(k - late, 0)]
        half = applied if before is None else 1.5 * applied - 0.5 * before
        before = applied
        if handle.loose:
            old = q, v
            q, v = stepper.step(
                q, v, handle.passes(applied), handle.passes(half), time + k * h, handle.mobility
            )
            v = handle.step(old, (q, v), half)
        else:
            q, v = stepper.step(q, v, applied, half, time + k * h, stepper.mobility)
    return trace


def inertia(truth: Truth) -> float:
    """True inertia, kg·m² or kg, without a handle."""
    more = sum(law.size for law in truth.hidden if isinstance(law, Inertia))
    return truth.joint.inertia + more


class _Stepper:
    """Steps of the joint itself.

    Attributes:
        mobility: 1 / inertia.
    """

    def __init__(self, truth: Truth, q: Array, h: float) -> None:
        joint, hidden = truth.joint, truth.hidden
        self.joint, self.damping, self.h = joint, truth.damping, h
        self.scale = 1 / joint.span
        self.mobility: Array | float = 1 / inertia(truth)
        self.forces = [law for law in hidden if isinstance(law, Force)]
        self.frictions = [law for law in hidden if isinstance(law, Friction)]
        self.states = [law for law in hidden if isinstance(law, State)]
        self.z = [law.start((q - joint.lo) * self.scale) for law in self.states]
        bristles = any(isinstance(law, Bristle) for law in hidden)
        self.friction = np.full_like(q, 0.0 if bristles else truth.friction)
        self.restitution = _restitution(hidden)

    def step(
        self, q: Array, v: Array, now: Array, half: Array, t: Array, mobility: Array | float
    ) -> tuple[Array, Array]:
        """Position and velocity after a step; `now` and `half` are the pushes at 0 and h / 2."""
        h = self.h
        sign = np.sign(v)
        net, load, s = self._net(q, v, self.z, now, t)
        still = sign == 0
        resting = bool(np.count_nonzero(still))
        if resting:
            sign = np.where(still, np.sign(net), sign)
        limit = self._limit(s, v, sign, load, t, self.z)
        a = (net - sign * limit) * mobility
        if resting:
            still &= (np.abs(net) <= limit) | self._leans(q, net)
            a = np.where(still, 0.0, a)
        v_half = v + (0.5 * h) * a
        z = [law.advance(x, s, v, 0.5 * h) for law, x in zip(self.states, self.z, strict=True)]
        q_half = q + (0.5 * h) * v
        net, load, s = self._net(q_half, v_half, z, half, t + 0.5 * h)
        limit = self._limit(s, v_half, sign, load, t + 0.5 * h, z)
        a = (net - sign * limit) * mobility
        v_end, q_end = v + h * a, q + h * v_half
        self.z = [law.advance(x, s, v_half, h) for law, x in zip(self.states, self.z, strict=True)]
        if resting:
            v_end, q_end = np.where(still, 0.0, v_end), np.where(still, q, q_end)
        back = v_end * sign < 0
        if np.count_nonzero(back):
            limit = self._limit(s, np.zeros_like(v), -sign, load, t, z)
            again = np.minimum(sign * net + limit, 0.0) * sign * mobility
            part = h * v / np.where(back, v - v_end, 1.0)
            left = h - part
            q_end = np.where(back, q + 0.5 * (v * part + again * left * left), q_end)
            v_end = np.where(back, again * left, v_end)
        return self._ends(q_end, v_end, a)

    def _net(
        self, q: Array, v: Array, z: list[Array], push: Array, t: Array
    ) -> tuple[Array, Array, Array]:
        """All forces but dry friction; load; normalised position."""
        s = (q - self.joint.lo) * self.scale
        load = push
        if self.joint.kind == "slide":
            load = push + self.joint.gravity_cos
        elif self.joint.gravity_cos or self.joint.gravity_sin:
            load = push + self.joint.gravity_cos * np.cos(q) + self.joint.gravity_sin * np.sin(q)
        net = load - self.damping * v
        for force in self.forces:
            net = net + force.force(s, q, v, t)
        for law, x in zip(self.states, z, strict=True):
            net = net + law.force(x, s, v)
        return net, load, s

    def _limit(
        self, s: Array, v: Array, sign: Array, load: Array, t: Array, z: list[Array]
    ) -> Array:
        limit = self.friction
        for law in self.frictions:
            limit = limit + law.limit(s, v, sign, load, t)
        for state, x in zip(self.states, z, strict=True):
            limit = limit + state.limit(x)
        return limit

    def _leans(self, q: Array, net: Array) -> Flags:
        """Whether an end holds the joint."""
        low, high = (q <= self.joint.lo) & (net <= 0), (q >= self.joint.hi) & (net >= 0)
        return np.asarray(low | high)

    def _ends(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Throws back what has gone through an end; what would only rattle there is stopped."""
        inside = np.minimum(np.maximum(q, self.joint.lo), self.joint.hi)
        out = inside != q
        if not np.count_nonzero(out):
            return q, v
        e = self.restitution
        rattle = e * np.abs(v) < 4 * self.h * np.abs(a)
        thrown = np.where(rattle, inside, inside + e * (inside - q))
        return np.where(out, thrown, q), np.where(out, np.where(rattle, 0.0, -e * v), v)


class _Handle:
    """A handle with play.

    Attributes:
        loose: whether there is one.
        offset: of the handle from the joint, rad or m.
        velocity: of the handle.
        side: at which it touches the part: 1 pushes it up, -1 down, 0 is free.
    """

    def __init__(self, truth: Truth, q: Array, v: Array, h: float) -> None:
        plays = [law for law in truth.hidden if isinstance(law, Play)]
        self.loose = bool(plays)
        self.h = h
        self.reach = 0.5 * plays[0].width if plays else 0.0
        self.inertia = plays[0].inertia if plays else 0.0
        self.part = inertia(truth)
        self.offset, self.velocity, self.side = np.zeros_like(q), v.copy(), np.zeros_like(q)

    @property
    def mobility(self) -> Array:
        """1 / inertia of the part, with the handle where it touches."""
        return np.asarray(1 / (self.part + self.inertia * (self.side != 0)))

    def passes(self, push: Array) -> Array:
        """The push that acts on the part."""
        return np.asarray(push * (self.side != 0))

    def step(self, old: tuple[Array, Array], new: tuple[Array, Array], push: Array) -> Array:
        """Moves the handle by a step, and returns the part's velocity after knocks.

        Args:
            old, new: position and velocity of the part before and after the step.
            push: on the handle.
        """
        h, touches = self.h, self.side != 0
        v = new[1]
        contact = push - self.inertia * (v - old[1]) / h
        speed = np.where(touches, v, self.velocity + h * push / self.inertia)
        self.side = np.where(contact * self.side < 0, 0.0, self.side)
        offset = self.offset + 0.5 * h * (self.velocity + speed) - (new[0] - old[0])
        offset = np.where(touches, self.offset, offset)
        self.offset = np.minimum(np.maximum(offset, -self.reach), self.reach)
        side = np.sign(offset)
        knocks = ~touches & (self.offset != offset) & ((speed - v) * side > 0)
        if np.count_nonzero(knocks):
            common = (self.part * v + self.inertia * speed) / (self.part + self.inertia)
            self.side = np.where(knocks, side, self.side)
            v, speed = np.where(knocks, common, v), np.where(knocks, common, speed)
        self.velocity = speed
        return v


def _restitution(hidden: tuple[Law, ...]) -> float:
    found = [law.restitution for law in hidden if isinstance(law, Bounce)]
    return found[0] if found else RESTITUTION
