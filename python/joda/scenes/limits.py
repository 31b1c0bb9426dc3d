"""Solver parameters of a joint's end stops: for a restitution, to bear what presses on them, and of
a stop that one end has besides.

MuJoCo's limit is a spring and a damper that only push (docs, "Solver parameters"), with the
acceleration -stiffness * depth - damping * speed per unit of inertia where the impedance is
constant. In a step of that length the ratio of the speeds does not depend on the speed. What gives
a ratio is in cpp/end_stop.h, where the plugin takes it for an end with a restitution of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from joda._core import stop_damping
from joda.scenes.mjcf import quoted

IMPACT_STEPS = 16
"""How many timesteps an impact at a stop with a restitution lasts without damping: as kImpactSteps
in cpp/end_stop.h."""
STIFFNESS = (np.pi / IMPACT_STEPS) ** 2
"""Of such a stop, times the timestep squared: as kStopStiffness there."""
IMPEDANCE = 0.99
"""As kStopImpedance there."""
YIELDING, FIRM = 1e-2, 1e-3
"""A stop that yields by more than the first share of the range is made to yield by the second."""
MIN_TIME = 1e-7
"""Of a stop's time constant times its damping ratio, s, that makes a stiffness."""
IMPEDANCES = 1e-4, 0.9999
"""Smallest and largest impedance that MuJoCo takes."""

ALIKE = 1e-6
"""Part of the range by which a tendon's limit may be off an end to be there."""


@dataclass(frozen=True)
class SecondStop:
    """What stops a joint at one end besides its limit, of which MuJoCo has one for both ends: the
    limit of a fixed tendon on it alone.

    Attributes:
        end: -1 the low one, 1 the high one.
        solref, solimp: of the tendon's limit.
    """

    end: int
    solref: tuple[float, ...]
    solimp: tuple[float, ...]

    @property
    def where(self) -> str:
        """The end, in words."""
        return "high" if self.end > 0 else "low"

    def element(self, name: str, joint: str, span: tuple[float, float]) -> str:
        """The tendon in MJCF.

        Args:
            name: of it.
            joint: name of the joint.
            span: of the joint's range, rad or m; the tendon's begins or ends as far beyond it.
        """
        lo, hi = span
        reach = (2 * lo - hi, hi) if self.end > 0 else (lo, 2 * hi - lo)
        numbers = {"range": reach, "solreflimit": self.solref, "solimplimit": self.solimp}
        text = " ".join(
            f'{key}="{" ".join(f"{value:.9g}" for value in values)}"'
            for key, values in numbers.items()
        )
        inner = f'<joint joint={quoted(joint)} coef="1"/>'
        return f'<fixed name={quoted(name)} limited="true" {text}>\n  {inner}\n</fixed>'


@dataclass(frozen=True)
class Stops:
    """Of the ends of a range.

    Attributes:
        solref, solimp: of the joint's limit, for both.
        second: what one end has besides; None for nothing.
    """

    solref: tuple[float, ...]
    solimp: tuple[float, ...]
    second: SecondStop | None = None


def second_stop(model: mujoco.MjModel, joint: int) -> SecondStop | None:
    """What stops a joint of a compiled model besides its limit; of several tendons the first."""
    found = (stop_of(model, tendon, joint) for tendon in range(model.ntendon))
    return next((stop for stop in found if stop), None)


def stop_of(model: mujoco.MjModel, tendon: int, joint: int) -> SecondStop | None:
    """What a tendon is to a joint, if that is a second stop at one end; else None."""
    at = int(model.tendon_adr[tendon])
    alone = model.tendon_num[tendon] == 1 and model.wrap_type[at] == mujoco.mjtWrap.mjWRAP_JOINT
    own = alone and model.wrap_objid[at] == joint and model.wrap_prm[at] == 1
    if not (own and model.tendon_limited[tendon] and model.jnt_limited[joint]):
        return None
    (lo, hi), (first, last) = model.jnt_range[joint], model.tendon_range[tendon]
    near = ALIKE * (hi - lo)
    low, high = abs(first - lo) <= near < last - hi, abs(last - hi) <= near < lo - first
    if low == high:
        return None
    solref, solimp = model.tendon_solref_lim[tendon], model.tendon_solimp_lim[tendon]
    return SecondStop(1 if high else -1, tuple(map(float, solref)), tuple(map(float, solimp)))


def rebounding(restitution: float, timestep: float) -> tuple[float, float]:
    """The attribute solreflimit of a joint, with the constant impedance `IMPEDANCE`.

    Args:
        restitution: speed after an impact divided by the speed before, 0 <= restitution < 1.
        timestep: s; an impact lasts `IMPACT_STEPS` of these without damping.
    """
    # documented: the stiffness is multiplied by d / d^2 and the damping by 1 / d; then, with the
    # impedance d, the row makes the share d of the acceleration
    return -IMPEDANCE * STIFFNESS / timestep**2, -stop_damping(restitution) / timestep


@cache
def limit_parameters(restitution: float, timestep: float) -> tuple[str, str]:
    """The attributes solreflimit and solimplimit of a joint.

    Args:
        restitution: speed after an impact divided by the speed before, 0 <= restitution < 1.
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
    return 1 / max(max(solref[0], 2 * timestep) * solref[1], MIN_TIME) ** 2


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
