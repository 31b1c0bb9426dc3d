"""Previews of effect templates on one picture: what people and vision-language models choose by.

The colours are those of a profile's picture. The band of dry friction lies around zero, not around
the force: how strong the channels are beside each other is a proposal's to say, not a template's.
"""

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.field import evaluate
from joda.pictures.style import COLOURS, INK, house_style, text_width
from joda.profile import CHANNELS, Channel
from joda.template import Curve, Template

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

COLUMNS = 5
# Inches; a row is as tall as its longest name asks for.
WIDTH, DPI = 10.0, 100
LEFT, RIGHT, TOP, GAP = 0.4, 0.2, 0.68, 0.22
LINE, PANEL, TICKS = 0.17, 1.35, 0.4

LABELS = {
    "conservative": "conservative force (above 0: towards +q, below: towards \N{MINUS SIGN}q)",
    "friction": "± dry friction",
    "damping": "damping",
}
CAPTION = (
    "Across: u, 0 at the low end of the effect's interval and 1 at its high end. "
    "Up: each channel, its peak scaled to 1."
)


def sheet(templates: Mapping[str, Template]) -> "Figure":
    """The prototypes of templates, five to a row, 1000 pixels wide, about 700 tall for 13.

    Args:
        templates: name to template, drawn in this order.

    Returns:
        a figure with one axes per template, its title the name. In it each channel that the
        template has, over u from 0 to 1: the lines "conservative" and "damping" and the band
        "friction".
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(WIDTH, TOP), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)  # attaches itself; the names are measured with it
        columns = max(1, min(COLUMNS, len(templates)))
        wide = (WIDTH - LEFT - RIGHT - (columns - 1) * GAP) / columns
        titles = [_wrap(figure, name, wide * DPI) for name in templates]
        tops = [TOP]
        for row in range(math.ceil(len(titles) / columns)):
            lines = max(len(title) for title in titles[row * columns : (row + 1) * columns])
            tops.append(tops[-1] + lines * LINE + PANEL + TICKS)
        figure.set_figheight(tops[-1])

        for cell, (title, template) in enumerate(zip(titles, templates.values(), strict=True)):
            row, column = divmod(cell, columns)
            bottom = tops[-1] - tops[row + 1] + TICKS
            axes = figure.add_axes(
                (
                    (LEFT + column * (wide + GAP)) / WIDTH,
                    bottom / tops[-1],
                    wide / WIDTH,
                    PANEL / tops[-1],
                )
            )
            _cell(axes, template, first=column == 0)
            axes.set_title(
                "\n".join(title), loc="left", fontsize=9, color=INK, pad=4, parse_math=False
            )
        _legend(figure)
    return figure


def _cell(axes: "Axes", template: Template, first: bool) -> None:
    channels = template.channels
    if channels.friction:
        u, value = _curve(channels.friction)
        axes.fill_between(
            u, -value, value, color=COLOURS["friction"], alpha=0.3, linewidth=0, label="friction"
        )
    # A curve that lies on the other remains visible: the narrow one is above.
    for name, width in (("conservative", 2.4), ("damping", 1.4)):
        curve: Curve | None = getattr(channels, name)
        if curve:
            axes.plot(*_curve(curve), color=COLOURS[name], linewidth=width, label=name)
    axes.axhline(0, color="#999999", linewidth=0.8, zorder=1)
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(-1.12, 1.12)
    axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
    axes.set_yticks([-1, 0, 1], ["\N{MINUS SIGN}1", "0", "1"])
    axes.tick_params(labelsize=8, labelcolor=INK, color="#cccccc", labelleft=first)
    axes.spines[:].set_color("#cccccc")
    axes.grid(color="#e8e8e8", linewidth=0.6)
    axes.set_axisbelow(True)


def _curve(curve: Curve) -> tuple[Array, Array]:
    """Points that show a prototype: evenly spaced, and its own."""
    component = Component(interval=(0, 1), x=curve.x, y=curve.y)
    u = np.union1d(np.linspace(0, 1, 129), curve.x)
    return u, evaluate(Channel(components=(component,)), u)[0]


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color=COLOURS["conservative"], linewidth=2.4),
        Patch(facecolor=COLOURS["friction"], alpha=0.3),
        Line2D([], [], color=COLOURS["damping"], linewidth=1.4),
    ]
    height = figure.get_figheight()
    figure.legend(
        handles,
        [LABELS[name] for name in CHANNELS],
        loc="upper left",
        bbox_to_anchor=(LEFT / WIDTH, 1 - 0.1 / height),
        borderaxespad=0,
        borderpad=0,
        ncols=3,
        frameon=False,
        fontsize=9,
        labelcolor=INK,
    )
    figure.text(LEFT / WIDTH, 1 - 0.34 / height, CAPTION, va="top", fontsize=9, color=INK)


def _wrap(figure: "Figure", name: str, room: float) -> list[str]:
    """The name in lines of at most `room` pixels, broken behind '_' and the like if possible."""
    lines = [""]
    for part in re.split(r"(?<=[_ .-])", name):
        if lines[-1] and text_width(figure, lines[-1] + part, 9) > room:
            lines.append("")
        for character in part:
            if lines[-1] and text_width(figure, lines[-1] + character, 9) > room:
                lines.append("")
            lines[-1] += character
    return lines
