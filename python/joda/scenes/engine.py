"""MuJoCo from 3.3 to 4.0: what one version has and another has not, under one name."""

from typing import Any

import mujoco
import numpy as np

from joda.errors import JodaError

VERSION = tuple(int(part) for part in mujoco.__version__.split(".")[:3])
FORGETS_INSTANCES = (3, 3, 1) <= VERSION < (3, 16)
"""Whether a <replicate> makes MuJoCo forget the plugins' instances of all bodies behind it."""


def is_discrete(model: mujoco.MjModel) -> bool:
    """Whether the integrator is "discrete", which MuJoCo has from 3.13 on."""
    name = mujoco.mjtIntegrator(model.opt.integrator).name
    return bool(name == "mjINT_DISCRETE")


def polynomial(model: mujoco.MjModel, field: str, index: int) -> list[float]:
    """A strength of the model and those of its higher powers, which older MuJoCo has not.

    Args:
        model: any model.
        field: "dof_damping" or "jnt_stiffness".
        index: the degree of freedom, or the joint.
    """
    higher = getattr(model, f"{field}poly", None)
    return [getattr(model, field)[index], *(() if higher is None else higher[index])]


def is_on(model: mujoco.MjModel, flag: str) -> bool:
    """Whether what a flag of <option> can disable acts: "spring", "damper" (older MuJoCo:
    "passive"), "frictionloss", "limit", "equality"; without "constraint" rows none of the last
    three does."""
    bits = {
        name: int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}", 0))
        for name in (flag, "passive", "constraint")
    }
    off = bits[flag] or bits["passive"]
    if flag in ("frictionloss", "limit", "equality"):
        off |= bits["constraint"]
    return not model.opt.disableflags & off


def inertia_at(model: mujoco.MjModel, data: mujoco.MjData, dof: int) -> float:
    """Inertia of a degree of freedom, all others held, after mj_fwdPosition (kg·m² or kg)."""
    unit, column = np.zeros(model.nv), np.zeros(model.nv)
    unit[dof] = 1
    mujoco.mj_mulM(model, data, column, unit)
    return float(column[dof])


def set_strength(joint: Any, field: str, value: float) -> None:
    """Gives a joint of an MjSpec a linear strength; from 3.7 on it begins a polynomial.

    Args:
        joint: an MjsJoint.
        field: "damping" or "stiffness".
        value: N·m·s/rad or N·s/m; N·m/rad or N/m.
    """
    if np.ndim(getattr(joint, field)):
        getattr(joint, field)[0] = value
    else:
        setattr(joint, field, value)


def require(oldest: tuple[int, int, int], what: str) -> None:
    """Raises JodaError if MuJoCo is older than what something needs."""
    if oldest > VERSION:
        needed = ".".join(map(str, oldest))
        raise JodaError(
            f"{what} needs MuJoCo {needed} or newer, and {mujoco.__version__} is installed; run: "
            f"pip install 'mujoco>={needed}'"
        )
