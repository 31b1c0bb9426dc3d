"""What of a joint a fit may change, as a vector, and what must stay true of it.

Numbers are made comparable: a control point in units of its component's largest magnitude, an
interval's end in normalised position, inertia, the damping ratio and sizes as logarithms.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.effects import Backlash, Effect, LearnedForce
from joda.effects.backlash import HEAVIEST
from joda.estimation.least_squares import Inequalities
from joda.profile import CHANNELS, Profile, rounded
from joda.scenes.context import Context

Array = NDArray[np.float64]
Kind = Literal[
    "values",
    "intervals",
    "strengths",
    "damping_ratio",
    "inertia",
    "gravity",
    "effects",
    "sizes",
    "places",
]
KINDS: tuple[Kind, ...] = get_args(Kind)[:-3]
"""What `joda refine` fits; effects' numbers are fitted by `joda.diagnosis.adding`, components'
sizes before all else, and the places of those that have one interval together."""

FARTHEST, LOGARITHM = 1e4, 8.0
"""Largest number, and largest logarithm of a size, that counts: a step may lead further."""
NARROWEST, LEAST_WIDTH = 0.005, 1e-4
"""Least width of an interval, in normalised position, of a fit and of all that it tries. Points of
a curve that are closer than the first are an edge, of which runs tell no shape."""

NOTHING = 1e-5
"""Part of a curve's largest value, below which a value or a rise is one that a fit held at zero."""
SIGNED = ("sin", "cos", "force")
"""Numbers of effects that may have either sign."""
LARGEST = {"breakaway": 1.0, "restitution": 0.95, "share": 0.99}
MIN_FACTOR_LEFT = 0.02
"""Least part of an effect's number that a fit may leave."""

PRIOR_STD: dict[Kind, float] = {
    "values": 0.5,
    "intervals": 0.1,
    "strengths": 0.5,
    "damping_ratio": 0.7,
    "inertia": 0.2,
    "gravity": 0.2,
    "effects": 0.5,
    "sizes": 1.2,
    "places": 0.1,
}
"""How far (one standard deviation) a number may be from its first value before any data."""
UNSEEN = 0.1
"""Least part of that which a control point has where no run was: as much as runs have seen of what
it bends, as the curve beside them is no reason to bend the rest."""


@dataclass(frozen=True)
class Slot:
    """One number of the vector.

    Attributes:
        kind: what it is.
        channel: of a value, an interval's end or a strength.
        component: number of the component in its channel.
        index: number of the control point; 0 and 1 of an interval's ends; 0 and 1 of gravity.
        key: of an effect's number: which of its parameters; the effect is `component`.
    """

    kind: Kind
    channel: str = ""
    component: int = 0
    index: int = 0
    key: str = ""


