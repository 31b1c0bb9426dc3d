"""MuJoCo from 3.3 to 4.0: what one version has and another has not, under one name."""

from typing import Any

import mujoco
import numpy as np

VERSION = tuple(int(part) for part in mujoco.__version__.split(".")[:3])
FORGETS_INSTANCES = (3, 3, 1) <= VERSION < (3, 16)
"""Whether a <replicate> makes MuJoCo forget the plugins' instances of all bodies behind it."""
HAS_POLYNOMIALS = hasattr(mujoco.MjModel, "jnt_stiffnesspoly")
"""Whether stiffness and damping of a joint may be polynomials, as they may in newer MuJoCo."""


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
    """Whether what a flag of <option> can disable acts: "spring", "damper", "frictionloss",
    "limit", "equality"; without "constraint" rows none of the last three does."""
    off = disable_bit(flag)
    if flag in ("frictionloss", "limit", "equality"):
        off |= disable_bit("constraint")
    return not model.opt.disableflags & off


def disable_bit(flag: str) -> int:
    """The bit that disables what a flag of <option> names; before MuJoCo 3.3.6 one bit disables
    "spring" and "damper" together."""
    bits = mujoco.mjtDisableBit
    if not hasattr(bits, "mjDSBL_SPRING") and flag in ("spring", "damper"):
        flag = "passive"
    return int(getattr(bits, f"mjDSBL_{flag.upper()}"))


def delete(spec: mujoco.MjSpec, element: Any) -> None:
    """Takes an element out of a spec; before MuJoCo 3.3.4 elements do so themselves."""
    if hasattr(spec, "delete"):
        spec.delete(element)
    else:
        element.delete()


def inertia_at(model: mujoco.MjModel, data: mujoco.MjData, dof: int) -> float:
    """Inertia of a degree of freedom, all others held, after mj_fwdPosition (kg·m² or kg)."""
    unit, column = np.zeros(model.nv), np.zeros(model.nv)
    unit[dof] = 1
    mujoco.mj_mulM(model, data, column, unit)
    return float(column[dof])


def set_strength(joint: Any, field: str, *values: float) -> None:
    """Gives a joint of an MjSpec a strength; from MuJoCo 3.7 on it begins a polynomial.

    Args:
        joint: an MjsJoint.
        field: "damping" or "stiffness".
        values: N·m·s/rad or N·s/m; N·m/rad or N/m; then those of higher powers, which older MuJoCo
            does not have.
    """
    if np.ndim(getattr(joint, field)):
        getattr(joint, field)[: len(values)] = values
    else:
        setattr(joint, field, values[0])
