"""What kind of joint it is: features of the shape weighed against a table, names being one more.

Each archetype gets points: for a feature that lies where it should, minus points for one that lies
off, the farther the more; the same for names and the user's words. The points are logarithms of
odds, so that all archetypes together give how sure the best one is.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from joda.compiling import reference_scales
from joda.component import Frozen
from joda.propose.archetype import Archetype, Feature, read_archetypes
from joda.propose.naming import Concepts, concepts, said
from joda.propose.plausible import Force, forces
from joda.scenes.context import Context

Gravity = Literal["level", "opens", "closes"]

FITS, OFF = 0.6, -2.0
"""Points of a feature that lies where it should, and of one that lies far off."""
PART, OBJECT = 4.0, 3.5
"""Points of a name of the part and of the object."""
OTHER_PART, OTHER_OBJECT = -2.5, -3.0
"""Points where names speak of another part or object."""
SAID_PART, SAID_OBJECT, SAID_OTHER = 8.0, 10.0, -2.5
"""Points of the user's words, and where they name another part."""
DRIVEN = 2.5
"""Points of a robot's joint that an actuator moves, or that is one of a machine's; minus this, of
all others."""
OF_OBJECT = {
    "covers", "holds", "sticks_out", "object_size", "object_flat", "share", "height", "top",
}  # fmt: skip
"""Features that a part without an object does not have."""
SUREST = 0.95
OUTSIZE = 2.0
"""How many times larger or smaller than such parts are something must be for a word."""
LISTED = 0.05
"""Archetypes at least so likely are told as what it could be besides."""


class Evidence(Frozen):
    """A feature and the points that it gave.

    Attributes:
        feature: what was looked at, and what was found, in words.
        points: positive for what speaks for the answer, negative against it.
    """

    feature: str
    points: float


class Other(Frozen):
    """What the joint could be besides, and how likely that is, 0 to 1."""

    title: str
    likely: float


class Recognition(Frozen):
    """What a joint was taken for.

    Attributes:
        title: of the archetype.
        likely: how sure that is, 0 to 1.
        unknown: whether it is what remains where no other fits.
        decided: what spoke for it and against it, the most important first.
        others: what else it could be, the likeliest first.
        because: why such joints do what they do.
        force: what opening one takes at the handle, and who says so; None where nothing is known.
    """

    title: str
    likely: float
    unknown: bool = False
    decided: tuple[Evidence, ...] = ()
    others: tuple[Other, ...] = ()
    because: str = ""
    force: Force | None = None

    def describe(self) -> str:
        """The answer in one line."""
        decided = ", ".join(one.feature for one in self.decided if one.points > 0)
        against = ", ".join(one.feature for one in self.decided if one.points < 0)
        others = ", ".join(f"{one.title} {one.likely:.0%}" for one in self.others)
        return (
            f"{self.title} ({self.likely:.0%})"
            + (f", by {decided}" if decided else "")
            + (f"; against it: {against}" if against else "")
            + (f"; else {others}" if others else "")
        )


def gravity_role(context: Context) -> Gravity:
    """What gravity does to the joint over most of its range."""
    force = context.gravity_force
    if context.gravity_scale < 0.05 * reference_scales(context)["conservative"]:
        return "level"
    towards_high = sum(force) > 0
    return "opens" if towards_high != (context.closed_end == "high_end") else "closes"


def recognise(
    context: Context, description: str = "", archetypes: Sequence[Archetype] | None = None
) -> tuple[Archetype, Recognition]:
    """The archetype of a joint, and how it was found.

    Args:
        context: the joint.
        description: what the user says of it; its words count most.
        archetypes: to choose from; by default the library's. Where none may be it, all may.
    """
    known = read_archetypes() if archetypes is None else archetypes
    words = _Words.of(context, description)
    fitting = [one for one in known if _may_be(one, context, words)] or list(known)
    weighed = [_weigh(one, context, words) for one in fitting]
    points = np.array(
        [one.common + sum(e.points for e in each)
         for one, each in zip(fitting, weighed, strict=True)]
    )  # fmt: skip
    odds = np.exp(points - points.max())
    odds /= odds.sum()
    order = np.argsort(-odds, kind="stable")
    best, found = fitting[order[0]], weighed[order[0]]
    others = [Other(title=fitting[k].title, likely=round(float(odds[k]), 2))
              for k in order[1:4] if odds[k] >= LISTED]  # fmt: skip
    decided = sorted(found, key=lambda one: -abs(one.points))
    return best, Recognition(
        title=best.title,
        likely=round(min(float(odds[order[0]]), SUREST), 2),
        unknown=best.unknown,
        decided=tuple(one for one in decided if abs(one.points) >= FITS)[:6],
        others=tuple(others),
        because=best.evidence,
        force=forces()[best.force] if best.force else None,
    )


