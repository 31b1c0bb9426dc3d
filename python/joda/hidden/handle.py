"""A handle with play, through which the joint is pushed."""

import numpy as np

from joda.hidden.laws import Array
from joda.hidden.truth import Play, Truth


class Handle:
    """A handle with play.

    Attributes:
        loose: whether there is one.
        offset: of the handle from the joint, rad or m.
        velocity: of the handle.
        side: at which it touches the part: 1 pushes it up, -1 down, 0 is free.
    """

    def __init__(self, truth: Truth, q: Array, v: Array, h: float) -> None:
        """Takes the joint, its position and velocity, and the length of a step, s."""
        plays = [law for law in truth.hidden if isinstance(law, Play)]
        self.loose = bool(plays)
        self.h = h
        self.reach = 0.5 * plays[0].width if plays else 0.0
        self.inertia = plays[0].inertia if plays else 0.0
        self.part = truth.inertia
        self.offset, self.velocity, self.side = np.zeros_like(q), v.copy(), np.zeros_like(q)

    @property
    def mobility(self) -> Array:
        """1 / inertia of the part, with the handle where it touches."""
        return np.asarray(1 / (self.part + self.inertia * (self.side != 0)))

    def passes(self, push: Array) -> Array:
        """The push that acts on the part."""
        return np.asarray(push * (self.side != 0))

    def step(self, old: tuple[Array, Array], new: tuple[Array, Array], push: Array) -> Array:
        """Moves the handle by a step, and returns the part's velocity after impacts.

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
        impacts = ~touches & (self.offset != offset) & ((speed - v) * side > 0)
        if np.count_nonzero(impacts):
            common = (self.part * v + self.inertia * speed) / (self.part + self.inertia)
            self.side = np.where(impacts, side, self.side)
            v, speed = np.where(impacts, common, v), np.where(impacts, common, speed)
        self.velocity = speed
        return v
