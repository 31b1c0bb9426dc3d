"""Where to begin a fit of a force over position: with what balances the recorded forces.

A model that lacks a force which holds what pushes the joint is carried off within a segment: from
there no fit finds the way. The inverse dynamics of the measured motion (Armstrong, Khatib and
Burdick, ICRA 1986) need no simulation: what is left of inertia times acceleration by the recorded
force and the model's own is what an effect must exert.
"""

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.hypotheses import Hypothesis
from joda.estimation.segments import Segments
from joda.field import evaluate
from joda.joints.joint_model import JointModel
from joda.joints.resistance import friction_bounds
from joda.measured.quasi_static import exerted
from joda.profile import Profile

Array = NDArray[np.float64]

TAKEN = 2
"""How many trials are begun with."""


def balanced(
    segments: Segments, profile: Profile, joint_model: JointModel, hypothesis: Hypothesis
) -> list[Array]:
    """The hypothesis' numbers from which to begin, the best first: trials of another strength.

    Args:
        segments: of runs whose force is recorded.
        profile, joint_model: the model as it is.
        hypothesis: none but one that exerts a force over position is balanced.

    Returns:
        shape (k,) each; empty if nothing tells.
    """
    s, missing, q = _missing(segments, profile, joint_model)
    found = []
    for trial in hypothesis.trials if len(s) else ():
        force = exerted(hypothesis.write(profile, trial), s, q)
        force = force - exerted(profile, s, q)
        square = float(force @ force)
        if not square:
            continue
        times = float(force @ missing) / square
        if times <= 0:
            continue
        x = trial.copy()
        low, high = hypothesis.unknowns.low[0], hypothesis.unknowns.high[0]
        x[0] = np.clip(times * trial[0], low, high)
        found.append((float(np.abs(missing - times * force).mean()), x))
    found.sort(key=lambda one: one[0])
    return [x for _, x in found[:TAKEN]]


def _missing(
    segments: Segments, profile: Profile, joint_model: JointModel
) -> tuple[Array, Array, Array]:
    """Normalised position, force that the model lacks there, and position, from each segment to the
    next of its run; shape (n,) each."""
    at, (q, v) = segments.at, segments.start.T
    pairs = np.flatnonzero(~segments.fresh[1:] & ~segments.impacts[1:] & ~segments.rests[1:])
    total = np.append(0.0, np.cumsum(segments.force))
    steps = at[pairs + 1] - at[pairs]
    pushed = (total[at[pairs + 1]] - total[at[pairs]]) / steps
    acceleration = (v[pairs + 1] - v[pairs]) / (steps * segments.h)
    q, v = (q[pairs] + q[pairs + 1]) / 2, (v[pairs] + v[pairs + 1]) / 2
    lo, hi = profile.joint.range
    s = np.clip((q - lo) / (hi - lo), 0.0, 1.0)
    up, down = friction_bounds(profile, s)
    resisted = np.where(v > 0, up, -down) + evaluate(profile.channels.damping, s)[0] * v
    if joint_model.servo is not None and segments.command is not None:
        total = np.append(0.0, np.cumsum(segments.command))
        command = (total[at[pairs + 1]] - total[at[pairs]]) / steps
        pushed = pushed + joint_model.servo.force(command, q, v)
    known = pushed + joint_model.weight_at(q) + exerted(profile, s, q) - resisted
    return s, joint_model.inertia * acceleration - known, q
