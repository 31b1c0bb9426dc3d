"""A joint in motion in its scene, and what gravity does to it, in MuJoCo."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.scenes.assembly import put
from joda.scenes.model import joint_name

Array = NDArray[np.float64]
Act = Callable[[mujoco.MjData], bool]
"""What acts on a scene: called before each step, it sets qfrc_applied or ctrl; False when done."""

Felt = Callable[[mujoco.MjModel, mujoco.MjData, int], float]
"""A generalised force (N·m or N) on a dof in the step that was made last."""

HOME = "home"
"""Name of the keyframe at which a scene begins, if it has one."""

FAST = 3.0
"""A joint is fast, or runs ahead of a hand, at more than so many times the usual speed."""
MIN_GAP = 0.05
"""Fast intervals nearer to each other (s) are one."""

LEAN = 0.3
"""How long a joint that is pressed against its stop takes to come to rest there, s."""

_BAD = mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC
"""Warnings that tell of a dof."""
_CONTACT = int(mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS)


@dataclass(frozen=True)
class Motion:
    """A joint's motion: arrays of one length.

    Attributes:
        time: s.
        position: rad or m.
        velocity: rad/s or m/s.
        force: that acted on the joint from outside in the step that follows, N·m or N: applied to
            it, by actuators on it, and by contacts.
    """

    time: Array
    position: Array
    velocity: Array
    force: Array


def idle(data: mujoco.MjData) -> bool:
    """Does nothing, and is never done."""
    return True


def play(
    model: mujoco.MjModel,
    joint: int,
    position: float,
    act: Act = idle,
    duration: float | None = None,
    watch: Callable[[mujoco.MjData], None] = lambda data: None,
    stride: int = 1,
    felt: Felt | None = None,
) -> Motion:
    """Simulates the whole scene from rest, the joint at a position, all else at home.

    What equality constraints couple to the joint begins where they hold (`joda.scenes.assembly`).

    Args:
        model: the compiled scene.
        joint: its id.
        position: where it begins, rad or m.
        act: what acts on the scene.
        duration: s; what acts is over earlier if it is done earlier. None: until it is done.
        watch: shown the scene before each step, and at the end.
        stride: timesteps from one sample to the next, in which what acts stays the same.
        felt: the force that the motion tells of; by default `outside`.

    Returns:
        the motion, one sample per stride, the start included.

    Raises:
        JodaError: the simulation is unstable.
    """
    data = at_home(model)
    qpos, dof, step = model.jnt_qposadr[joint], model.jnt_dofadr[joint], model.opt.timestep
    put(model, data, joint, position)
    steps = None if duration is None else round(duration / (step * stride))
    felt = felt or outside
    out: list[tuple[float, float, float, float]] = []
    going = True
    with unheard():
        while True:
            if going:
                going = act(data)
                if not going and steps is not None:
                    data.qfrc_applied[dof] = 0.0
            state = data.time, data.qpos[qpos], data.qvel[dof]
            watch(data)
            if len(out) == steps or not (going or steps):
                out.append((*state, felt(model, data, dof)))
                return Motion(*np.array(out).T)
            _advance(model, data, stride)
            out.append((*state, felt(model, data, dof)))


@contextmanager
def unheard() -> Iterator[None]:
    """MuJoCo prints no warnings, and leaves none in a log file, unless somebody listens to them."""
    heard = mujoco.get_mju_user_warning()
    if heard is None:
        mujoco.set_mju_user_warning(_unheard)
    try:
        yield
    finally:
        if heard is None:
            mujoco.set_mju_user_warning(None)


def _advance(model: mujoco.MjModel, data: mujoco.MjData, steps: int) -> None:
    """Steps the scene; raises JodaError if it is unstable; `unheard` goes around it."""
    before = data.time
    mujoco.mj_step(model, data, steps)
    if data.time > before:
        return  # else MuJoCo has begun anew
    dofs = [data.warning[kind].lastinfo for kind in _BAD if data.warning[kind].number]
    joint = [joint_name(model, int(model.dof_jntid[dof])) for dof in dofs[:1]]
    raise JodaError(
        f"the simulation is unstable at {before:.3g} s"
        + "".join(f", where joint '{name}' runs away" for name in joint)
        + f": make the scene's timestep, {model.opt.timestep:g} s, smaller, or check the forces, "
        "stiffness and masses that act there."
    )


def _unheard(message: str) -> None:
    pass


def at_home(model: mujoco.MjModel) -> mujoco.MjData:
    """The scene at its keyframe `home`, if it has one, else at its reference."""
    data = mujoco.MjData(model)
    home = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, HOME)
    if home >= 0:
        mujoco.mj_resetDataKeyframe(model, data, home)
    return data


def leaning(model: mujoco.MjModel, joint: int, position: float) -> float:
    """Where the joint comes to rest (rad or m) if it is pressed against the stop that it is at.

    A stop yields a little; what begins at its very surface would hit it at first.
    """
    lo, hi = model.jnt_range[joint]
    if not model.jnt_limited[joint] or lo < position < hi:
        return position
    end = play(model, joint, position, duration=LEAN).position[-1]
    return position if lo < end < hi else float(end)


def applied(model: mujoco.MjModel, data: mujoco.MjData, dof: int) -> float:
    """What was applied to a dof in the step that was made last, N·m or N."""
    return float(data.qfrc_applied[dof])


def outside(model: mujoco.MjModel, data: mujoco.MjData, dof: int) -> float:
    """Generalised force on a dof from outside it, in the step that was made last; N·m or N."""
    force = float(data.qfrc_applied[dof] + data.qfrc_actuator[dof])
    if data.ncon:
        rows = np.where(data.efc_type >= _CONTACT, data.efc_force, 0.0)
        by_contact = np.empty(model.nv)
        mujoco.mj_mulJacTVec(model, data, by_contact, rows)
        force += float(by_contact[dof])
    return force


def release(model: mujoco.MjModel, joint: int, position: float, duration: float) -> Motion:
    """Lets the joint go from rest: `play` where nothing acts."""
    return play(model, joint, position, duration=duration)


def fast(motion: Motion, usual: float) -> tuple[tuple[float, float], ...]:
    """Intervals of time (s) of sudden motion: more than FAST times the usual speed (rad/s, m/s)."""
    quick = np.abs(motion.velocity) > FAST * usual
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quick, [0]]).astype(int)))
    out: list[tuple[float, float]] = []
    for first, after in edges.reshape(-1, 2):
        a, b = float(motion.time[first]), float(motion.time[after - 1])
        if out and a - out[-1][1] < MIN_GAP:
            a = out.pop()[0]
        out.append((a, b))
    return tuple(out)


def usual_speed(motion: Motion) -> float:
    """Mean speed while the joint moves (at a hundredth of its top speed or more), rad/s or m/s."""
    speed = np.abs(motion.velocity)
    moving = speed[speed > 0.01 * speed.max()]
    return float(moving.mean()) if len(moving) else 0.0


def settle(model: mujoco.MjModel, joint: int, position: float, patience: float) -> Motion:
    """As `release`, until the joint has come to rest or `patience` (s) has passed.

    At rest: within a quarter of a second it has moved less than 1e-4 of its range. Raises JodaError
    if the simulation is unstable.
    """
    data = at_home(model)
    qpos, dof = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    span = float(np.ptp(model.jnt_range[joint]))
    put(model, data, joint, position)
    out = [(0.0, position, 0.0, 0.0)]
    pause = max(round(0.25 / model.opt.timestep), 1)
    stride = max(pause // 25, 1)
    with unheard():
        while data.time < patience:
            _advance(model, data, stride)
            out.append((data.time, data.qpos[qpos], data.qvel[dof], 0.0))
            recent = [row[1] for row in out[-(pause // stride + 1) :]]
            if len(recent) > pause // stride and max(recent) - min(recent) < 1e-4 * span:
                break
    return Motion(*np.array(out).T)


def gravity_force(model: mujoco.MjModel, joint: int, positions: Array) -> Array:
    """Generalised force of gravity on the joint at each position, N·m or N, others at rest.

    Args:
        model: the compiled scene.
        joint: its id.
        positions: shape (n,).

    Returns:
        shape (n,); positive drives the joint towards larger positions.
    """
    data = mujoco.MjData(model)
    out, bias = np.empty(len(positions)), np.empty(model.nv)
    for k, position in enumerate(positions):
        data.qpos[model.jnt_qposadr[joint]] = position
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_rne(model, data, 0, bias)  # at rest, all of it is gravity
        mujoco.mj_passive(model, data)
        out[k] = (data.qfrc_gravcomp - bias)[model.jnt_dofadr[joint]]
    return out