class Parameters:
    """The numbers of a profile that a fit may change.

    Attributes:
        profile: to be changed.
        kinds: of numbers that may change.
        slots: what each number is.
        start: the numbers as they are, shape (n,).
        scales: what one unit of each is in the profile, shape (n,).
        prior_std: standard deviations before any data, shape (n,).
        constraints: what must stay true: friction and damping not negative, intervals in order and
            within the range, and, if shapes are kept, each part of a curve rising, falling or of
            the sign that it is.
    """

    def __init__(
        self,
        profile: Profile,
        kinds: Collection[Kind],
        *,
        keep_shape: bool = True,
        gravity: float = 1.0,
        inertia: float = np.inf,
        away: Sequence[tuple[float, float]] = (),
    ) -> None:
        """Lists the numbers.

        Args:
            profile: to be changed.
            kinds: of numbers that may change.
            keep_shape: see `constraints`.
            gravity: the unit of a gravity offset, N·m or N, see `gravity_scale`.
            inertia: of the joint, kg·m² or kg; what is beyond a play is part of it.
            away: parts of the range where no run was, in normalised position.
        """
        self.profile = profile
        self.kinds = tuple(kinds)
        self._made: Callable[[Profile, Collection[Kind]], Parameters] = partial(
            Parameters, keep_shape=keep_shape, gravity=gravity, inertia=inertia, away=away
        )
        self._alike = _alike(profile)
        firsts = {group[0] for group in self._alike.values()}
        slots: list[Slot] = []
        start: list[float] = []
        rows: list[tuple[dict[int, float], float]] = []
        for name in CHANNELS:
            components = getattr(profile.channels, name).components
            if "strengths" in kinds and components:
                rows.append(({len(slots): 1.0}, 0.0))
                slots.append(Slot("strengths", name))
                start.append(1.0)
            for number, component in enumerate(components):
                if "sizes" in kinds and any(component.y):
                    slots.append(Slot("sizes", name, number))
                    start.append(0.0)
                if "values" in kinds:
                    _values(name, number, component, keep_shape, slots, start, rows)
                alike = (name, number) in firsts and "places" in kinds
                if "intervals" in kinds or alike:
                    kind: Kind = "places" if alike else "intervals"
                    _interval(name, number, component, slots, start, rows, kind)
        if "effects" in kinds:
            for number, effect in enumerate(profile.effects):
                _effect(number, effect, inertia, slots, start, rows)
        if "damping_ratio" in kinds:
            slots.append(Slot("damping_ratio"))
            start.append(0.0)
        if "inertia" in kinds:
            slots.append(Slot("inertia"))
            start.append(0.0)
        if "gravity" in kinds:
            # a slide's weight is one number, a hinge's a cosine and a sine
            count = 2 if profile.joint.type == "hinge" else 1
            slots += [Slot("gravity", index=k) for k in range(count)]
            start += [0.0] * count
        self.slots = tuple(slots)
        self.start = np.array(start)
        self.scales = np.array([_scale(profile, slot, gravity) for slot in slots])
        seen = [max(_seen(profile, slot, away), UNSEEN) for slot in slots]
        self.prior_std = np.array([PRIOR_STD[slot.kind] for slot in slots]) * seen
        farthest = [LOGARITHM if slot.kind == "sizes" else FARTHEST for slot in slots]
        self._farthest = np.array(farthest)
        G = np.zeros((len(rows), len(slots)))
        for row, (terms, _) in enumerate(rows):
            for column, factor in terms.items():
                G[row, column] = factor
        self.constraints = Inequalities(G, np.array([least for _, least in rows]))

    def _interval_of(self, slot: Slot) -> tuple[float, float]:
        components = getattr(self.profile.channels, slot.channel).components
        interval: tuple[float, float] = components[slot.component].interval
        return interval

    def about(self, profile: Profile, kinds: Collection[Kind] | None = None) -> "Parameters":
        """The same numbers, or those of other kinds, of another profile of the same form."""
        return self._made(profile, kinds or self.kinds)

    def number(self, theta: Array, kind: Kind, index: int = 0) -> float:
        """One of the numbers in its unit, by kind and index; 0 where it is not among them."""
        pairs = zip(self.slots, theta * self.scales, strict=True)
        return next((float(x) for s, x in pairs if (s.kind, s.index) == (kind, index)), 0.0)

    def written(self, theta: Array, *, exact: bool = False) -> Profile:
        """The profile with these numbers, to six digits unless `exact`."""
        content = self.profile.model_dump()
        theta = np.clip(theta, -self._farthest, self._farthest)
        for slot, value in zip(self.slots, theta * self.scales, strict=True):
            if slot.kind == "effects":
                effect, number = content["effects"][slot.component], float(value)
                number = number if exact else rounded(number)
                if slot.key == "y":
                    y = list(effect["y"])
                    y[slot.index] = max(number, 0.0)
                    effect["y"] = y
                else:  # a step for differences may lead beyond
                    effect[slot.key] = min(number, LARGEST.get(slot.key, np.inf))
            if slot.kind not in ("values", "intervals", "sizes", "places"):
                continue
            components = content["channels"][slot.channel]["components"]
            if slot.kind == "sizes":
                own = components[slot.component]
                own["y"] = [float(np.exp(value)) * y for y in own["y"]]
            elif slot.kind == "values":
                y = list(components[slot.component]["y"])
                y[slot.index] = value
                components[slot.component]["y"] = y
            else:
                several = (
                    self._alike[self._interval_of(slot)]
                    if slot.kind == "places"
                    else [(slot.channel, slot.component)]
                )
                end = min(max(float(value), 0.0), 1.0)
                for channel, number in several:
                    other = content["channels"][channel]["components"][number]
                    ends = list(other["interval"])
                    ends[slot.index] = end if exact else round(end, 6)
                    other["interval"] = ends
        gravity = [
            x for s, x in zip(self.slots, theta * self.scales, strict=True) if s.kind == "gravity"
        ]
        if gravity:
            content["effects"] = _tilted(content["effects"], gravity, exact)
        for slot, value in zip(self.slots, theta, strict=True):
            if slot.kind == "strengths":
                for component in content["channels"][slot.channel]["components"]:
                    component["y"] = [value * y for y in component["y"]]
        for name in CHANNELS:
            for component in content["channels"][name]["components"]:
                a, b = component["interval"]
                if b < a + LEAST_WIDTH:  # a step for differences may lead there
                    a = min(a, 1 - LEAST_WIDTH)
                    component["interval"] = [a, a + LEAST_WIDTH]
                floor = -np.inf if name == "conservative" else 0.0
                kept = [max(y, floor) for y in component["y"]]
                component["y"] = kept if exact else [rounded(y) for y in kept]
        return Profile.model_validate(content)


