"""Runs so slow that they are quasi-static curves.

A push that goes one way, once and slowly, tells force over position and nothing else: what moves
the joint is then a small difference of the pushing and the resisting force, and the least error of
either moves a simulated joint elsewhere.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from joda.joints.resistance import damping
from joda.measured import smoothing
from joda.measured.runs import QuasiStatic, Run
from joda.profile import Profile

Array = NDArray[np.float64]

ONE_WAY = 0.97
"""Part of the way, in one direction, from which the joint counts as moved in that one only."""
SLOW = 0.1
"""Part of the force that inertia and the model's damping may take."""
TRAVEL = 0.1
"""Least part of the range that is visited."""
ASTRAY = 0.1
"""From which RMS error on, in units of the range, the simulated joint goes elsewhere."""
PACE, LEAST = 0.1, 10
"""Time between velocities that tell the acceleration, s; fewest of them."""


def ways(position: Array, noise: float) -> Array:
    """Ways in positive and in negative direction, rad or m, shape (2,).

    Args:
        position: rad or m, shape (n,).
        noise: what is within it is no way.
    """
    forth = back = 0.0
    at = position[0]
    for q in position[1:]:
        if abs(q - at) > noise:
            forth, back = forth + max(q - at, 0.0), back + max(at - q, 0.0)
            at = q
    return np.array([forth, back])


def one_way(ways: Array) -> bool:
    """Whether nearly all of the way is in one direction."""
    return bool(ways.max() > ONE_WAY * ways.sum())


def as_curve(
    run: Run, sigma: float, profile: Profile, inertia: float, replay: Callable[[Run, float], Array]
) -> QuasiStatic | None:
    """A slow push one way that the model cannot follow as a quasi-static curve; else None.

    Args:
        run: measured.
        sigma: noise of its position, rad or m.
        profile: of the model.
        inertia: of the model, kg·m² or kg.
        replay: the model's positions at the run's times, rad or m.
    """
    if run.command is not None:
        return None
    lo, hi = profile.joint.range
    force = float(np.sqrt(np.mean(run.force**2)))  # NaN where some is not known
    travels = float(np.ptp(run.position)) > TRAVEL * (hi - lo)
    if not (force > 0 and travels and one_way(ways(run.position, 6 * sigma))):
        return None
    at = np.arange(run.time[0], run.time[-1], PACE)
    if len(at) < LEAST:
        return None
    velocity = smoothing.smooth(run.time, run.position, at, sigma).velocity
    s = (np.interp(at, run.time, run.position) - lo) / (hi - lo)
    towards = float(np.sign(run.position[-1] - run.position[0]))
    drag = damping(profile, s, towards * np.abs(velocity))
    dynamic = inertia * np.gradient(velocity, at), drag * velocity
    if any(np.sqrt(np.mean(one**2)) > SLOW * force for one in dynamic):
        return None
    astray = replay(run, sigma) - run.position
    if not np.sqrt(np.mean(astray**2)) > ASTRAY * (hi - lo):
        return None
    return QuasiStatic(run.name, run.position, run.force)
