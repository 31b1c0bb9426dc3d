"""Motions of a joint with hidden laws, many at a time, with exact sticking and slipping.

Explicit midpoint steps of second order. Where the velocity would change its sign within a step the
joint stops there: it then stays while the net force is within friction, and breaks away in the
direction of the net force. Ends are rigid, with a coefficient of restitution, or have stops that
give way.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from joda.hidden.handle import Handle
from joda.hidden.laws import Array, Force, Friction, Law, State
from joda.hidden.masses import Behind, Linkage
from joda.hidden.truth import RESTITUTION, Bounce, Delay, Presliding, Truth

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
    stepper = _Stepper(truth, q, v, h)
    handle = Handle(truth, q, v, h)
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


class _Stepper:
    """Steps of the joint itself.

    Attributes:
        mobility: 1 / inertia.
    """

    def __init__(self, truth: Truth, q: Array, v: Array, h: float) -> None:
        joint, hidden = truth.joint, truth.hidden
        self.joint, self.damping, self.h = joint, truth.damping, h
        self.scale = 1 / joint.span
        self.mobility: Array | float = 1 / truth.inertia
        self.forces = [law for law in hidden if isinstance(law, Force)]
        self.frictions = [law for law in hidden if isinstance(law, Friction)]
        self.states = [law for law in hidden if isinstance(law, State)]
        self.linkages = [law for law in hidden if isinstance(law, Linkage)]
        self.z = [law.start((q - joint.lo) * self.scale, v) for law in self.states]
        bristles = any(isinstance(law, Presliding) for law in hidden)
        behind = [law for law in hidden if isinstance(law, Behind)]
        dry = truth.friction - sum(law.friction for law in behind)
        self.damping -= sum(law.damping for law in behind)
        self.friction = np.full_like(q, 0.0 if bristles else dry)
        self.restitution = _restitution(hidden)
        self.stops = truth.ends
        self.stiffness, self.rest = truth.spring

    def step(
        self, q: Array, v: Array, now: Array, half: Array, t: Array, mobility: Array | float
    ) -> tuple[Array, Array]:
        """Position and velocity after a step; `now` and `half` are the pushes at 0 and h / 2."""
        h = self.h
        sign = np.sign(v)
        net, load, s = self._net(q, v, self.z, now, t)
        joint_mobility = mobility
        mobility = self._linked(s, joint_mobility)
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
        mobility = self._linked(s, joint_mobility)
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
        return (q_end, v_end) if self.stops else self._ends(q_end, v_end, a)

    def _linked(self, s: Array, mobility: Array | float) -> Array | float:
        """1 / inertia, where the joint's is this, with what moves along by a linkage."""
        if not self.linkages:
            return mobility
        return np.asarray(1 / (1 / mobility + sum(law.inertia(s) for law in self.linkages)))

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
        if self.stiffness:
            net = net - self.stiffness * (q - self.rest)
        if self.stops:
            net = net + self._stopping(q, v)
        for force in self.forces:
            net = net + force.force(s, q, v, t)
        for law, x in zip(self.states, z, strict=True):
            net = net + law.force(x, s, v)
        return net, load, s

    def _stopping(self, q: Array, v: Array) -> Array:
        """Force of the stops."""
        (low, high), under, over = self.stops, self.joint.lo - q, q - self.joint.hi
        force = np.zeros_like(q)
        if np.count_nonzero(pressed := under > 0):
            force = np.where(pressed, low.push(np.maximum(under, 0.0), -v), force)
        if np.count_nonzero(pressed := over > 0):
            force = np.where(pressed, -high.push(np.maximum(over, 0.0), v), force)
        return force

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
        """Whether a rigid end holds the joint."""
        if self.stops:
            return np.zeros(q.shape, dtype=np.bool_)
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


def _restitution(hidden: tuple[Law, ...]) -> float:
    found = [law.restitution for law in hidden if isinstance(law, Bounce)]
    return found[0] if found else RESTITUTION