def _alike(profile: Profile) -> dict[tuple[float, float], list[tuple[str, int]]]:
    """Components by their intervals, each by its channel and number."""
    out: dict[tuple[float, float], list[tuple[str, int]]] = {}
    for name in CHANNELS:
        for number, component in enumerate(getattr(profile.channels, name).components):
            out.setdefault(component.interval, []).append((name, number))
    return out


def _tilted(effects: Sequence[dict[str, Any]], more: Sequence[float], exact: bool) -> list[Any]:
    """The effects with a gravity offset more: of cos q and sin q, or a slide's force."""
    offset: dict[str, Any] = {"effect": "gravity_offset"}
    others = [effect for effect in effects if effect["effect"] != offset["effect"]]
    was = next((effect for effect in effects if effect not in others), {})
    for key, by in zip(("cos", "sin") if len(more) == 2 else ("force",), more, strict=True):
        whole = was.get(key, 0.0) + float(by)
        offset[key] = whole if exact else rounded(whole)
    return [*others, offset] if any(offset[key] for key in offset if key != "effect") else others


Rows = list[tuple[dict[int, float], float]]


def gravity_scale(context: Context, profile: Profile) -> float:
    """The unit of a gravity offset, N·m or N: gravity's largest force, or the profile's."""
    components = profile.channels.conservative.components
    return max(context.gravity_scale, *(abs(y) for c in components for y in c.y), 1e-9)


def _seen(profile: Profile, slot: Slot, away: Sequence[tuple[float, float]]) -> float:
    """How much of what a number does the runs have seen, 0 to 1: of a control point where none was,
    the part of the curve that it bends."""
    if slot.kind != "values":
        return 1.0
    component = getattr(profile.channels, slot.channel).components[slot.component]
    a, b = component.interval
    s = a + (b - a) * np.array(component.x)
    here = float(s[slot.index])
    if not any(c < here < d or here == c == 0.0 or here == d == 1.0 for c, d in away):
        return 1.0
    first, last = s[max(slot.index - 1, 0)], s[min(slot.index + 1, len(s) - 1)]
    lost = sum(max(min(d, last) - max(c, first), 0.0) for c, d in away)
    return float(1.0 - lost / (last - first))


def _scale(profile: Profile, slot: Slot, gravity: float) -> float:
    if slot.kind == "effects":
        return _effect_scale(profile.effects[slot.component], slot.key)
    if slot.kind != "values":
        return gravity if slot.kind == "gravity" else 1.0
    component = getattr(profile.channels, slot.channel).components[slot.component]
    return max(map(abs, component.y)) or 1.0


