"""Which actuators act on a joint (directly, by a tendon, a site or a slider-crank), and how."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.scenes.model import joint_name

Array = NDArray[np.float64]

PLACES = 5
"""At how many places of the range moment arms are looked at: a crank has none at its dead point."""
MIN_MOMENT = 1e-9
"""Moment arms below this are rounding."""


@dataclass(frozen=True)
class Servo:
    """What a joint's actuators exert on it, with limits:
    gain (command - stiffness q - following v) - damping v.

    MuJoCo's motors, position and velocity servos are of that kind: a velocity servo follows the
    command with its damping, what a position servo has of that only damps.

    Attributes:
        gain: the right one over the model's.
        stiffness: N·m/rad or N/m.
        following, damping: N·m·s/rad or N·s/m.
        low, high: least and largest force, N·m or N.
        delay: from a command to its action, s.
    """

    gain: float = 1.0
    stiffness: float = 0.0
    following: float = 0.0
    damping: float = 0.0
    low: float = -inf
    high: float = inf
    delay: float = 0.0

    def force(self, command: Array, position: Array, velocity: Array) -> Array:
        """At commands (force at zero position and velocity), N·m or N; shape (n,)."""
        wanted = command - self.stiffness * position - self.following * velocity
        free = self.gain * wanted - self.damping * velocity
        return np.asarray(np.clip(free, self.low, self.high))

    def changed(self, gain: float, damping: float, delay: float) -> "Servo":
        """The same with factors of its gain and of its damping, and another delay (s)."""
        gain, damping = float(gain * self.gain), float(damping * self.damping)
        return replace(self, gain=gain, damping=damping, delay=float(delay))

    def stepped(self, h: float) -> "Servo":
        """The same for steps of h (s), in which the engine takes the stiffness at their beginning:
        that takes h / 2 times it from the damping, to the first order, which is given back here."""
        return replace(self, following=self.following + self.stiffness * h / 2)

    @property
    def drag(self) -> float:
        """All of its damping, N·m·s/rad or N·s/m."""
        return self.gain * self.following + self.damping


@dataclass(frozen=True)
class Drive:
    """How control signals drive a joint.

    Attributes:
        names: of the actuators on it, k.
        servo: what they exert together.
        offset: the command of signals that are all zero, N·m or N.
        gains: command by signal, shape (k,).
        low, high: limits of the signals, shape (k,).
    """

    names: tuple[str, ...]
    servo: Servo
    offset: float
    gains: Array
    low: Array
    high: Array

    @property
    def columns(self) -> tuple[str, ...]:
        """Of a log with the signals, in the order of `names`."""
        return tuple(f"ctrl:{name}" for name in self.names)

    def command(self, ctrl: Array) -> Array:
        """Of control signals in the actuators' units, shape (n, k); N·m or N, (n,)."""
        return np.asarray(self.offset + np.clip(ctrl, self.low, self.high) @ self.gains)


def acting_on(model: mujoco.MjModel, joint: int) -> list[int]:
    """The actuators, by id, that have a moment arm on a joint somewhere in its range.

    All other joints are at their reference. Actuators that are disabled do not act, nor does
    adhesion, which only holds what it touches.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
    """
    if not model.nu or model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION:
        return []
    data, dof = mujoco.MjData(model), int(model.jnt_dofadr[joint])
    lo, hi = map(float, model.jnt_range[joint])
    acts = np.zeros(model.nu, bool)
    for position in np.linspace(lo, hi, PLACES):
        data.qpos[model.jnt_qposadr[joint]] = position
        mujoco.mj_fwdPosition(model, data)
        for k in range(model.nu):
            own = slice(data.moment_rowadr[k], data.moment_rowadr[k] + data.moment_rownnz[k])
            arms = data.actuator_moment[own][data.moment_colind[own] == dof]
            acts[k] |= bool(np.any(np.abs(arms) > MIN_MOMENT))
    acts &= model.actuator_trntype != mujoco.mjtTrn.mjTRN_BODY
    group = np.clip(model.actuator_group, 0, 31)
    acts &= (model.opt.disableactuator >> group) & 1 == 0
    return [int(k) for k in np.flatnonzero(acts)]


def actuators_on(model: mujoco.MjModel, joint: int) -> tuple[str, ...]:
    """The same by name, or "actuator 3" where it has none."""
    return tuple(model.actuator(k).name or f"actuator {k}" for k in acting_on(model, joint))


