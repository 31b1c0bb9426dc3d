"""How errors of a joint's motion go on: how fast it runs away where its force pushes it on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda.field import evaluate
from joda.joints.joint_model import JointModel
from joda.profile import Profile

Array = NDArray[np.float64]

AT_END = 0.01
"""How near an end of the range, in ranges, the stop holds a joint."""
GROWN = 0.03
"""Part of the range to which an error of a position, its noise, may grow in a segment: so far the
slopes hold by which a fit goes."""


@dataclass(frozen=True)
class Linearized:
    """How errors of a joint's motion go on from positions, x'' = push x - drag x'.

    Attributes:
        push: 1/s², what drives them on is positive; shape (n,).
        drag: 1/s, shape (n,).
    """

    push: Array
    drag: Array

    @property
    def acts(self) -> NDArray[np.bool_]:
        """Where anything but its inertia moves the joint, shape (n,)."""
        return np.asarray((self.push != 0) | (self.drag != 0))

    @property
    def rate(self) -> Array:
        """How fast they grow, 1/s, shape (n,), the larger root of r² + drag r = push (Lyapunov's
        indirect method); 0 where they do not."""
        growing = np.maximum(self.push, 0.0)
        return np.asarray((np.sqrt(self.drag**2 + 4 * growing) - self.drag) / 2)


def undisturbed(position: Array) -> Linearized:
    """Of what nothing but its inertia moves."""
    return Linearized(np.zeros(len(position)), np.zeros(len(position)))


def linearized(profile: Profile, joint_model: JointModel, position: Array) -> Linearized:
    """Of a joint at positions, rad or m, shape (n,); at an end of its range the stop holds it."""
    lo, hi = profile.joint.range
    s, inertia = (position - lo) / (hi - lo), joint_model.inertia
    k = evaluate(profile.channels.conservative, s)[1] / (hi - lo)
    k = k + joint_model.weight_slope(position)
    c = evaluate(profile.channels.damping, s)[0]
    if joint_model.servo is not None:
        k, c = k - joint_model.servo.stiffness, c + joint_model.servo.damping
    k = np.where(np.abs(s - 0.5) < 0.5 - AT_END, k, 0.0)
    return Linearized(np.asarray(k / inertia), np.asarray(c / inertia))


def bearable(span: float, sigma: float) -> float:
    """Logarithm of the factor by which an error of the noise may grow.

    Args:
        span: of the joint's range, rad or m.
        sigma: the noise, in the same unit.
    """
    return float(np.log(max(GROWN * span / sigma, 2.0)))