def _values(
    channel: str,
    number: int,
    component: Component,
    keep_shape: bool,
    slots: list[Slot],
    start: list[float],
    rows: Rows,
) -> None:
    """A component's control points; those that are zero stay so where shapes are kept, and at the
    foot of a steep edge."""
    y = np.array(component.y)
    scale = float(np.abs(y).max()) or 1.0
    y[np.abs(y) < NOTHING * scale] = 0.0
    a, b = component.interval
    steep = np.diff(component.x) * (b - a) < NARROWEST
    foot = np.append(steep, False) | np.insert(steep, 0, False)
    at: dict[int, int] = {}
    for index, value in enumerate(y):
        sign = float(np.sign(value))
        if sign == 0 and (keep_shape or foot[index]):
            continue
        at[index] = len(slots)
        if keep_shape or channel != "conservative":
            rows.append(({at[index]: sign or 1.0}, 0.0))
        slots.append(Slot("values", channel, number, index))
        start.append(value / scale)
    for index, way in enumerate(_ways(y, NOTHING * scale)):
        if keep_shape and way:
            ends = ((index, -way), (index + 1, way))
            rows.append(({at[k]: float(sign) for k, sign in ends if k in at}, 0.0))


def _ways(y: Array, least: float) -> Array:
    """Which way a curve goes between control points, -1, 0 or 1, shape (n - 1,).

    What rises or falls by less than the least is flat. Between two parts that go one way it is one
    of them, as a fit that was held by a bound leaves it so; a plateau is neither.
    """
    rise = np.diff(y)
    ways = np.where(np.abs(rise) < least, 0.0, np.sign(rise))
    (there,) = np.nonzero(ways)
    for k in np.flatnonzero(ways == 0):
        before, after = there[there < k], there[there > k]
        if len(before) and len(after) and ways[before[-1]] == ways[after[0]]:
            ways[k] = ways[after[0]]
    return ways


def _effect_scale(effect: Effect, key: str) -> float:
    value = getattr(effect, key)
    return float(max(map(abs, value)) if isinstance(value, tuple) else abs(value))


def _effect(
    number: int,
    effect: Effect,
    inertia: float,
    slots: list[Slot],
    start: list[float],
    rows: Rows,
) -> None:
    """An effect's numbers that are not zero, each in units of its own size; a learned force keeps
    its own, which were fitted together."""
    if isinstance(effect, LearnedForce):
        return
    largest = dict(LARGEST)
    if isinstance(effect, Backlash):
        largest["inertia"] = HEAVIEST[effect.side] * inertia
    for key in (*effect.parameters(), "y"):
        value = getattr(effect, key, None)
        if not isinstance(value, float | tuple) or not _effect_scale(effect, key):
            continue
        for index, one in enumerate(value if isinstance(value, tuple) else (value,)):
            if key not in SIGNED:
                least = 0.0 if key == "y" else MIN_FACTOR_LEFT
                rows.append(({len(slots): 1.0}, least))
            if (most := largest.get(key, np.inf)) < np.inf:
                rows.append(({len(slots): -1.0}, -most / _effect_scale(effect, key)))
            slots.append(Slot("effects", component=number, index=index, key=key))
            start.append(one / _effect_scale(effect, key))


def _interval(
    channel: str,
    number: int,
    component: Component,
    slots: list[Slot],
    start: list[float],
    rows: Rows,
    kind: Kind = "intervals",
) -> None:
    """A component's interval; ends at the ends of the range stay there."""
    a, b = component.interval
    at: dict[int, int] = {}
    for index, (end, stays) in enumerate(((a, a <= 0), (b, b >= 1))):
        if stays:
            continue
        at[index] = len(slots)
        slots.append(Slot(kind, channel, number, index))
        start.append(end)
        rows.append(({at[index]: 1.0}, 0.0))
        rows.append(({at[index]: -1.0}, -1.0))
    width = {at[1]: 1.0} if 1 in at else {}
    if 0 in at:
        width[at[0]] = -1.0
    if width:
        fixed = (0.0 if 1 in at else b) - (0.0 if 0 in at else a)
        rows.append((width, NARROWEST - fixed))
