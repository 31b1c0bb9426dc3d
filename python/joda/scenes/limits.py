"""Solver parameters of a joint's end stops: for a restitution, and to bear what presses on them.

MuJoCo's limit is a spring and a damper that only push (docs, "Solver parameters"), with the
acceleration -stiffness * depth - damping * speed per unit of inertia where the impedance is
constant. In a step of that length the ratio of the speeds does not depend on the speed.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.optimize import brentq

STEPS = 16
"""How many steps a knock lasts without damping: enough for the ratio to hardly depend on where
within a step the stop is met, few enough for a stop to be hard."""
IMPEDANCE = 0.99
YIELDING, FIRM = 1e-2, 1e-3
"""A stop that yields by more than the first share of the range is made to yield by the second."""
MOST = 0.9999
"""Largest impedance that MuJoCo takes."""
PHASES = np.linspace(0, 1, 16, endpoint=False) + 1 / 32
"""Where within a step the stop is met."""


@cache
def limit_parameters(restitution: float, timestep: float) -> tuple[str, str]:
    """The attributes solreflimit and solimplimit of a joint.

    Args:
        restitution: speed after a knock divided by the speed before, 0 <= restitution < 1.
        timestep: s; for another one the restitution is another one too.
    """
    stiffness = (np.pi / (STEPS * timestep)) ** 2
    damping = 1 / timestep  # stops the joint within one step
    if restitution > _rebound(stiffness, damping, timestep):
        damping = brentq(
            lambda b: _rebound(stiffness, b, timestep) - restitution, 0, damping, xtol=1e-9
        )
    # documented: the stiffness is multiplied by d / d^2 and the damping by 1 / d; then, with the
    # impedance d, the row makes the share d of the acceleration
    d = IMPEDANCE
    return f"{-stiffness * d:.6g} {-damping:.6g}", f"{d:g} {d:g} 0.001"


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
    stiffness = -solref[0] if direct else (max(solref[0], 2 * timestep) * ratio) ** -2
    if stiffness <= 0 or pressed * (1 - solimp[1]) / stiffness <= YIELDING * span:
        return None
    hardest = (2 * timestep * ratio) ** -2
    d = float(np.clip(1 - FIRM * span * hardest / pressed, solimp[1], MOST))
    words = f"{d:.6g} {d:.6g}"
    if direct:
        damping = -solref[1] * np.sqrt(hardest / stiffness)
        return f"{-hardest:.6g} {-damping:.6g}", words
    return f"{2 * timestep:.6g} {ratio:.6g}", words


def _rebound(stiffness: float, damping: float, h: float) -> float:
    """Speed after a knock that begins with speed 1, as MuJoCo steps it; mean over `PHASES`."""
    x, v = -h * PHASES, -np.ones(len(PHASES))
    for _ in range(20 * STEPS):
        push = np.where(x < 0, np.maximum(-stiffness * x - damping * v, 0.0), 0.0)
        v = v + h * push
        x = x + h * v
        if np.all((x >= 0) & (v >= 0)):
            break
    return float(v.mean())
