"""What the scene's contacts bar: where a measured joint cannot have been if they were real."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.field import evaluate
from joda.measured import smoothing
from joda.measured.runs import QuasiStatic, Run
from joda.profile import Profile
from joda.scenes.contacts import Contact, pressing
from joda.scenes.context import Context

Array = NDArray[np.float64]

EXCESS = 3.0
"""A contact bars what needs so many times the energy and the force that a measurement had."""
PLACES = 401
"""Positions over the range at which the contacts' force is looked at."""


class Barrier:
    """The force with which contacts of a scene keep a joint out, over its range.

    A joint that enters a contact with the speed v under a force of at most P gets as far as
    ½ I v² = ∫ (F - P) dq, F being the contact's force against it.

    Attributes:
        joint: with its range.
        positions: over it, rad or m, shape (n,).
        force: of the contacts at each, N·m or N; NaN where there is none.
        inertia: of the joint, the largest, kg·m² or kg.
        own: largest force of gravity and the joint's own springs, N·m or N.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        joint: int,
        found: Context,
        profile: Profile,
        contacts: Sequence[Contact],
    ) -> None:
        """Looks along the range.

        Args:
            model: the compiled scene.
            joint: its id.
            found: the joint.
            profile: what acts on it by itself.
            contacts: that press on it somewhere.
        """
        self.joint = profile.joint
        self.positions = np.linspace(*profile.joint.range, PLACES)
        self.force = pressing(model, joint, profile.joint, contacts, self.positions)
        self.inertia = max(found.inertia)
        own = np.linspace(0, 1, PLACES)
        spring = profile.channels.conservative
        forces = np.interp(self.positions, found.positions, found.gravity_force)
        if spring.components:
            forces = forces + evaluate(spring, own)[0]
        self.own = float(np.abs(forces).max())

    def excludes(self, one: Run | QuasiStatic, room: float) -> NDArray[np.bool_]:
        """Which samples lie where neither speed nor force of the measurement can have brought it.

        Args:
            one: a run or a curve; of a run whose force is not known everywhere, or that an
                actuator drove, nothing is said.
            room: error of its positions, rad or m.
        """
        if np.isnan(one.force).any() or (isinstance(one, Run) and one.command is not None):
            return np.zeros(len(one.position), bool)
        push = EXCESS * (float(np.abs(one.force).max()) + self.own)
        energy = EXCESS * self.inertia * _speed(one) ** 2 / 2
        below = _needed(self.positions, -self.force - push)
        above = _needed(-self.positions[::-1], (self.force - push)[::-1])[::-1]
        needed = np.minimum(below, above)
        around = [one.position + shift for shift in (-room, 0.0, room)]
        least = np.min([np.interp(q, self.positions, needed) for q in around], axis=0)
        return np.asarray(least > energy)


def _needed(positions: Array, against: Array) -> Array:
    """Energy needed to get to each position from the free place below it; 0 at free places.

    Args:
        positions: increasing.
        against: force against the motion, less what pushes; NaN at free places.
    """
    work = most = np.inf  # from beyond the range there is no way
    out = np.zeros(len(positions))
    for k in range(len(positions)):
        if np.isnan(against[k]):
            work = most = 0.0
            continue
        work += against[k] * (positions[k] - positions[k - 1])
        most = max(most, work)
        out[k] = most
    return out


def _speed(one: Run | QuasiStatic) -> float:
    """Largest over a few samples, rad/s or m/s; that of a slow hand is 0."""
    if isinstance(one, QuasiStatic):
        return 0.0
    n = min(smoothing.MIN_SAMPLES, len(one.time) - 1)
    return float(
        np.max(np.abs(one.position[n:] - one.position[:-n]) / (one.time[n:] - one.time[:-n]))
    )
