"""Measurements where the scene touches the joint: what is left out of them, and what is said.

Replays move the joint by itself. Where a contact of the scene would hinder it that is another
motion, so what was measured there is neither replayed nor fitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.measured import smoothing
from joda.measured.barrier import Barrier
from joda.measured.runs import MIN_SAMPLES, QuasiStatic, Run, known
from joda.profile import Joint, Profile
from joda.scenes.contacts import Contact, contacts_along
from joda.scenes.context import Context

Measurement = Run | QuasiStatic

ROOM = 3.0
"""How near a contact, in noises of the position, counts as within it."""
MAX_CONTACTS = 3
"""How many contacts are told, those with the largest force first."""


@dataclass(frozen=True)
class Clear:
    """What is left of measurements where the scene hinders the joint.

    Attributes:
        measured: runs and curves, without what was measured within contacts: in a run the force is
            NaN there, and it begins and ends outside.
        contacts: found along what they visit.
        notes: what was found and left out, a sentence each.
        barred: where and in what the joint was measured although the scene would not have let it
            there, a sentence; empty if that is not so.
    """

    measured: list[Measurement]
    contacts: tuple[Contact, ...]
    notes: list[str]
    barred: str = ""


def clear_of_contacts(
    model: mujoco.MjModel,
    joint: int,
    found: Context,
    profile: Profile,
    read: Sequence[Measurement],
) -> Clear:
    """Finds the contacts along the measured path, and leaves out what lies within them.

    Args:
        model: the compiled scene.
        joint: its id.
        found: the joint.
        profile: what acts on it by itself, and its range.
        read: runs and curves, whose positions are of this joint.

    Raises:
        JodaError: nothing is left.
    """
    described = profile.joint
    if any(isinstance(one, Run) and one.among for one in read):  # see joda.measured.contact_samples
        return Clear(list(read), (), [])
    places = np.clip(np.concatenate([one.position for one in read]), *described.range)
    path = float(places.min()), float(places.max())
    contacts = contacts_along(model, joint, described, path)
    notes = [_rubbing(one, described) for one in contacts if one.along]
    hindering = [one for one in contacts if one.hinders]
    if not hindering:
        return Clear(list(read), contacts, notes)
    left, lost = [], []
    for one in read:
        inside = _within(one, hindering)
        part = _without(one, inside)
        if part is not None:
            left.append(part)
        if inside.any():
            of = f"{inside.sum()} of {len(inside)}" if part else "all"
            lost.append(f"{of} samples of {one.name}")
    if not lost:
        return Clear(list(read), contacts, notes)
    told = _touching(hindering, described)
    barred = _barred(Barrier(model, joint, found, profile, hindering), read, hindering)
    if not left:
        refusal = (
            f"{told}; that is where {_files(read)} lie, and a replay of the joint by itself would "
            f"be another motion; {REMEDY}."
        )
        raise JodaError(" ".join(filter(None, [barred, refusal])))
    notes.append(f"{told}; left out there: {', '.join(lost)}. {REMEDY[0].upper()}{REMEDY[1:]}.")
    return Clear(left, contacts, [*notes, *filter(None, [barred])], barred)


REMEDY = (
    "if the real joint is free there, move the geoms apart or exclude the pair "
    '(<contact><exclude body1="..." body2="..."/></contact>)'
)


def _barred(barrier: Barrier, read: Sequence[Measurement], contacts: Sequence[Contact]) -> str:
    """A sentence on where the joint was measured although contacts bar it, or nothing."""
    counts, pairs = [], {}
    for one in read:
        deep = barrier.excludes(one, _room(one))
        if deep.any():
            counts.append(f"{deep.sum()} of {len(deep)} samples of {one.name}")
        for contact in contacts:
            a, b = contact.path
            if np.any(deep & (a <= one.position) & (one.position <= b)):
                pairs[_pair(contact)] = contact
    if not counts:
        return ""
    where = "; ".join(
        f"{pair} from s = {one.interval[0]:.3f} to {one.interval[1]:.3f}"
        for pair, one in list(pairs.items())[:MAX_CONTACTS]
    )
    return (
        f"The scene blocks joint '{barrier.joint.name}' where it was measured to move: {where}, "
        f"and {', '.join(counts)} lie deeper in that than speed and forces can bring it; the scene "
        "is wrong there, or the position's zero or sign."
    )


def _within(one: Measurement, contacts: Sequence[Contact]) -> NDArray[np.bool_]:
    """Which samples lie in a contact, or reach it before the next one; shape (n,)."""
    position = one.position
    room = _room(one)
    steps = np.abs(np.diff(position, prepend=position[:1], append=position[-1:]))
    reach = np.maximum(steps[1:], steps[:-1]) if isinstance(one, Run) else np.zeros(len(position))
    away = [np.maximum(c.path[0] - position, position - c.path[1]) for c in contacts]
    return np.asarray(np.min(away, axis=0) <= np.maximum(room, reach))


def _room(one: Measurement) -> float:
    """How near a contact counts as within it, rad or m."""
    return ROOM * smoothing.noise(one.time, one.position) if isinstance(one, Run) else 0.0


def _without(one: Measurement, inside: NDArray[np.bool_]) -> Measurement | None:
    """The measurement without these samples; None if too little is left."""
    if not inside.any():
        return one
    if isinstance(one, QuasiStatic):
        kept = ~inside
        if kept.sum() < MIN_SAMPLES:
            return None
        return QuasiStatic(one.name, one.position[kept], one.force[kept])
    masked = replace(one, force=np.where(inside, np.nan, one.force))
    pieces = known(masked)
    if not pieces:
        return None
    return masked.part(slice(pieces[0][0], pieces[-1][-1] + 1))


def _touching(contacts: Sequence[Contact], joint: Joint) -> str:
    """Where the scene hinders the joint, without the full stop."""
    hardest = sorted(contacts, key=lambda one: -one.force)
    told = "; ".join(
        f"{_pair(one)} from s = {one.interval[0]:.3f} to {one.interval[1]:.3f} "
        f"({one.path[0]:.4g} to {one.path[1]:.4g} {joint.unit}), with up to {one.force:.3g} "
        f"{joint.force_unit}"
        for one in hardest[:MAX_CONTACTS]
    )
    more = (
        f"; and {len(contacts) - MAX_CONTACTS} contacts more"
        if len(contacts) > MAX_CONTACTS
        else ""
    )
    return f"In the scene joint '{joint.name}' is not free: {told}{more}"


def _rubbing(one: Contact, joint: Joint) -> str:
    return (
        f"In the scene {_pair(one)} wherever the joint was, with up to {one.force:.3g} "
        f"{joint.force_unit}; the replay is without that, so that friction which is found comes on "
        f"top of it there: exclude the pair, or set its friction to zero."
    )


def _pair(one: Contact) -> str:
    return f"'{one.geom}' touches '{one.other}'"


def _files(read: Sequence[Measurement]) -> str:
    names = [one.name for one in read]
    return ", ".join(names[:MAX_CONTACTS]) + (
        f" and {len(names) - MAX_CONTACTS} more" * (len(names) > MAX_CONTACTS)
    )
