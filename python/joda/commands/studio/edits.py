"""Edits of a profile: each makes a new one, which is valid whatever is asked for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from joda.component import MAX_VALUE, Component
from joda.profile import Channel, Profile, rounded

END = 0.015
"""What is dragged so near to an end of the joint's range goes there."""
GAP = 2e-3
"""Least distance between control points that are dragged, in normalised position."""
DRAWN = "drawn by hand"
"""Label of a component that began as a click."""


@dataclass(frozen=True)
class Handle:
    """A control point.

    Attributes:
        channel: conservative, friction or damping.
        component: its number in the channel.
        point: its number in the component.
    """

    channel: str
    component: int
    point: int


def positions(component: Component) -> list[float]:
    """Normalised joint positions of a component's control points."""
    a, b = component.interval
    return [a + x * (b - a) for x in component.x]


def moved(profile: Profile, handle: Handle, s: float, y: float) -> Profile:
    """The profile with a control point elsewhere, but not past its neighbours.

    The first and the last point of a component are the ends of its interval; the points between
    them stay where they are.

    Args:
        profile: before.
        handle: which point.
        s: where to, in normalised position.
        y: to which value, in the channel's unit; friction and damping are nowhere negative.
    """
    old = _component(profile, handle)
    places, last = positions(old), len(old.x) - 1
    left = places[handle.point - 1] + GAP if handle.point else 0.0
    right = places[handle.point + 1] - GAP if handle.point < last else 1.0
    s = 0.0 if s < END else 1.0 if s > 1 - END else s
    s = rounded(float(np.clip(s, left, right))) if left < right else places[handle.point]
    values = list(old.y)
    values[handle.point] = _value(handle.channel, y)
    if 0 < handle.point < last:
        a, b = old.interval
        x = list(old.x)
        x[handle.point] = rounded((s - a) / (b - a))
        new = Component(label=old.label, interval=old.interval, x=tuple(x), y=tuple(values))
    elif s == places[handle.point]:
        new = Component(label=old.label, interval=old.interval, x=old.x, y=tuple(values))
    else:
        places[handle.point] = s
        new = _through(old.label, places, values)
    return _with(profile, handle.channel, handle.component, new)


def inserted(profile: Profile, channel: str, component: int, s: float, y: float) -> Profile:
    """The profile with a control point more; unchanged where one is there already, or none fits.

    Outside of the component's interval, the point becomes its new end.
    """
    old = _component(profile, Handle(channel, component, 0))
    places, values = positions(old), list(old.y)
    s = rounded(float(np.clip(s, 0.0, 1.0)))
    if min(abs(s - place) for place in places) < GAP:
        return profile
    at = int(np.searchsorted(places, s))
    places.insert(at, s)
    values.insert(at, _value(channel, y))
    return _with(profile, channel, component, _through(old.label, places, values))


def removed(profile: Profile, handle: Handle) -> Profile:
    """The profile without a control point; without its component if it had only two."""
    old = _component(profile, handle)
    if len(old.x) <= 2:
        return _with(profile, handle.channel, handle.component, None)
    places, values = positions(old), list(old.y)
    del places[handle.point], values[handle.point]
    new = _through(old.label, places, values)
    return _with(profile, handle.channel, handle.component, new)


def begun(profile: Profile, channel: str, s: float, y: float) -> Profile:
    """The profile with a new component: a hill of height y at s, zero from a quarter away on."""
    a, b = max(s - 0.25, 0.0), min(s + 0.25, 1.0)
    peak = float(np.clip(s, a + 0.05, b - 0.05))
    new = _through(DRAWN, [rounded(a), rounded(peak), rounded(b)], [0.0, _value(channel, y), 0.0])
    return profile.with_component(channel, new)


def without_component(profile: Profile, channel: str, component: int) -> Profile:
    """The profile without a component."""
    return _with(profile, channel, component, None)


def without_effect(profile: Profile, number: int) -> Profile:
    """The profile without one of its effects."""
    kept = tuple(effect for k, effect in enumerate(profile.effects) if k != number)
    return profile.model_copy(update={"effects": kept})


def _component(profile: Profile, handle: Handle) -> Component:
    channel: Channel = getattr(profile.channels, handle.channel)
    return channel.components[handle.component]


def _value(channel: str, y: float) -> float:
    least = -MAX_VALUE if channel == "conservative" else 0.0
    return rounded(float(np.clip(y, least, MAX_VALUE)))


def _through(label: str, places: Sequence[float], values: Sequence[float]) -> Component:
    """The component with control points at these normalised positions."""
    a, b = places[0], places[-1]
    inner = (rounded((place - a) / (b - a)) for place in places[1:-1])
    return Component(label=label, interval=(a, b), x=(0.0, *inner, 1.0), y=tuple(values))


def _with(profile: Profile, channel: str, number: int, new: Component | None) -> Profile:
    """The profile with a component in the place of one, or without it."""
    old: Channel = getattr(profile.channels, channel)
    kept = list(old.components)
    kept[number : number + 1] = [new] if new else []
    changed = type(old)(combine=old.combine, components=tuple(kept))
    channels = profile.channels.model_copy(update={channel: changed})
    return profile.model_copy(update={"channels": channels})
