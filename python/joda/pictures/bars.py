"""A profile's components and effects as labelled bars over the joint's range."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from joda.pictures.style import COLOURS, EFFECTS, INK, clean, note, shorten, text_width
from joda.profile import CHANNELS, Channel, Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def component_strip(figure: "Figure", axes: "Axes", profile: Profile) -> None:
    """One bar per component, grouped by channel, with its label in or beside it."""
    row = 0
    for name in CHANNELS:
        channel: Channel = getattr(profile.channels, name)
        bars = [(component.label, component.interval) for component in channel.components]
        rule = "\n(max)" if channel.combine == "max" and len(bars) > 1 else ""
        row = _bars(figure, axes, profile, name + rule, COLOURS[name], bars, row)
    effects = [(e.described(), getattr(e, "interval", (0, 1))) for e in profile.effects]
    row = _bars(figure, axes, profile, "effects", EFFECTS, effects, row)
    if not row:
        note(axes, "no components")
    axes.set_ylim(max(row, 1) - 0.5, -0.5)
    axes.set_yticks([])
    axes.tick_params(axis="x", bottom=False, labelbottom=False)
    axes.spines[:].set_color("#cccccc")


def _bars(
    figure: "Figure",
    axes: "Axes",
    profile: Profile,
    title: str,
    colour: str,
    bars: Sequence[tuple[str, tuple[float, float]]],
    first: int,
) -> int:
    """A group of bars (label, interval) from a row on, and the row after it."""
    lo, hi = profile.joint.range
    for row, (label, interval) in enumerate(bars, first):
        a, b = (lo + end * (hi - lo) for end in interval)
        style: dict[str, Any] = {"facecolor": (colour, 0.25), "edgecolor": colour, "linewidth": 0.7}
        axes.barh(row, b - a, left=a, height=0.82, **style)
        _bar_label(figure, axes, label, a, b, row)
    if bars:
        style = {"ha": "right", "va": "center", "fontsize": 7, "color": colour}
        middle = first + (len(bars) - 1) / 2
        axes.text(-0.008, middle, title, transform=axes.get_yaxis_transform(), **style)
    return first + len(bars)


def _bar_label(figure: "Figure", axes: "Axes", label: str, a: float, b: float, row: int) -> None:
    """The label inside the bar, else beside it where there is more room; shortened to fit."""
    ends = (axes.get_xlim()[0], a, b, axes.get_xlim()[1])
    start, left, right, end = axes.transData.transform([(x, 0) for x in ends])[:, 0]
    pad = 0.03 * figure.dpi
    rooms = {"in": right - left, "right": end - right, "left": left - start}
    rooms = {side: room - 2 * pad for side, room in rooms.items()}
    text = clean(label)
    side = (
        "in"
        if text_width(figure, text, 7) <= rooms["in"]
        else max(rooms, key=lambda place: rooms[place])
    )
    text = shorten(figure, text, 7, rooms[side])
    x, shift, align = {
        "in": ((a + b) / 2, 0.0, "center"),
        "right": (b, pad, "left"),
        "left": (a, -pad, "right"),
    }[side]
    axes.annotate(
        text,
        (x, row),
        xytext=(shift, 0),
        textcoords="offset pixels",
        ha=align,
        va="center_baseline",
        fontsize=7,
        color=INK,
        parse_math=False,
        clip_on=True,
    )
