"""What changed from one profile of a joint to the next: as a list, and as a picture."""

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.field import evaluate
from joda.pictures.style import COLOURS, GRAVITY, clean, house_style
from joda.profile import CHANNELS, NOUNS, Channel, Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


def changes(before: Profile, after: Profile) -> list[str]:
    """What is different, a line per component; empty if nothing is.

    Args:
        before, after: profiles of one joint; components of the same label and channel are taken
            for the same, in their order, those that did not change first. Then the effects.
    """
    out = []
    for channel in CHANNELS:
        old, new = getattr(before.channels, channel), getattr(after.channels, channel)
        unit = after.joint.unit_of(channel)
        for pair in _pairs(old.components, new.components):
            out.append(_line(*pair, NOUNS[channel], unit))
        if old.combine != new.combine:
            out.append(f"{NOUNS[channel]}: components combined by {new.combine}, not {old.combine}")
    known, now = ({e.key: e for e in profile.effects} for profile in (before, after))
    for key in {**known, **now}:
        old, new = known.get(key), now.get(key)
        if old != new:
            was = f", before {old.described()}" if old and new else ""
            out.append(f"{new.described()}{was}" if new else f"without {key.replace('_', ' ')}")
    if before.joint_limit_hint != after.joint_limit_hint:
        hint = after.joint_limit_hint
        given = "none" not in (hint.selected_side, hint.elasticity)
        side = hint.selected_side.replace("_", " ")
        how = f"{hint.elasticity} elasticity at the {side}" if given else "as the model has them"
        out.append(f"end stops: {how}")
    return out


def overlay(
    before: Profile, after: Profile, gravity: tuple[Array, Array] | None = None
) -> "Figure":
    """Both profiles in one picture: before dashed and grey, after in colour.

    Args:
        before, after: profiles of one joint.
        gravity: as for `joda.pictures.draw.draw`.

    Returns:
        a figure with a panel per channel.
    """
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(8, 7), dpi=120, layout="constrained")
        panels = figure.subplots(3, 1, sharex=True, height_ratios=[2, 1, 1])
        draw_channels(panels, before, after, gravity)
        panels[0].legend(frameon=False, fontsize=9, ncols=3)
        panels[0].set_title(
            f"{clean(after.joint.name)}: before and after", loc="left", parse_math=False
        )
        panels[-1].set_xlabel(f"joint position ({after.joint.unit})")
        return figure


def draw_channels(
    panels: "Sequence[Axes]",
    before: Profile,
    after: Profile,
    gravity: tuple[Array, Array] | None = None,
) -> None:
    """Draws both profiles' channels, one on each of three axes; arguments as for `overlay`."""
    s = np.linspace(0, 1, 2001)
    lo, hi = after.joint.range
    q = lo + s * (hi - lo)
    for axes, name in zip(panels, CHANNELS, strict=True):
        old, new = (evaluate(getattr(p.channels, name), s)[0] for p in (before, after))
        axes.plot(q, old, lw=1.8, color="#888888", ls="--", label="before")
        axes.plot(q, new, lw=1.8, color=COLOURS[name], label="after")
        if name == "conservative" and gravity is not None:
            axes.plot(*gravity, color=GRAVITY, ls=":", lw=1.4, label="balances gravity")
        axes.axhline(0, color="#bbbbbb", lw=0.7, zorder=0)
        axes.set_ylabel(f"{NOUNS[name]} ({after.joint.unit_of(name)})")
        axes.spines[["top", "right"]].set_visible(False)


def _pairs(
    before: Sequence[Component], after: Sequence[Component]
) -> Iterator[tuple[Component | None, Component | None]]:
    """What changed: components of the same label, None where there is none any more or yet."""
    for label in dict.fromkeys(component.label for component in (*before, *after)):
        old = [component for component in before if component.label == label]
        new = [component for component in after if component.label == label]
        for component in tuple(old):
            if component in new:
                old.remove(component)
                new.remove(component)
        yield from zip_longest(old, new)


def _line(old: Component | None, new: Component | None, noun: str, unit: str) -> str:
    if new is None:
        assert old is not None
        return f"{_where(old)}: {noun} removed"
    if old is None:
        return f"{_where(new)}: {noun} {_peak(new)} {unit} added"
    where = _where(new)
    if old.interval != new.interval:
        a, b = old.interval
        where += f", before {a:g} to {b:g}"
    here = old.x[int(np.argmax(np.abs(old.y)))]
    was, now = (f"{_value(one, here):.3g}" for one in (old, new))
    if was == now:
        most = max(map(abs, new.y))
        was, now = (f"{np.copysign(x, _largest(old)):.3g}" for x in (_largest(old), most))
    if was != now:
        return f"{where}: {noun} {was} → {now} {unit}"
    shape = "as strong" if (old.x, old.y) == (new.x, new.y) else "another curve, as strong"
    return f"{where}: {noun} {shape}"


def _where(component: Component) -> str:
    a, b = component.interval
    return f"{component.label or 'component'} at s = {a:g} to {b:g}"


def _value(component: Component, x: float) -> float:
    """The curve's value at a place within its interval, 0 to 1."""
    alone = Channel(components=(component.model_copy(update={"interval": (0.0, 1.0)}),))
    return float(evaluate(alone, np.array([x]))[0][0])


def _peak(component: Component) -> str:
    """The value of the largest magnitude, with its sign."""
    return f"{_largest(component):.3g}"


def _largest(component: Component) -> float:
    return max(component.y, key=abs)
