"""A round as a small picture: its forces, where the joint goes when let go, and what came true.

SVG, with nothing outside it: it stays in `history.json`, and any browser shows it.
"""

import textwrap
from collections.abc import Sequence
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from joda.field import evaluate
from joda.interaction.behaviour import Behaviour
from joda.plain import line
from joda.profile import Profile
from joda.scenes.context import Context

Array = NDArray[np.float64]

WIDTH, HEIGHT = 480, 120
"""Of the forces, pixels; the low end is at the left."""
STRIP, LINE = 16, 17
"""Height of the strip that tells where it goes, and of a line of text, pixels."""
WIDE = 74
"""Letters of a line."""
FULL = 0.85
"""Share of half the height that the largest force takes."""
GOES = {
    "closes": "#3b6fb6",
    "opens": "#d98c1f",
    "stays": "#b9bec4",
    "settles": "#7d5fa8",
    "blocked": "#b3261e",
}
"""Colours of the strip."""
CAME, LACKS = "#1b7f3b", "#b3261e"


def sketch(
    profile: Profile,
    context: Context,
    behaviour: Behaviour,
    met: Sequence[str],
    unmet: Sequence[str],
) -> str:
    """The picture of a round, as SVG.

    Args:
        profile: what was simulated.
        context: the joint.
        behaviour: what it did.
        met, unmet: what came true and what did not, a sentence each.
    """
    told = [*_lines("\u2713", CAME, met), *_lines("\u2717", LACKS, unmet)]
    tall = HEIGHT + STRIP + LINE * (len(told) + 2)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {tall}" width="{WIDTH}" '
        f'height="{tall}" font-family="sans-serif" font-size="12">',
        f'<rect width="{WIDTH}" height="{tall}" fill="white"/>',
        *_forces(profile, context),
        *_strip(behaviour),
    ]
    for number, (text, colour) in enumerate(told):
        y = HEIGHT + STRIP + LINE * (number + 2) + 8
        out.append(f'<text x="4" y="{y}" fill="{colour}">{escape(line(text))}</text>')
    return "".join([*out, "</svg>"])


def _lines(mark: str, colour: str, sentences: Sequence[str]) -> list[tuple[str, str]]:
    out = []
    for sentence in sentences:
        first, *rest = textwrap.wrap(line(sentence), WIDE) or [""]
        out += [(f"{mark} {first}", colour), *((f"\u2003{one}", colour) for one in rest)]
    return out


def _forces(profile: Profile, context: Context) -> list[str]:
    """The conservative force in red, the band of friction, what would balance gravity dashed."""
    s, channels = np.linspace(0, 1, 61), profile.channels
    force, friction = (evaluate(c, s)[0] for c in (channels.conservative, channels.friction))
    balance = -np.interp(s, np.linspace(0, 1, len(context.gravity_force)), context.gravity_force)
    high = max(float(np.abs([force - friction, force + friction, balance]).max()), 1e-9)

    def points(values: Array) -> str:
        rows = HEIGHT / 2 * (1 - FULL * values / high)
        return " ".join(f"{WIDTH * a:.0f},{b:.0f}" for a, b in zip(s, rows, strict=True))

    back = " ".join(points(force - friction).split()[::-1])
    return [
        f'<path d="M0 {HEIGHT / 2:g}H{WIDTH}" stroke="#999"/>',
        f'<polygon points="{points(force + friction)} {back}" fill="#d98c1f" opacity=".3"/>',
        f'<polyline points="{points(balance)}" fill="none" stroke="#1f5fbf" '
        'stroke-dasharray="5 4"/>',
        f'<polyline points="{points(force)}" fill="none" stroke="#c8202f" stroke-width="2"/>',
        f'<text x="4" y="12" fill="#333">{high:.2g} {profile.joint.force_unit}</text>',
    ]


def _strip(behaviour: Behaviour) -> list[str]:
    """Where it goes, let go at rest at each position, and what the colours are."""
    opened = "high_end" if behaviour.closed_end == "low_end" else "low_end"
    words = {behaviour.closed_end: "closes", opened: "opens"}
    places = [words.get(stretch.goes, stretch.goes) for stretch in behaviour.let_go]
    ends = [stretch.start for stretch in behaviour.let_go]
    edges = [0.0, *((a[1] + b[0]) / 2 for a, b in pairwise(ends)), 1.0]
    out = [
        f'<rect x="{WIDTH * a:.1f}" y="{HEIGHT}" width="{WIDTH * (b - a):.1f}" height="{STRIP}" '
        f'fill="{GOES[goes]}"/>'
        for goes, a, b in zip(places, edges[:-1], edges[1:], strict=True)
    ]
    x, y = 4, HEIGHT + STRIP + LINE - 3
    for goes in dict.fromkeys(places):
        out.append(f'<text x="{x}" y="{y}" fill="{GOES[goes]}">let go here it {_is(goes)}</text>')
        x += 150
    return out


def _is(goes: str) -> str:
    return "is blocked" if goes == "blocked" else goes
