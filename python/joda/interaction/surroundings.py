"""The scene around a joint, where more acts on it than a joint by itself feels."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from joda.profile import Profile
from joda.scenes.actuators import acting_on
from joda.scenes.assembly import at_others_limit, put, taut
from joda.scenes.attaching import in_scene
from joda.scenes.contacts import Contact, contacts_along
from joda.scenes.model import describe_joint, find_joint, joint_name, load_model
from joda.scenes.motion import at_home
from joda.scenes.unmodelled import unmodelled_elements

NEAR = 0.02
"""How near a contact (in normalised position) a joint that got stuck there may be."""
OVERLAPS = 0.9
"""What presses over more than this share of the range is no obstacle but drawn into each other."""
MAX_CONTACTS = 3
"""How many contacts are told, those with the largest force first."""


@dataclass(frozen=True)
class Surroundings:
    """A scene in which more acts on a joint than itself, gravity and stops at its range's ends.

    Attributes:
        path: of the model.
        joint: its name or address.
        contacts: over its whole range.
        unmodelled: tendons, equality constraints and media that act on it.
        reference: its position at the keyframe `home`, else its reference, normalised.
    """

    path: Path
    joint: str
    contacts: tuple[Contact, ...]
    unmodelled: tuple[str, ...]
    reference: float

    @property
    def words(self) -> str:
        """What acts on it."""
        return ", ".join(filter(None, [touching(self.contacts), self.acting]))

    @property
    def acting(self) -> str:
        """What acts on it besides contacts; empty if nothing does."""
        if not self.unmodelled:
            return ""
        does = "acts" if len(self.unmodelled) == 1 else "act"
        return f"{' and '.join(self.unmodelled)} {does} on joint '{self.joint}'"

    @property
    def remedy(self) -> str:
        """What to do about parts that overlap all along the way, or anywhere with what they are
        mounted on; empty if none do."""
        pressing = [one for one in self.contacts if one.presses]
        mounted = sorted({one.mounted for one in pressing if one.mounted})
        far = any(one.interval[1] - one.interval[0] > OVERLAPS for one in pressing)
        if not mounted and not far:
            return ""
        named = [f'"{base}" and "{body}"' for base, body in mounted if base and body]
        return (
            "; if parts that overlap all along the way are meant to pass, keep them from colliding "
            if far
            else "; a part that overlaps what it is mounted on MuJoCo lets pass, but not where "
            "that is fixed in the world: if it is meant to pass, keep them from colliding "
        ) + (
            'with <contact><exclude body1="..." body2="..."/></contact>'
            + (f", here {', '.join(named)}" if named else "")
        )

    def scene(self, profile: Profile) -> tuple[mujoco.MjModel, int]:
        """The scene with a profile on the joint, compiled, and the joint's id.

        Actuators on the joint are off: its behaviour is what it does by itself.
        """
        model = in_scene(self.path, profile, self.joint)
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

    def allows(self, model: mujoco.MjModel, joint: int, position: float) -> bool:
        """Whether its scene lets the joint be at a normalised position.

        Nothing presses there, what equality constraints couple to it can move along within its own
        range, and tendons reach so far.
        """
        ends = (one.interval for one in self.contacts if one.presses)
        if any(a <= position <= b for a, b in ends):
            return False
        lo, hi = model.jnt_range[joint]
        data = at_home(model)
        before = data.qpos.copy()
        there = put(model, data, joint, float(lo + position * (hi - lo)))
        beyond = at_others_limit(model, data, joint, before) or taut(model, data, joint)
        return there and not beyond


def surroundings(path: Path, joint: str) -> Surroundings | None:
    """What acts on the joint in its scene; None if nothing does. Raises JodaError."""
    model = load_model(path)
    number = find_joint(model, joint)
    described = describe_joint(model, number)
    found = contacts_along(model, number, described, described.range, home=True)
    felt = tuple(one for one in found if not one.stop)
    unmodelled = unmodelled_elements(model, number)
    if not felt and not unmodelled:
        return None
    lo, hi = described.range
    begins = at_home(model).qpos[model.jnt_qposadr[number]]
    reference = float(np.clip((begins - lo) / (hi - lo), 0, 1))
    return Surroundings(path, joint_name(model, number), felt, unmodelled, reference)


def touching(contacts: Sequence[Contact]) -> str:
    """The contacts with the largest forces in words."""
    hardest = sorted(contacts, key=lambda one: -one.force)[:MAX_CONTACTS]
    out = [
        f"'{one.geom}' touches '{one.other}' from s = {one.interval[0]:.2f} to "
        f"{one.interval[1]:.2f}"
        for one in hardest
    ]
    more = len(contacts) - len(out)
    return ", ".join(out) + (f" and {more} more contacts" if more else "")
