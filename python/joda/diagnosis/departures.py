"""What a model gave: which of its numbers a fit has moved, and the profile with those put back."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from joda.component import Component
from joda.diagnosis.overlap import Interval, overlap, places
from joda.diagnosis.settings import SETTINGS
from joda.effects import AnyEffect, written_as
from joda.field import evaluate
from joda.profile import CHANNELS, Channel, Channels, Joint, Profile

GRID = np.linspace(0, 1, 201)
"""Positions at which curves are compared."""
EFFECTS = "effects"


@dataclass(frozen=True)
class ChangedPart:
    """A component or an effect that a model gave, changed by a fit by much (`model_error`).

    Attributes:
        where: its channel, or `EFFECTS`.
        what: its number in the channel, or its key.
        described: its name, and its numbers before and after.
    """

    where: str
    what: int | str
    described: str


@dataclass(frozen=True)
class Departures:
    """By what a fitted profile is not what was given and diagnosed.

    Attributes:
        parts: of the model as given that it changes by much (`model_error`).
        changed: the same as sentences; None if there are none.
        elsewhere: that its effect acts elsewhere than diagnosed, a sentence; None if it does not.
    """

    parts: tuple[ChangedPart, ...] = ()
    changed: str | None = None
    elsewhere: str | None = None

    @property
    def sentences(self) -> tuple[str, ...]:
        """Both."""
        return tuple(one for one in (self.changed, self.elsewhere) if one)


FAITHFUL = Departures()
"""By nothing."""


def departures(
    given: Profile, profile: Profile, effect: str, near: Interval | None = None
) -> Departures:
    """By what a fitted profile is not what was given and diagnosed.

    Args:
        given: the model as it was.
        profile: fitted, with an effect more.
        effect: its name.
        near: where it was diagnosed, in normalised position, if that is known.
    """
    parts = changed_parts(given, profile, effect)
    changed = elsewhere = None
    if parts:
        percent = 100 * SETTINGS.adding.model_error
        changed = (
            f"The fit changes what the model gave by more than {percent:.0f} %: "
            f"{', '.join(part.described for part in parts)}. With that as given, no fit does as "
            "well on what was held out."
        )
    there = places(profile, effect, given)
    if near and all(overlap(one, near) < SETTINGS.adding.min_overlap for one in there):
        (a, b), (c, d) = there[0], near
        elsewhere = (
            f"{effect} acts at s = {a:.2f} to {b:.2f}, diagnosed at s = {c:.2f} to {d:.2f}. No fit "
            "near that place does as well on what was held out."
        )
    return Departures(parts, changed, elsewhere)


def changed_parts(given: Profile, profile: Profile, effect: str) -> tuple[ChangedPart, ...]:
    """What a fit has changed of what a model gave.

    Args:
        given: the model as it was; its components are the first of the profile's.
        profile: fitted.
        effect: that was added: what has its name is not meant to stay as it was given.
    """
    out = []
    for name in CHANNELS:
        old, new = (getattr(one.channels, name).components for one in (given, profile))
        for number, pair in enumerate(zip(old, new, strict=False)):
            if pair[0].label != effect and (told := _curve(*pair, name, given.joint)):
                out.append(ChangedPart(name, number, told))
    now, listed = {one.key: one for one in profile.effects}, written_as(effect)
    for old in given.effects:
        new = now[old.key]
        if old.effect != listed and _differs(old, new):
            out.append(ChangedPart(EFFECTS, old.key, f"{old.described()} → {new.described()}"))
    return tuple(out)


def given_parts(given: Profile, effect: str) -> tuple[ChangedPart, ...]:
    """All that a model gave, but what has an effect's name."""
    channels = [(name, getattr(given.channels, name).components) for name in CHANNELS]
    curves = [
        ChangedPart(name, number, one.label)
        for name, components in channels
        for number, one in enumerate(components)
        if one.label != effect
    ]
    listed = written_as(effect)
    others = [
        ChangedPart(EFFECTS, one.key, one.key) for one in given.effects if one.effect != listed
    ]
    return (*curves, *others)


def restored(profile: Profile, given: Profile, parts: Collection[ChangedPart]) -> Profile:
    """The profile with some parts as the model gave them."""
    back = {(part.where, part.what) for part in parts}
    channels = {}
    for name in CHANNELS:
        channel = getattr(profile.channels, name)
        own = list(channel.components)
        for number, old in enumerate(getattr(given.channels, name).components):
            if (name, number) in back:
                own[number] = old
        channels[name] = channel.model_copy(update={"components": tuple(own)})
    old = {one.key: one for one in given.effects if (EFFECTS, one.key) in back}
    effects = tuple(old.get(one.key, one) for one in profile.effects)
    return profile.model_copy(update={"channels": Channels(**channels), "effects": effects})


def _curve(old: Component, new: Component, channel: str, joint: Joint) -> str | None:
    """Its value where it changed most, before and after; None if that is within its error."""
    before, after = (evaluate(Channel(components=(one,)), GRID)[0] for one in (old, new))
    change = np.abs(after - before)
    if change.max() <= SETTINGS.adding.model_error * np.abs(before).max():
        return None
    unit = joint.unit_of(channel)
    at = int(np.argmax(change))
    where = (
        ""
        if np.ptp(change) <= SETTINGS.adding.model_error * change.max()
        else f" at s = {GRID[at]:.2f}"
    )
    return f"{old.label or channel} {before[at]:.3g} → {after[at]:.3g} {unit}{where}"


def _differs(old: AnyEffect, new: AnyEffect) -> bool:
    """Whether one of its numbers is off by more than its error."""
    for key in (*old.parameters(), "y"):
        before, after = (getattr(one, key, 0.0) for one in (old, new))
        if not isinstance(before, str):
            change = np.abs(np.subtract(after, before)).max()
            if change > SETTINGS.adding.model_error * np.abs(before).max():
                return True
    return False
