"""Bodies' masses as attributes in MJCF: those that a joint moves, made heavier or lighter."""

from dataclasses import dataclass

import mujoco
import numpy as np

MIN_SHARE = 1e-9
"""Part of a weight that is worth carrying."""


@dataclass(frozen=True)
class Heavier:
    """Factors of what a joint moves: the right numbers over the model's.

    Attributes:
        inertia: of masses and inertias.
        gravity: of gravity's pull on them.
        turned: by how much more the centre of mass is turned about the joint's axis, rad.
    """

    inertia: float
    gravity: float
    turned: float = 0.0

    @property
    def lifted(self) -> float:
        """Part of the new masses' weight that something carries: MuJoCo's `gravcomp`; less than 0
        where gravity pulls more than the new masses make it, which MJCF cannot say."""
        return 1 - self.gravity / self.inertia


def moved_bodies(model: mujoco.MjModel, joint: int) -> list[int]:
    """Ids of the bodies that a joint moves, in the order of a file: depth first."""
    first = int(model.jnt_bodyid[joint])
    out = [first]
    for body in range(first + 1, model.nbody):
        if int(model.body_parentid[body]) in out:
            out.append(body)
    return out


def inertial(model: mujoco.MjModel, joint: int, body: int, heavier: Heavier) -> dict[str, str]:
    """Attributes of the <inertial> of a body that a joint moves."""
    data, quat = mujoco.MjData(model), np.zeros(4)
    mujoco.mj_kinematics(model, data)
    turn = np.zeros(9)
    mujoco.mju_axisAngle2Quat(quat, data.xaxis[joint], heavier.turned)
    mujoco.mju_quat2Mat(turn, quat)
    R, own, anchor = turn.reshape(3, 3), data.xmat[body].reshape(3, 3), data.xanchor[joint]
    place = anchor + R @ (data.xipos[body] - anchor)
    mujoco.mju_mat2Quat(quat, (own.T @ R @ data.ximat[body].reshape(3, 3)).ravel())
    moments = heavier.inertia * model.body_inertia[body]
    most = int(np.argmax(moments))  # MuJoCo takes no more than the sum of the others
    moments[most] = min(moments[most], moments.sum() - moments[most])
    values = {
        "pos": own.T @ (place - data.xpos[body]),
        "quat": quat,
        "mass": [heavier.inertia * model.body_mass[body]],
        "diaginertia": moments,
    }
    return {name: " ".join(f"{x:.17g}" for x in np.ravel(value)) for name, value in values.items()}


def gravcomp(model: mujoco.MjModel, body: int, heavier: Heavier) -> str | None:
    """A body's new `gravcomp`; None where it stays as it is."""
    if heavier.lifted < MIN_SHARE:
        return None
    carried = 1 - (1 - heavier.lifted) * (1 - float(model.body_gravcomp[body]))
    return f"{carried:.9g}"
