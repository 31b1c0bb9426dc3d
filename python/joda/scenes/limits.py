"""Solver parameters of a joint's end stops: for a restitution, and to bear what presses on them.

MuJoCo's limit is a spring and a damper that only push (docs, "Solver parameters"), with the
acceleration -stiffness * depth - damping * speed per unit of inertia where the impedance is
constant. In a step of that length the ratio of the speeds does not depend on the speed. What gives
a ratio is in cpp/end_stop.h, where the plugin takes it for an end with a restitution of its own.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np

from joda._core import stop_damping

KNOCK_STEPS = 16
"""How many timesteps a knock at a stop with a restitution lasts without damping: as kKnockSteps in
cpp/end_stop.h."""
STIFFNESS = (np.pi / KNOCK_STEPS) ** 2
"""Of such a stop, times the timestep squared: as kStopStiffness there."""
IMPEDANCE = 0.99
"""As kStopImpedance there."""
YIELDING, FIRM = 1e-2, 1e-3
"""A stop that yields by more than the first share of the range is made to yield by the second."""
LEAST_TIME = 1e-7
"""Of a stop's time constant times its damping ratio, s, that makes a stiffness."""
IMPEDANCES = 1e-4, 0.9999
"""Smallest and largest impedance that MuJoCo takes."""


def rebounding(restitution: float, timestep: float) -> tuple[float, float]:
    """The attribute solreflimit of a joint, with the constant impedance `IMPEDANCE`.

    Args:
        restitution: speed after a knock divided by the speed before, 0 <= restitution < 1.
        timestep: s; a knock lasts `KNOCK_STEPS` of these without damping.
    """
    # documented: the stiffness is multiplied by d / d^2 and the damping by 1 / d; then, with the
    # impedance d, the row makes the share d of the acceleration
    return -IMPEDANCE * STIFFNESS / timestep**2, -stop_damping(restitution) / timestep


@cache
def limit_parameters(restitution: float, timestep: float) -> tuple[str, str]:
    """The attributes solreflimit and solimplimit of a joint.

    Args:
        restitution: speed after a knock divided by the speed before, 0 <= restitution < 1.
        timestep: s; for another one the restitution is another one too.
    """
    stiffness, damping = rebounding(restitution, timestep)
    return f"{stiffness:.6g} {damping:.6g}", f"{IMPEDANCE:g} {IMPEDANCE:g} 0.001"


def stiffness_of(solref: Sequence[float], timestep: float) -> float:
    """Of a limit, per unit of inertia, 1/s² (MuJoCo's docs, "Solver parameters").

    Args:
        solref: time constant (s) and damping ratio; or less the stiffness and less the damping.
        timestep: s; the time constant is two of it at the least.
    """
    if solref[0] <= 0:
        return -solref[0]
    return 1 / max(max(solref[0], 2 * timestep) * solref[1], LEAST_TIME) ** 2


def firm_limit(
    pressed: float, span: float, solref: Sequence[float], solimp: Sequence[float], timestep: float
) -> tuple[str, str] | None:
    """The attributes solreflimit and solimplimit of a joint that is pressed against its stop.

    At rest, the row's acceleration R f, with R = (1 - d) / d of the inverse inertia, equals the
    stop's stiffness times its depth (docs, "Solver parameters"): the depth is `pressed` (1 - d) /
    stiffness. Where that is too much, the joint also arrives fast, so the stop is made as hard as
    the timestep allows, and then the impedance d raised as far as needed.

    Args:
        pressed: the force against the stop by the joint's inertia, rad/s² or m/s².
        span: of the joint's range, rad or m.
        solref, solimp: of the joint's limits as they are.
        timestep: s.

    Returns:
        None where they bear it as they are.
    """
    direct = solref[0] <= 0
    ratio = 1.0 if direct else solref[1]
    stiffness = stiffness_of(solref, timestep)
    if stiffness <= 0 or pressed * (1 - solimp[1]) / stiffness <= YIELDING * span:
        return None
    hardest = (2 * timestep * ratio) ** -2
    d = float(np.clip(1 - FIRM * span * hardest / pressed, solimp[1], IMPEDANCES[1]))
    words = f"{d:.6g} {d:.6g}"
    if direct:
        damping = -solref[1] * np.sqrt(hardest / stiffness)
        return f"{-hardest:.6g} {-damping:.6g}", words
    return f"{2 * timestep:.6g} {ratio:.6g}", words
