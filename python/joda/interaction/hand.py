"""A virtual hand: it moves a bounded, rate-limited target, and PD control makes the force to it.

The paper's "virtual-hand interaction". Where a latch lets go, the joint runs ahead of the hand as
far as the hand's softness allows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from joda.scenes.engine import inertia_at
from joda.scenes.motion import Motion, applied, play

SET_OUT = 0.3
"""Time constant (s) with which a hand reaches its speed."""

FIRMEST = 0.05
"""Largest stiffness of a hand, in units of inertia per timestep squared: it acts explicitly."""

NEAR = 0.005
"""A hand is there when the joint is, but for this share of the way."""

PATIENCE = 0.5
"""How long (s) a hand goes on that pulls with all its strength in vain."""

IMPATIENCE = 3.0
"""Within so long (s) a hand comes to its full strength if it has taken twice the usual time."""

LONGEST = 10.0
"""A hand gives up after so many times what the way would take at its speed, and 10 s."""


@dataclass(frozen=True)
class Grip:
    """What a hand is like.

    Attributes:
        speed: of its target, rad/s or m/s.
        strength: its largest force, N·m or N.
        stiffness: N·m/rad or N/m; at most what the timestep allows is used.
        pause: how long (s) it holds the joint still wherever it has brought it.
    """

    speed: float
    strength: float
    stiffness: float
    pause: float = 0.0


def finest(inertia: float, stiffness: float) -> float:
    """The largest timestep (s) in which a hand of that stiffness can act on that inertia."""
    return float(np.sqrt(FIRMEST * inertia / stiffness))


class Hand:
    """A hand that takes a joint to one position after the other; acts on a scene, see `play`.

    The target sets out gently and moves at the hand's speed, faster once it has taken twice the
    time that the way takes, until the joint has arrived, or the hand's strength is exhausted; it
    never goes further beyond the range than the strength reaches.
    """

    def __init__(self, model: mujoco.MjModel, joint: int, to: Sequence[float], grip: Grip) -> None:
        """Args: the compiled scene; the joint's id; positions, rad or m; what the hand is like."""
        self._model, self._grip = model, grip
        self._qpos, self._dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        self._range: tuple[float, float] = tuple(model.jnt_range[joint].tolist())
        self._left = list(to)
        self._stage: _Going | _Resting | None = None
        self._target = 0.0

    def __call__(self, data: mujoco.MjData) -> bool:
        """Sets the joint's applied force; False when the hand has been everywhere."""
        now, position = data.time, float(data.qpos[self._qpos])
        if self._stage is None:
            self._take_hold(data)
            self._target = position
            self._set_out(now, position)
        if isinstance(self._stage, _Resting) and now >= self._stage.until:
            if not self._left:
                return False
            self._set_out(now, position)
        force = self._pull(now, position, float(data.qvel[self._dof]))
        data.qfrc_applied[self._dof] = force
        if isinstance(self._stage, _Going) and self._stage.over(now, position, force):
            if self._grip.pause:
                self._stage = self._stage.rest(now, self._target)
            elif self._left:
                self._set_out(now, position)
            else:
                return False
        return True

    def _take_hold(self, data: mujoco.MjData) -> None:
        """Stiffness and (critical) damping for the inertia that the joint begins with."""
        model, grip = self._model, self._grip
        mujoco.mj_forward(model, data)
        inertia = inertia_at(model, data, self._dof)
        self._stiffness = min(grip.stiffness, FIRMEST * inertia / model.opt.timestep**2)
        self._damping = 2 * math.sqrt(self._stiffness * inertia)
        self._reach = grip.strength / self._stiffness
        self._bounds = self._range[0] - self._reach, self._range[1] + self._reach

    def _set_out(self, now: float, position: float) -> None:
        """For the next position."""
        to = self._left.pop(0)
        self._stage = _Going(now, self._target, position, to, self._grip, self._reach)

    def _pull(self, now: float, position: float, velocity: float) -> float:
        """The force towards the target, which goes on."""
        assert self._stage is not None
        self._target, speed = self._stage.target(now)
        low, high = self._bounds
        bounded = min(max(self._target, low), high)
        if bounded != self._target:
            self._target, speed = bounded, 0.0
        wanted: float = self._stiffness * (self._target - position)
        wanted += self._damping * (speed - velocity)
        return min(max(wanted, -self._grip.strength), self._grip.strength)


@dataclass
class _Resting:
    """Holding the joint still; a target that the joint has overtaken follows it."""

    since: float
    until: float
    behind: float
    to: float
    speed: float

    def target(self, now: float) -> tuple[float, float]:
        """The target and its speed."""
        left = self.to - self.behind
        gone = self.speed * (now - self.since)
        return self.behind + float(np.clip(left, -gone, gone)), 0.0


class _Going:
    """On the way to a position."""

    def __init__(
        self, now: float, target: float, position: float, to: float, grip: Grip, reach: float
    ) -> None:
        self._since, self._from, self._to = now, target, to
        self._way, self._sign = abs(to - position), float(np.sign(to - position))
        self._pace = self._sign * grip.speed
        self._hurry = self._sign * reach / IMPATIENCE
        self._grip = grip
        self._usual = 2 * self._way / grip.speed
        self._longest = LONGEST * self._way / grip.speed + 10.0
        self._least = self._way
        self._spent = 0.0
        self._last = now

    def target(self, now: float) -> tuple[float, float]:
        """The target and its speed."""
        time = now - self._since
        speed = self._pace * (1 - math.exp(-time / SET_OUT))
        target = self._from + self._pace * time - SET_OUT * speed
        late = time - self._usual
        return (target + self._hurry * late, speed + self._hurry) if late > 0 else (target, speed)

    def rest(self, now: float, target: float) -> _Resting:
        """What comes after it."""
        to = self._to if self._sign * (self._to - target) > 0 else target
        return _Resting(now, now + self._grip.pause, target, to, self._grip.speed)

    def over(self, now: float, position: float, force: float) -> bool:
        """Whether the joint has arrived, or the hand gives up."""
        left = self._sign * (self._to - position)
        exhausted = self._sign * force >= self._grip.strength
        if left < self._least - NEAR * self._way:
            self._least, exhausted = left, False
        self._spent = self._spent + now - self._last if exhausted else 0.0
        self._last = now
        return (
            left <= NEAR * self._way or self._spent >= PATIENCE or now - self._since > self._longest
        )


def pull(
    model: mujoco.MjModel,
    joint: int,
    start: float,
    end: float,
    strength: float,
    stiffness: float,
    duration: float = 3.0,
) -> Motion:
    """A hand moves the joint slowly from rest at `start` to `end`, others at home.

    Args:
        model: the compiled scene.
        joint: its id.
        start, end: rad or m.
        strength: the hand's largest force, N·m or N.
        stiffness: of the hand, N·m/rad or N/m.
        duration: in which the target goes from start to end, s. It then goes on until the hand's
            strength is exhausted or the joint has arrived.

    Returns:
        the motion until then; its force is the hand's alone.
    """
    grip = Grip(abs(end - start) / duration, strength, stiffness)
    hand = Hand(model, joint, (end,), grip)
    return play(model, joint, start, hand, felt=applied)
