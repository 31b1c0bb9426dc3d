"""A joint of a scene as one profile: what MuJoCo gives it natively, besides what it carries."""

import mujoco

from joda.component import Component
from joda.effects import QuadraticDamping
from joda.profile import CHANNELS, Profile
from joda.scenes.engine import polynomial
from joda.scenes.model import joint_name
from joda.scenes.scene import TRACE, profiles_of

SPRING, FRICTION, DAMPING = "native spring", "native friction", "native damping"
"""Labels of what a joint has natively."""
Row = tuple[tuple[float, ...], tuple[float, ...]]
"""solref and solimp of a solver's row."""
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
        out = out.with_component("conservative", _line(SPRING, *ends))
    if friction > LEAST:
        out = out.with_component("friction", _line(FRICTION, friction, friction))
    if damping:
        out = out.with_component("damping", _line(DAMPING, damping, damping))
    square = float(sum(polynomial(model, "dof_damping", dof)[1:2]))
    if square and not any(isinstance(effect, QuadraticDamping) for effect in out.effects):
        out = out.with_effect(QuadraticDamping(y=(square, square)))
    return out


def native_attributes(profile: Profile) -> dict[str, tuple[float, ...]]:
    """A joint's attributes in MJCF that are the profile, each as numbers; none if it has more than
    native elements."""
    channels, (lo, hi) = profile.channels, profile.joint.range
    out: dict[str, tuple[float, ...]] = {}
    for name in CHANNELS:
        for part in getattr(channels, name).components:
            first, last = part.y[0], part.y[-1]
            if part.label == SPRING and first != last:
                stiffness = (first - last) / (hi - lo)
                out |= {"stiffness": (stiffness,), "springref": (lo + first / stiffness,)}
            elif part.label == FRICTION:
                out["frictionloss"] = (first,)
            elif part.label == DAMPING:
                out["damping"] = (first,)
            else:
                return {}
    return {} if profile.effects else out


def own_friction_row(model: mujoco.MjModel, joint: int) -> Row | None:
    """solref and solimp of the friction row that MuJoCo makes of a joint's native friction; None if
    it has none, or the joint carries a profile, which makes that row its own."""
    dof = model.jnt_dofadr[joint]
    if model.dof_frictionloss[dof] <= LEAST or joint_name(model, joint) in profiles_of(model):
        return None
    row = model.dof_solref[dof], model.dof_solimp[dof]
    return tuple(map(float, row[0])), tuple(map(float, row[1]))


def _line(label: str, first: float, last: float) -> Component:
    return Component(label=label, interval=(0, 1), x=(0, 1), y=(first, last))
