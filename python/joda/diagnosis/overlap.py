"""What a profile has of an effect, where that acts, and the rest of the profile."""

import numpy as np
from numpy.typing import NDArray

from joda.effects import written_as
from joda.field import evaluate
from joda.profile import CHANNELS, Channels, Profile

Array = NDArray[np.float64]
Interval = tuple[float, float]

LEVELS = (0.2, 0.1, 0.05)
"""Parts of its size from which an effect acts: of most; of a free curve; of a magnet, whose pull
runs out slowly."""
EVEN = 1e-12
"""N·m, N, or these per velocity, up to which there is nothing, or no rise."""
GRID = 401
"""Positions at which that is looked for."""


def divided(profile: Profile, effect: str, given: Profile | None = None) -> tuple[Profile, Profile]:
    """What a profile has of an effect, and the rest.

    Args:
        profile: divided by the labels of its components and the names of its effects.
        effect: a name; what it is written as counts (`joda.effects.written_as`).
        given: what this had of the effect already counts among the rest; its components are the
            first of the profile's.
    """
    return _some(profile, effect, given, own=True), _some(profile, effect, given, own=False)


def _some(profile: Profile, effect: str, given: Profile | None, *, own: bool) -> Profile:
    keys = {one.key for one in given.effects} if given else set()
    listed = written_as(effect)
    channels = {}
    for name in CHANNELS:
        channel = getattr(profile.channels, name)
        there = len(getattr(given.channels, name).components) if given else 0
        parts = enumerate(channel.components)
        kept = tuple(c for k, c in parts if (k >= there and c.label == effect) is own)
        channels[name] = channel.model_copy(update={"components": kept})
    effects = tuple(
        one for one in profile.effects if (one.effect == listed and one.key not in keys) is own
    )
    return profile.model_copy(update={"channels": Channels(**channels), "effects": effects})


def places(profile: Profile, effect: str, given: Profile | None = None) -> list[Interval]:
    """Where a profile's effect acts, in normalised position, by each of the levels: of its force,
    and of how far that rises above its least value.

    All over the range if it is a law, where it has no interval.

    Args:
        profile: that has it.
        effect: its name.
        given: see `divided`.
    """
    own = divided(profile, effect, given)[0]
    for name in CHANNELS:  # a catch has friction beside its force: the force comes first
        channel = getattr(own.channels, name)
        if channel.components:
            value = np.abs(evaluate(channel, np.linspace(0, 1, GRID))[0])
            return [_felt(own, level) for own in (value, value - value.min()) for level in LEVELS]
    return [getattr(one, "interval", (0.0, 1.0)) for one in own.effects] or [(0.0, 1.0)]


def _felt(value: Array, level: float) -> Interval:
    """Where values over the range are at least that part of the largest."""
    if value.max() <= EVEN:
        return 0.0, 1.0
    there = np.flatnonzero(value >= level * value.max())
    return float(there[0]) / (GRID - 1), float(there[-1]) / (GRID - 1)


def overlap(first: Interval, second: Interval) -> float:
    """Intersection over union of two intervals."""
    (a, b), (c, d) = first, second
    return max(min(b, d) - max(a, c), 0.0) / (max(b, d) - min(a, c))
