"""A joint without a profile: what the scene itself gives it, as far as a format can say it."""

from collections.abc import Sequence

import mujoco

from joda.exporting.nearest import SPRING, Format, Nearest
from joda.exporting.tree import left_out
from joda.scenes.engine import is_on, polynomial


def plain(model: mujoco.MjModel, joint: int, name: str) -> Nearest:
    """Its spring, damping and friction, and what of them only MuJoCo has.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
        name: of the joint in the file.
    """
    dof = int(model.jnt_dofadr[joint])
    springs, damps, rubs = (is_on(model, flag) for flag in ("spring", "damper", "frictionloss"))
    stiffness, *stiffer = (float(k) * springs for k in polynomial(model, "jnt_stiffness", joint))
    damping, *damped = (float(b) * damps for b in polynomial(model, "dof_damping", dof))
    friction = float(model.dof_frictionloss[dof]) * rubs
    higher = (("stiffness polynomial", stiffer), ("damping polynomial", damped))
    return Nearest(
        name,
        (stiffness, 0.0, 0.0),
        float(model.qpos_spring[model.jnt_qposadr[joint]]),
        (damping, 0.0),
        friction,
        friction,
        0.0,
        (),
        tuple(what for what, powers in higher if any(powers)),
    )


def lacking(joints: Sequence[Nearest], to: Format) -> list[str]:
    """What of such joints the format has no word for, one sentence each."""
    springs = sum(one.stiffness[0] != 0 for one in joints) if SPRING[to] == 0 else 0
    lost = [what for one in joints for what in one.lost]
    kinds = {"native spring": springs, **{what: lost.count(what) for what in sorted(set(lost))}}
    return [left_out(number, what) for what, number in kinds.items() if number]
