"""A joint of a scene as one profile: what MuJoCo gives it natively, besides what it carries."""

import mujoco

from joda.component import Component
from joda.effects import QuadraticDamping
from joda.profile import Profile
from joda.scenes.engine import polynomial
from joda.scenes.scene import TRACE

LEAST = 1e3 * float(TRACE)
"""Native friction below this (N·m or N) is the trace that makes a row."""


def whole_profile(model: mujoco.MjModel, joint: int, profile: Profile) -> Profile:
    """The profile with the joint's native spring, friction and damping as further components.

    Args:
        model: compiled; its joint may carry native elements besides a profile.
        joint: its id.
        profile: that the joint carries, or an empty one.

    Returns:
        a profile that alone makes the joint move as it does in the scene. The cubic part of a
        damping polynomial, and polynomials of stiffness, are left out.
    """
    dof = model.jnt_dofadr[joint]
    friction, damping = float(model.dof_frictionloss[dof]), float(model.dof_damping[dof])
    stiffness = float(model.jnt_stiffness[joint])
    rest = float(model.qpos_spring[model.jnt_qposadr[joint]])
    lo, hi = profile.joint.range
    out = profile
    if stiffness:
        ends = (-stiffness * (lo - rest), -stiffness * (hi - rest))
        out = out.with_component("conservative", _line("native spring", *ends))
    if friction > LEAST:
        out = out.with_component("friction", _line("native friction", friction, friction))
    if damping:
        out = out.with_component("damping", _line("native damping", damping, damping))
    square = float(sum(polynomial(model, "dof_damping", dof)[1:2]))
    if square and not any(isinstance(effect, QuadraticDamping) for effect in out.effects):
        out = out.with_effect(QuadraticDamping(y=(square, square)))
    return out


def _line(label: str, first: float, last: float) -> Component:
    return Component(label=label, interval=(0, 1), x=(0, 1), y=(first, last))
