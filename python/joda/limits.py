"""Solver parameters of a joint's end stops from a coefficient of restitution.

MuJoCo's limit is a spring and a damper that only push (docs, "Solver parameters"), with the
acceleration -stiffness * depth - damping * speed per unit of inertia where the impedance is
constant. In a step of that length the ratio of the speeds does not depend on the speed.
"""

from functools import cache

import numpy as np
from scipy.optimize import brentq

STEPS = 16
"""How many steps a knock lasts without damping: enough for the ratio to hardly depend on where
within a step the stop is met, few enough for a stop to be hard."""
IMPEDANCE = 0.99
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
