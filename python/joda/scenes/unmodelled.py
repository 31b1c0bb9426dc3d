"""Elements of a scene that act on a joint and that a replay of the joint by itself leaves out."""

import mujoco
import numpy as np

from joda.scenes.engine import is_on, polynomial
from joda.scenes.limits import stop_of
from joda.scenes.model import moves_with
from joda.scenes.scene import DAMPING_ROW

PLACES = 5
"""At how many places of the range a tendon's length is looked at."""
TINY = 1e-6
"""Friction losses below this only make a row in the solver, as joda's own tendons do."""


def unmodelled_elements(model: mujoco.MjModel, joint: int) -> tuple[str, ...]:
    """The tendons, equality constraints and media that act on a joint, by kind and name, and what
    of its own is not replayed.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
    """
    moved = _moved_tendons(model, joint)
    cubic = any(polynomial(model, "dof_damping", int(model.jnt_dofadr[joint]))[2:])
    medium = model.opt.density > 0 or model.opt.viscosity > 0
    return (
        *(_named("a tendon", model.tendon(k).name) for k in moved if _resists(model, k, joint)),
        *(_named("an equality", model.equality(k).name) for k in _equalities(model, joint, moved)),
        *(["a medium (<option density viscosity wind>)"] if medium else []),
        *(["its damping's third power"] if cubic and is_on(model, "damper") else []),
        *([] if is_on(model, "limit") else ["the flag that disables its limits"]),
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


def _resists(model: mujoco.MjModel, tendon: int, joint: int) -> bool:
    """Whether a tendon has a strength or a limit; but for a stop at an end, which is replayed."""
    fields = "tendon_stiffness", "tendon_damping", "tendon_armature"
    strengths = (getattr(model, field) for field in fields if hasattr(model, field))
    return bool(
        model.tendon_frictionloss[tendon] > TINY
        or (model.tendon_limited[tendon] and not stop_of(model, tendon, joint))
        or any(np.any(one[tendon] != 0) for one in strengths)
    )


def _equalities(model: mujoco.MjModel, joint: int, tendons: list[int]) -> list[int]:
    """Active equality constraints on the joint, on what it moves, or on tendons that it moves."""
    moved = moves_with(model, int(model.jnt_bodyid[joint]))
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
        active = model.eq_active0[k] and is_on(model, "equality")
        if touches and active and DAMPING_ROW not in model.equality(k).name:
            out.append(k)
    return out


def _named(kind: str, name: str) -> str:
    """As "tendon 'band'", or "a tendon" where it has no name."""
    return f"{kind.split()[1]} '{name}'" if name else kind
