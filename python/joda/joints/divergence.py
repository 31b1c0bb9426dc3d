"""How fast a joint runs away from where its force pushes it on."""

import numpy as np
from numpy.typing import NDArray

from joda.field.reference import evaluate
from joda.joints.joint_model import JointModel
from joda.profile import Profile

Array = NDArray[np.float64]

AT_END = 0.01
"""How near an end of the range, in ranges, the stop holds a joint."""
GROWN = 0.03
"""Part of the range to which an error of a position, its noise, may grow in a segment: so far the
slopes hold by which a fit goes."""


def divergence_rate(profile: Profile, joint_model: JointModel, position: Array) -> Array:
    """How fast two motions of a joint diverge at positions, 1/s, shape (n,); 0 where they do not.

    The larger root of I r² + c r = k, with the inertia I, the damping c, and k by which the
    force towards larger positions grows with the position (Lyapunov's indirect method).
    """
    lo, hi = profile.joint.range
    s = (position - lo) / (hi - lo)
    k = evaluate(profile.channels.conservative, s)[1] / (hi - lo)
    k = k + joint_model.weight_slope(position)
    if joint_model.servo is not None:
        k = k - joint_model.servo.stiffness
    k = np.where(np.abs(s - 0.5) < 0.5 - AT_END, np.maximum(k, 0.0), 0.0)
    c, inertia = evaluate(profile.channels.damping, s)[0], joint_model.inertia
    return np.asarray((np.sqrt(c**2 + 4 * inertia * k) - c) / (2 * inertia))


def bearable(span: float, sigma: float) -> float:
    """Logarithm of the factor by which an error of the noise may grow.

    Args:
        span: of the joint's range, rad or m.
        sigma: the noise, in the same unit.
    """
    return float(np.log(max(GROWN * span / sigma, 2.0)))
