"""A joint's own units of force, speed and place, from its measured motion."""

import numpy as np

from joda.effects.guesses import Units
from joda.estimation.segments import Segments
from joda.measured.measured_joint import Measured

SLOWEST = 0.02
"""Least speed that counts as a usual one, in ranges in the time of the longest run."""
AT_END = 0.02
"""Of the range: what was measured as near to its end goes to the end."""


def units_of(segments: Segments, measured: Measured) -> Units:
    """The joint's own units, from the measured motion."""
    profile, inertia = measured.profile, measured.joint_model.inertia
    velocity = segments.start[:, 1]
    same = ~segments.fresh[1:]
    pace = np.diff(segments.at)[same] * segments.h
    acceleration = np.diff(velocity)[same] / pace
    longest = max((float(np.ptp(run.time)) for run in measured.runs), default=np.inf)
    slowest = SLOWEST * float(np.ptp(profile.joint.range)) / longest
    speed = max(float(np.sqrt(np.mean(velocity**2))), slowest)
    exerted = [float(np.mean(measured.exerted(run) ** 2)) for run in measured.runs]
    pushed = float(np.sqrt(np.mean(segments.force**2) + max(exerted, default=0.0)))
    force = max(pushed, inertia * float(np.sqrt(np.mean(acceleration**2))) if len(pace) else 0.0)
    friction = max((max(c.y) for c in profile.channels.friction.components), default=0.0)
    return Units(
        force=force or inertia,
        speed=speed or 1.0,
        inertia=inertia,
        span=float(np.ptp(profile.joint.range)),
        visited=_visited(segments, measured),
        friction=friction,
        forced=measured.pushed,
        weight=max(map(abs, measured.context.gravity_force)),
        hinge=measured.joint_model.hinge,
    )


def _visited(segments: Segments, measured: Measured) -> tuple[float, float]:
    """Part of the range that was measured in segments that count: where an impact is, none does."""
    lo, hi = measured.profile.joint.range
    if measured.runs:
        rows = segments.rows[segments.usable]
        positions = segments.position[rows[rows >= 0]]
    else:
        positions = np.concatenate([gauged.curve.position for gauged in measured.curves])
    if not len(positions):
        return 0.0, 1.0
    s = (positions - lo) / (hi - lo)
    first, last = float(s.min()), float(s.max())
    first, last = first if first > AT_END else 0.0, last if last < 1 - AT_END else 1.0
    return (first, last) if last - first > AT_END else (0.0, 1.0)
