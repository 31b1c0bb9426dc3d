"""A joint of a scene as one profile: what MuJoCo gives it natively, besides what it carries."""

import mujoco
import numpy as np

from joda.component import Component
from joda.effects import (
    AsymmetricFriction,
    DirectionDependentDamping,
    LearnedForce,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.profile import CHANNELS, Channels, Joint, Profile
from joda.scenes.engine import is_on, polynomial
from joda.scenes.model import joint_name
from joda.scenes.scene import TRACE, profiles_of

SPRING, FRICTION, DAMPING = "native spring", "native friction", "native damping"
"""Labels of what a joint has natively."""
Row = tuple[tuple[float, ...], tuple[float, ...]]
"""solref and solimp of a solver's row."""
DAMPING_EFFECTS = (DirectionDependentDamping, LearnedForce, QuadraticDamping)
FRICTION_EFFECTS = (
    AsymmetricFriction,
    LoadDependentFriction,
    PreslidingFriction,
    StribeckFriction,
)
KNOTS = 65
"""Of the curve that stands for a stiffness that is a polynomial."""
MIN_FRICTION = 1e3 * float(TRACE)
"""Native friction below this (N·m or N) is the trace that makes a row."""


def whole_profile(model: mujoco.MjModel, joint: int, profile: Profile) -> Profile:
    """The profile with the joint's native spring, friction and damping as further components.

    Args:
        model: compiled; its joint may carry native elements besides a profile.
        joint: its id.
        profile: that the joint carries, or an empty one.

    Returns:
        a profile that alone makes the joint move as it does in the scene: what the scene's flags
        disable is not in it. The cubic part of a damping polynomial is left out
        (`joda.scenes.unmodelled`).
    """
    dof = model.jnt_dofadr[joint]
    springs, damps, rubs = (is_on(model, flag) for flag in ("spring", "damper", "frictionloss"))
    friction = float(model.dof_frictionloss[dof]) * rubs
    damping = float(model.dof_damping[dof]) * damps
    out = _left(profile, springs, damps, rubs)
    if springs and any(polynomial(model, "jnt_stiffness", joint)):
        out = out.with_component("conservative", _spring(model, joint, profile.joint))
    if friction > MIN_FRICTION:
        out = out.with_component("friction", _line(FRICTION, friction, friction))
    if damping:
        out = out.with_component("damping", _line(DAMPING, damping, damping))
    square = float(sum(polynomial(model, "dof_damping", dof)[1:2])) * damps
    if square and not any(isinstance(effect, QuadraticDamping) for effect in out.effects):
        out = out.with_effect(QuadraticDamping(y=(square, square)))
    return out


def _left(profile: Profile, springs: bool, damps: bool, rubs: bool) -> Profile:
    """What of a profile the scene's flags leave."""
    on = {"conservative": springs, "friction": rubs, "damping": damps}
    none = {name: getattr(Channels(), name) for name in on if not on[name]}
    off = (DAMPING_EFFECTS if not damps else ()) + (FRICTION_EFFECTS if not rubs else ())
    kept = tuple(one for one in profile.effects if not isinstance(one, off))
    channels = profile.channels.model_copy(update=none)
    return profile.model_copy(update={"channels": channels, "effects": kept})


def _spring(model: mujoco.MjModel, joint: int, described: Joint) -> Component:
    """The joint's spring, which is a line unless its stiffness is a polynomial."""
    (lo, hi), adr, dof = described.range, model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    stiffness, *higher = map(float, polynomial(model, "jnt_stiffness", joint))
    if not any(higher):
        rest = float(model.qpos_spring[adr])
        return _line(SPRING, -stiffness * (lo - rest), -stiffness * (hi - rest))
    u, data, force = np.linspace(0, 1, KNOTS), mujoco.MjData(model), []
    for q in lo + u * (hi - lo):
        data.qpos[adr] = q
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        force.append(float(data.qfrc_spring[dof]))
    return Component(label=SPRING, interval=(0, 1), x=tuple(map(float, u)), y=tuple(force))


def native_attributes(profile: Profile) -> dict[str, tuple[float, ...]]:
    """A joint's attributes in MJCF that are the profile, each as numbers; none if it has more than
    native elements."""
    channels, (lo, hi) = profile.channels, profile.joint.range
    out: dict[str, tuple[float, ...]] = {}
    for name in CHANNELS:
        for part in getattr(channels, name).components:
            first, last = part.y[0], part.y[-1]
            if len(part.y) > 2:
                return {}
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
    it has no native friction nor damping, or carries a profile, which makes that row its own."""
    dof = model.jnt_dofadr[joint]
    rubs = is_on(model, "frictionloss") and model.dof_frictionloss[dof] > MIN_FRICTION
    damps = is_on(model, "damper") and model.dof_damping[dof] > 0
    if not (rubs or damps) or joint_name(model, joint) in profiles_of(model):
        return None
    row = model.dof_solref[dof], model.dof_solimp[dof]
    return tuple(map(float, row[0])), tuple(map(float, row[1]))


def _line(label: str, first: float, last: float) -> Component:
    return Component(label=label, interval=(0, 1), x=(0, 1), y=(first, last))
