"""The scene around a joint, where it touches what the joint moves."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from joda._attach import attach
from joda.profile import Profile
from joda.scenes.actuators import acting_on
from joda.scenes.contacts import Contact, contacts_along
from joda.scenes.model import describe_joint, find_joint, joint_name, load_model

NEAR = 0.02
"""How near a contact (in normalised position) a joint that got stuck there may be."""
TOLD = 3
"""How many contacts are told, those with the largest force first."""


@dataclass(frozen=True)
class Surroundings:
    """A scene that touches what a joint moves, other than as a stop at an end of its range.

    Attributes:
        path: of the model.
        joint: its name or address.
        contacts: over its whole range.
        reference: its reference position, normalised.
    """

    path: Path
    joint: str
    contacts: tuple[Contact, ...]
    reference: float

    def scene(self, profile: Profile) -> tuple[mujoco.MjModel, int]:
        """The scene with a profile on the joint, compiled, and the joint's id.

        Actuators on the joint are off: its behaviour is what it does by itself.
        """
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "scene.xml")
            attach(self.path, profile, path, joint=self.joint)
            model = load_model(path)
        number = find_joint(model, self.joint)
        for actuator in acting_on(model, number):
            model.actuator_gainprm[actuator] = model.actuator_biasprm[actuator] = 0.0
        return model, number

    def near(self, position: float) -> tuple[Contact, ...]:
        """What touches it at a normalised position, or beside it."""
        return tuple(
            one
            for one in self.contacts
            if one.interval[0] - NEAR <= position <= one.interval[1] + NEAR
        )

    def inside(self, position: float) -> bool:
        """Whether something presses at a normalised position."""
        ends = (one.interval for one in self.contacts if one.presses)
        return any(a <= position <= b for a, b in ends)


def surroundings(path: Path, joint: str) -> Surroundings | None:
    """What touches the joint in its scene; None if nothing does. Raises JodaError."""
    model = load_model(path)
    number = find_joint(model, joint)
    described = describe_joint(model, number)
    found = contacts_along(model, number, described, described.range)
    felt = tuple(one for one in found if not one.stop)
    if not felt:
        return None
    lo, hi = described.range
    reference = float(np.clip((model.qpos0[model.jnt_qposadr[number]] - lo) / (hi - lo), 0, 1))
    return Surroundings(path, joint_name(model, number), felt, reference)


def told(contacts: Sequence[Contact]) -> str:
    """The contacts with the largest forces in words."""
    hardest = sorted(contacts, key=lambda one: -one.force)[:TOLD]
    out = [
        f"'{one.geom}' touches '{one.other}' from s = {one.interval[0]:.2f} to "
        f"{one.interval[1]:.2f}"
        for one in hardest
    ]
    more = len(contacts) - len(out)
    return ", ".join(out) + (f" and {more} more contacts" if more else "")