def scale_warning(one: Archetype, context: Context, description: str = "") -> str:
    """A sentence where names say that it is one of these, and its size that the scale is wrong.

    Args:
        one: what the joint was taken for.
        context, description: as for `recognise`.
    """
    words, size = _Words.of(context, description), one.shape.get("size")
    part = (words.part | words.said_part) & set(one.part)
    whole = not one.object or (words.object | words.said_object) & set(one.object)
    if not (part and whole and isinstance(size, tuple) and context.shape):
        return ""
    (least, most), found = size, context.shape.size
    if least / OUTSIZE <= found <= most * OUTSIZE:
        return ""
    return (
        f"Names say {one.title}, such parts are {least:g} to {most:g} m large, and this one is "
        f"{found:.3g} m: mend the model's scale, which is metres, or expect no usual forces."
    )


class _Words(NamedTuple):
    """Concepts that names and the user's words speak of."""

    part: Concepts
    object: Concepts
    said_part: Concepts
    said_object: Concepts

    @classmethod
    def of(cls, context: Context, description: str) -> "_Words":
        """Of a joint."""
        return cls(
            concepts(context.names[:2], "part"),
            _object(context),
            said(description, "part"),
            said(description, "object"),
        )


def _object(context: Context) -> Concepts:
    """What the part is on, by its own names and by the nearest above that says what it is."""
    above = (concepts([name], "object") for name in context.around)
    return concepts(context.names, "object") | next(filter(None, above), frozenset())


def _may_be(one: Archetype, context: Context, words: _Words) -> bool:
    if context.joint.type not in one.joint:
        return False
    if one.closed != "any" and (context.closed_end == "unknown") != (one.closed == "unknown"):
        return False
    return not one.needs_object or bool((words.object | words.said_object) & set(one.object))


def _weigh(one: Archetype, context: Context, words: _Words) -> list[Evidence]:
    if one.unknown:
        return []
    out = []
    for named, mine, yes, no, what in (
        (words.part, one.part, PART, OTHER_PART, "the part"),
        (words.object, one.object, OBJECT, OTHER_OBJECT, "the object"),
        (words.said_part, one.part, SAID_PART, SAID_OTHER, "your words"),
        (words.said_object, one.object, SAID_OBJECT, 0.0, "your words"),
    ):
        hit = named & set(mine)
        if hit:
            out.append(Evidence(feature=f"{what} is called {'/'.join(sorted(hit))}", points=yes))
        elif named and mine and no:
            out.append(Evidence(feature=f"{what} is called {'/'.join(sorted(named))}", points=no))
    machine = bool(context.shape and context.shape.machine)
    driven = context.driven or machine
    if one.driven or driven:
        told = (
            "an actuator" if context.driven else "one of a machine's" if machine else "no machine's"
        )
        points = DRIVEN if one.driven == driven else -DRIVEN
        out.append(Evidence(feature=told, points=points))
    found = context.shape.model_dump() if context.shape else {"weight": gravity_role(context)}
    if context.shape and not context.shape.object_size:  # nothing to hold it against
        found = {name: value for name, value in found.items() if name not in OF_OBJECT}
    for name, expected in one.shape.items():
        if name in found:
            out.append(
                Evidence(
                    feature=f"{name} {_value(found[name])}", points=_fits(found[name], expected)
                )
            )
    return out


def _fits(value: bool | float | str, expected: Feature) -> float:
    """Points of a feature."""
    if isinstance(expected, bool | str):
        return FITS if value == expected else OFF
    low, high = expected if isinstance(expected, tuple) else (expected, expected)
    number = float(value)
    if low <= number <= high:
        return FITS
    apart = max(low - number, number - high)
    scale = max(0.5 * (high - low), 0.25 * abs(high), 0.04)
    return FITS + (OFF - FITS) * min(apart / scale, 1.0)


def _value(value: bool | float | str) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:.3g}"
