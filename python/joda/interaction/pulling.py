"""A slow hand that moves a joint from one place to another, and what it needs for that."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.component import Frozen
from joda.interaction.hand import finest, pull
from joda.scenes.context import Context
from joda.scenes.motion import FAST, Motion

Array = NDArray[np.float64]

GRIP = 60.0
"""What a hand can do at the end of the lever arm, N, if gravity does not ask for more."""

FIRMNESS = 1000.0
"""Stiffness of a hand at the end of the lever arm, N/m."""

SLOW, QUICKEST = 3.0, 1.0
"""How long (s) a hand takes from one end to the other, and how fast it goes at most (m/s) where a
joint turns many times."""


ACCELERATING = 0.05
"""Half of the time (s) over which an acceleration is the mean."""


class Pull(Frozen):
    """What a slow hand needs to move the joint from one end to the other.

    Attributes:
        arrived: whether a hand, of at most `grip`, can do it at all.
        force: the most that it took, or that was in vain, N·m or N.
        at: normalised position where it took that; where it got stuck, if it did.
        first, middle, last: the most within the first 15 % of the way, the median between 30 % and
            70 %, the most within the last 15 %; N·m or N, negative where the hand holds back.
        steady: the most that it took but for what set its mass in motion, N·m or N.
        held_by: what of the scene is in the way where it got stuck; empty if nothing is.
        snaps_at: normalised positions on the way where the joint ran ahead of the hand.
    """

    arrived: bool
    force: float
    at: float
    first: float
    middle: float
    last: float
    snaps_at: tuple[float, ...]
    steady: float | None = None
    held_by: str = ""


def grip(context: Context) -> float:
    """The largest generalised force of a hand, N·m or N."""
    return max(GRIP * context.lever_arm, 2 * context.gravity_scale)


def pulled(
    model: mujoco.MjModel, joint: int, begin: float, to: float, context: Context
) -> tuple[Pull, float]:
    """A slow hand from one normalised position to another, and how far it came."""
    arm, (lo, hi) = context.lever_arm, context.joint.range
    start, end = lo + begin * (hi - lo), lo + to * (hi - lo)
    stiffness = FIRMNESS * arm**2
    step = model.opt.timestep
    model.opt.timestep = min(step, finest(context.equivalent_inertia, stiffness))
    duration = max(SLOW, abs(end - start) * arm / QUICKEST)
    motion = pull(model, joint, start, end, grip(context), stiffness, duration)
    model.opt.timestep = step
    sign = np.sign(end - start)
    way = (motion.position - start) / (end - start)
    force = motion.force * sign
    arrived = bool(way[-1] >= 0.99)
    most = int(np.argmax(force)) if arrived else -1
    middle = force[(way >= 0.3) & (way <= 0.7)]
    last = force[way >= 0.85]
    ahead = motion.velocity * sign > FAST * abs(end - start) / duration
    begins = np.flatnonzero(ahead[1:] & ~ahead[:-1])
    s = (motion.position - lo) / (hi - lo)
    spent = np.maximum(sign * _inertial(motion, context), 0.0)  # no braking adds to it
    told = Pull(
        arrived=arrived,
        force=number(force[most]),
        at=number(np.clip(s[most], 0, 1)),
        first=number(force[way <= 0.15].max()),
        middle=number(np.median(middle)) if len(middle) else 0.0,
        last=number(last.max()) if len(last) else 0.0,
        snaps_at=apart(s[begins]),
        steady=number((force - spent).max()) if arrived else None,
    )
    return told, float(np.clip(s[-1], 0, 1))


def _inertial(motion: Motion, context: Context) -> Array:
    """Generalised force that sets the joint's own inertia in motion, N·m or N, over a motion.

    The acceleration is the mean over a tenth of a second: nothing else is meant to be left out.
    """
    count = max(int(np.searchsorted(motion.time, ACCELERATING)), 1)
    width = np.ones(2 * count + 1) / (2 * count + 1)
    padded = np.pad(motion.velocity, count, mode="edge")
    smooth = np.convolve(padded, width, mode="valid")
    return np.asarray(context.equivalent_inertia * np.gradient(smooth, motion.time))


def apart(positions: Array) -> tuple[float, ...]:
    """Groups of normalised positions, each by its mean."""
    if not len(positions):
        return ()
    inside = np.sort(positions)
    groups = np.split(inside, np.flatnonzero(np.diff(inside) > 0.02) + 1)
    return tuple(number(group.mean()) for group in groups)


def number(value: float) -> float:
    """Four significant digits and no finer than 1e-9: facts, not noise."""
    return float(f"{value:.4g}") + 0.0 if abs(value) > 1e-9 else 0.0
