"""Machines: whether a joint is one of a robot's, whichever of its joints the motors are on."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.actuators import acting_on
from joda.scenes.model import moves_with

ROW = 6
"""So many hinges and slides in a row are an arm; a lamp, with its foot and head, has five."""
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)


def of_machine(model: mujoco.MjModel, joint: int) -> bool:
    """Whether a joint is one of a machine's.

    An actuator acts on it, on what carries it, on what it carries, or on what equality constraints
    couple to these, as the links of a gripper; or it is one of six in a row.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
    """
    body = int(model.jnt_bodyid[joint])
    carried = moves_with(model, body)
    row = carried | _carriers(model, body)
    return _in_a_row(model, carried) >= ROW or any(
        acting_on(model, other) for other in _joints(model, row | _coupled(model, row))
    )


def _joints(model: mujoco.MjModel, bodies: NDArray[np.bool_]) -> list[int]:
    """The hinges and slides of bodies."""
    return [int(k) for k in np.flatnonzero(bodies[model.jnt_bodyid] & (model.jnt_type >= _SLIDE))]


def _carriers(model: mujoco.MjModel, body: int) -> NDArray[np.bool_]:
    """A body and those that carry it; shape (nbody,)."""
    out = np.zeros(model.nbody, bool)
    while body:
        out[body] = True
        body = int(model.body_parentid[body])
    return out


def _in_a_row(model: mujoco.MjModel, carried: NDArray[np.bool_]) -> int:
    """How many hinges and slides there are from the world to the last of the carried bodies."""
    count = np.bincount(model.jnt_bodyid[model.jnt_type >= _SLIDE], minlength=model.nbody)
    for body in range(1, model.nbody):
        count[body] += count[model.body_parentid[body]]
    return int(count[carried].max())


def _coupled(model: mujoco.MjModel, row: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The bodies that equality constraints couple to those of a row, and what carries them."""
    out = np.zeros(model.nbody, bool)
    for k in range(model.neq):
        ends = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        kind = int(model.eq_type[k])
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            bodies = [int(model.jnt_bodyid[end]) for end in ends if end >= 0]
        elif kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
            of_sites = model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE
            bodies = [int(model.site_bodyid[end]) if of_sites else end for end in ends]
        else:
            continue
        if model.eq_active0[k] and row[bodies].any():
            for body in bodies:
                out |= _carriers(model, body)
    return out
