"""What acts on a joint in its scene besides its own elements, contacts and actuators.

Replays move the joint by itself, so tendons, equality constraints and a medium are not in them.
"""

import mujoco
import numpy as np

from joda.scenes.model import joint_name, moves_with
from joda.scenes.scene import DAMPING_ROW

PLACES = 5
"""At how many places of the range a tendon's length is looked at."""
TINY = 1e-6
"""Friction losses below this only make a row in the solver, as joda's own tendons do."""


def acting_besides(model: mujoco.MjModel, joint: int) -> str:
    """A sentence on what acts on a joint that a replay of the joint alone leaves out, or nothing.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
    """
    what = [*_tendons(model, joint), *_equalities(model, joint)]
    if model.opt.density > 0 or model.opt.viscosity > 0:
        what.append("a medium (<option density viscosity wind>)")
    if not what:
        return ""
    return (
        f"In the scene more acts on joint '{joint_name(model, joint)}' than itself, gravity and "
        f"contacts: {', '.join(what)}; a replay of the joint by itself leaves that out."
    )


def _moved_tendons(model: mujoco.MjModel, joint: int) -> list[int]:
    """Tendons whose length the joint changes, all other joints at their reference."""
    if not model.ntendon:
        return []
    data, lengths = mujoco.MjData(model), []
    lo, hi = map(float, model.jnt_range[joint])
    for position in np.linspace(lo, hi, PLACES):
        data.qpos[model.jnt_qposadr[joint]] = position
        mujoco.mj_fwdPosition(model, data)
        lengths.append(data.ten_length.copy())
    return [int(k) for k in np.flatnonzero(np.ptp(lengths, axis=0) > 1e-9)]


def _tendons(model: mujoco.MjModel, joint: int) -> list[str]:
    out = []
    for k in _moved_tendons(model, joint):
        strengths = (model.tendon_stiffness[k], model.tendon_damping[k], model.tendon_armature[k])
        rubs = model.tendon_frictionloss[k] > TINY
        if rubs or model.tendon_limited[k] or any(np.any(one != 0) for one in strengths):
            out.append(_named("tendon", model.tendon(k).name))
    return out


def _equalities(model: mujoco.MjModel, joint: int) -> list[str]:
    moved = moves_with(model, int(model.jnt_bodyid[joint]))
    tendons = _moved_tendons(model, joint)
    out = []
    for k in range(model.neq):
        ends = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        kind = int(model.eq_type[k])
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            touches = joint in ends
        elif kind == mujoco.mjtEq.mjEQ_TENDON:
            touches = bool(set(ends) & set(tendons))
        elif kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
            of_sites = model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE
            bodies = [int(model.site_bodyid[e]) if of_sites else e for e in ends]
            touches = bool(moved[bodies[0]]) != bool(moved[bodies[1]])
        else:
            touches = False
        own = model.equality(k).name.startswith(DAMPING_ROW)
        if touches and model.eq_active0[k] and not own:
            out.append(_named("equality", model.equality(k).name))
    return out


def _named(kind: str, name: str) -> str:
    return f"{kind} '{name}'" if name else f"an {kind}" if kind == "equality" else f"a {kind}"