def drive_of(model: mujoco.MjModel, joint: int) -> Drive:
    """How the actuators on a joint drive it.

    Source: MuJoCo's documentation, Computation, Actuation model.

    Args:
        model: compiled.
        joint: id of a hinge or slide on which an actuator acts.

    Raises:
        JodaError: they act in a way that is not that of a `Servo`.
    """
    acting = acting_on(model, joint)
    names = actuators_on(model, joint)
    for number, name in zip(acting, names, strict=True):
        if reason := _unlike_a_servo(model, number, len(acting)):
            raise JodaError(
                f"actuator '{name}' on joint '{joint_name(model, joint)}' {reason}, and a log of "
                "its command is not supported; record the whole force on the joint as 'force' and "
                "leave the column out, or say with --passive that the actuator was off."
            )
    gear = model.actuator_gear[acting, 0]
    bias = (
        model.actuator_biasprm[acting, :3]
        * (model.actuator_biastype[acting] == mujoco.mjtBias.mjBIAS_AFFINE)[:, None]
    )
    low, high = -inf, inf
    if len(acting) == 1 and model.actuator_forcelimited[acting[0]]:
        low, high = sorted(float(x) for x in gear[0] * model.actuator_forcerange[acting[0]])
    if model.jnt_actfrclimited[joint]:
        least, most = map(float, model.jnt_actfrcrange[joint])
        low, high = max(low, least), min(high, most)
    limited = model.actuator_ctrllimited[acting].astype(bool)
    limited &= not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
    ranges = np.where(limited[:, None], model.actuator_ctrlrange[acting], (-inf, inf))
    stiffness, drag = (float(-(gear**2) @ bias[:, k]) for k in (1, 2))
    return Drive(
        names=names,
        servo=Servo(
            stiffness=stiffness,
            following=0.0 if stiffness else drag,
            damping=drag if stiffness else 0.0,
            low=low,
            high=high,
            delay=_delays(model, acting)[0],
        ),
        offset=float(gear @ bias[:, 0]),
        gains=gear * model.actuator_gainprm[acting, 0],
        low=ranges[:, 0],
        high=ranges[:, 1],
    )


def redriven(model: mujoco.MjModel, joint: int, servo: Servo) -> dict[int, dict[str, str]]:
    """Attributes of <general> elements that drive a joint as a servo does.

    Args:
        model: compiled, whose `drive_of` the servo was but for its gain and delay.
        joint: its id.
        servo: as it shall be.

    Returns:
        by the actuators' ids.
    """
    out = {}
    was = drive_of(model, joint).servo
    follows = not was.stiffness
    for k in acting_on(model, joint):
        gain = servo.gain * float(model.actuator_gainprm[k, 0])
        damps = servo.gain if follows else servo.damping / was.damping if was.damping else 1.0
        affine = int(model.actuator_biastype[k]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        bias = model.actuator_biasprm[k, :3] * affine
        bias = bias * (servo.gain, servo.gain, damps)
        lo, hi = (float(x) for x in model.actuator_ctrlrange[k])
        out[k] = {
            "gaintype": "fixed",
            "gainprm": f"{gain:.6g}",
            "biastype": "affine",
            "biasprm": " ".join(f"{x:.6g}" for x in bias),
        }
        if model.actuator_ctrllimited[k]:
            out[k]["ctrlrange"] = f"{lo:.9g} {hi:.9g}"
        if servo.delay != _delays(model, [k])[0]:
            samples = int(np.ceil(servo.delay / model.opt.timestep)) + 1
            out[k] |= {"delay": f"{servo.delay:.6g}", "nsample": str(samples)}
    return out


def _delays(model: mujoco.MjModel, acting: Sequence[int]) -> list[float]:
    """Of the actuators, s; older MuJoCos have none."""
    if not hasattr(model, "actuator_delay"):
        return [0.0] * len(acting)
    return [float(model.actuator_delay[k]) for k in acting]


def _unlike_a_servo(model: mujoco.MjModel, actuator: int, count: int) -> str:
    """Why an actuator, of `count` on its joint, is no part of a `Servo`; empty if it is."""
    on_joint = [int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)]
    affine = [int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)]
    own = [
        np.any(getattr(model, field)[actuator])
        for field in ("actuator_damping", "actuator_dampingpoly")
        if hasattr(model, field)
    ]
    reasons = {
        "does not act on the joint directly": model.actuator_trntype[actuator] not in on_joint,
        "has dynamics of its own (dyntype)": (
            model.actuator_dyntype[actuator] != mujoco.mjtDyn.mjDYN_NONE
        ),
        "has a gain that is not fixed": (
            model.actuator_gaintype[actuator] != mujoco.mjtGain.mjGAIN_FIXED
        ),
        "has a bias that is not affine": model.actuator_biastype[actuator] not in affine,
        "has damping besides its gain": any(own),
        "has a force limit and is not the only one there": (
            count > 1 and bool(model.actuator_forcelimited[actuator])
        ),
        "has a delay and is not the only one there": (
            count > 1 and bool(_delays(model, [actuator])[0])
        ),
    }
    return next((reason for reason, true in reasons.items() if true), "")
