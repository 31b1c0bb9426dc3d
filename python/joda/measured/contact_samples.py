"""Where, along a log of several joints, the scene touches what one of them moves."""

from collections.abc import Mapping
from copy import copy

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.scenes.model import geom_name, moves_with

Array = NDArray[np.float64]

NEAR = 0.03
"""How near counts as a touch, per distance from the joint, rad: zeros of joints, and of the bodies
between them, are not known better."""
ALWAYS = 0.9
"""Part of the samples from which on a pair touches wherever the joint is, as a door its frame."""
BESIDE = 1
"""Samples before and after a touch that are within it too."""


def touching(
    model: mujoco.MjModel, joint: int, positions: Mapping[int, Array]
) -> tuple[NDArray[np.bool_], dict[tuple[str, str], int]]:
    """Which samples of a log lie within a contact of what the joint moves with what it does not.

    Args:
        model: compiled.
        joint: its id.
        positions: measured, of joints by their ids; rad or m, shape (n,) each.

    Returns:
        shape (n,); and how many samples each pair of geoms touches in.
    """
    count = len(next(iter(positions.values())))
    inside = np.zeros(count, bool)
    if not model.ngeom or model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
        return inside, {}
    wide = copy(model)
    wide.geom_margin[:] += NEAR * model.stat.extent
    data, moved = mujoco.MjData(wide), moves_with(model, int(model.jnt_bodyid[joint]))
    found: dict[tuple[int, int], NDArray[np.bool_]] = {}
    q, qpos = np.tile(model.qpos0, (count, 1)), data.qpos
    for number, own in positions.items():
        q[:, model.jnt_qposadr[number]] = own
    for k in range(count):
        qpos[:] = q[k]
        mujoco.mj_kinematics(wide, data)
        mujoco.mj_collision(wide, data)
        for contact in data.contact if data.ncon else ():
            pair = int(contact.geom[0]), int(contact.geom[1])
            ours = [bool(moved[model.geom_bodyid[geom]]) for geom in pair]
            arm = float(np.linalg.norm(contact.pos - data.xanchor[joint]))
            if ours[0] != ours[1] and contact.dist < NEAR * arm:
                pair = pair if ours[0] else pair[::-1]
                found.setdefault(pair, np.zeros(count, bool))[k] = True
    told = {}
    for (geom, other), there in found.items():
        if there.mean() < ALWAYS:
            inside |= there
            told[geom_name(model, geom), geom_name(model, other)] = int(there.sum())
    wider = np.convolve(inside, np.ones(2 * BESIDE + 1), mode="same") > 0
    return wider, told
