"""What a measurement has wrong: the force's scale, offset and delay, the encoder's zero."""

from dataclasses import dataclass, replace

import numpy as np

from joda.measured.runs import QuasiStatic, Run
from joda.scenes.actuators import Servo


@dataclass(frozen=True)
class Sensing:
    """What is true of what is logged: force(t + delay) = scale logged(t) + offset, and the position
    is the logged one less the zero.

    Attributes:
        force_scale: true force over logged force.
        force_offset: N·m or N.
        time_delay: what is logged as force acts that much later, s.
        position_offset: logged position minus true, rad or m.
        actuator_gain: of the actuators, the right one over the model's.
    """

    force_scale: float = 1.0
    force_offset: float = 0.0
    time_delay: float = 0.0
    position_offset: float = 0.0
    actuator_gain: float = 1.0

    def of_curve(self, curve: QuasiStatic) -> QuasiStatic:
        """A curve as it would be if nothing of it were wrong."""
        force = self.force_scale * curve.force + self.force_offset
        return replace(curve, position=curve.position - self.position_offset, force=force)

    def driving(self, servo: Servo | None) -> Servo | None:
        """What actuators make of the commands that were logged."""
        if servo is None:
            return None
        return servo.changed(self.actuator_gain, 1.0, max(servo.delay + self.time_delay, 0.0))

    def of(self, run: Run, whole: bool = False) -> Run:
        """A run as it would be if nothing of it were wrong.

        Where the log does not say yet, or no more, which force acts, it has no samples, unless it
        must stay `whole`: then the force there is the nearest one that is known.
        """
        position = run.position - self.position_offset
        if not run.forced:
            return replace(run, position=position)
        at, late = run.time - self.time_delay, self.time_delay
        logged = np.interp(at, run.time, run.force)  # beside a gap it is unknown too
        force_std = None if run.force_std is None else abs(self.force_scale) * run.force_std
        force = self.force_scale * logged + self.force_offset
        right = replace(run, position=position, force=force, force_std=force_std)
        if whole or not late:
            return right
        inside = (at >= run.time[0]) & (at <= run.time[-1])
        return replace(right.part(np.flatnonzero(inside)), cut=not inside[0])


RIGHT = Sensing()
"""Of a measurement of which nothing is wrong."""
