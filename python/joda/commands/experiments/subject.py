"""A joint in its scene, ready for a case: with its profile, or with a baseline's elements."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from joda.interaction.hand import Grip, Hand, finest
from joda.interaction.pulling import FIRMNESS, SLOW, grip
from joda.interaction.robot import AFTER, read_targets
from joda.interaction.traces import shown
from joda.scenes.context import Context
from joda.scenes.model import find_joint
from joda.scenes.motion import Motion, leaning, play

SAMPLING = 0.02
"""Time between samples of a joint that was let go, s."""


@dataclass(frozen=True)
class Subject:
    """A joint that a case is tried on.

    Attributes:
        context: the joint; all positions `s` are shares of its range, 0 to 1.
        model: the compiled scene.
    """

    context: Context
    model: mujoco.MjModel

    @property
    def joint(self) -> int:
        """Its id."""
        return find_joint(self.model, self.context.joint.name)

    @property
    def span(self) -> float:
        """Of its range, rad or m."""
        return float(np.ptp(self.context.joint.range))

    def at(self, s: float) -> float:
        """The position, rad or m."""
        lo, hi = self.context.joint.range
        return lo + s * (hi - lo)

    def share(self, motion: Motion) -> np.ndarray:
        """The normalised positions of a motion."""
        lo, hi = self.context.joint.range
        return (motion.position - lo) / (hi - lo)

    def shown(self, s: float) -> float:
        """A difference of normalised positions in degrees, mm or m (`interaction.traces.shown`)."""
        return s * self.span * shown(self.context.joint)[0]

    def let_go(self, s: float, seconds: float, sampling: float = SAMPLING) -> Motion:
        """Let go at rest; `sampling` is the time between samples, s."""
        stride = max(round(sampling / self.model.opt.timestep), 1)
        return play(self.model, self.joint, self.at(s), duration=seconds, stride=stride)

    def take(
        self, start: float, to: Sequence[float], pause: float = 0.0, seconds: float = SLOW
    ) -> Motion:
        """A hand, that needs `seconds` for the range, takes it from one place to the others."""
        held = Grip(
            self.span / seconds, grip(self.context), FIRMNESS * self.context.lever_arm**2, pause
        )
        model = copy(self.model)
        fine = finest(self.context.equivalent_inertia, held.stiffness)
        model.opt.timestep = min(model.opt.timestep, fine)
        hand = Hand(model, self.joint, [self.at(s) for s in to], held)
        return play(model, self.joint, leaning(model, self.joint, self.at(start)), hand)

    def send(self, robot: str, start: float) -> Motion:
        """A robot goes through the targets of a file, the joint beginning at a position, rad."""
        targets = read_targets(robot, self.model)
        duration = float(targets.time[-1]) + AFTER
        return play(self.model, self.joint, start, targets, duration)
