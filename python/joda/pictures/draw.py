"""The diagnostic picture of a profile: force with its friction band, components, damping.

The picture of the paper's case analysis. Where the red curve lies above the dashed line (gravity's
equilibrium, or zero) the joint is driven towards +q, below it towards -q; where the dashed line
runs inside the shaded band, dry friction holds the joint.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from joda.effects import (
    DirectionDependentDamping,
    LearnedForce,
    QuadraticDamping,
    StribeckFriction,
)
from joda.field import evaluate
from joda.joints.resistance import damping, friction_bounds
from joda.pictures.bars import component_strip
from joda.pictures.learned import SPEEDS, table_panel
from joda.pictures.style import (
    COLOURS,
    GRAVITY,
    INK,
    clean,
    house_style,
    note,
    number,
    shorten,
    text_width,
)
from joda.profile import CHANNELS, Channel, Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

# Inches. The panels share what the margins and the bars leave of HEIGHT; below MIN_PANELS the
# figure grows instead.
WIDTH, HEIGHT, DPI = 8.0, 6.0, 150
LEFT, RIGHT, TOP, BOTTOM, GAP = 0.95, 0.35, 0.97, 0.5, 0.1
BAR, MAX_STRIP, MIN_PANELS = 0.15, 30.0, 2.5
FORCE_SHARE = 0.65

PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


def draw(profile: Profile, gravity: tuple[Array, Array] | None = None) -> "Figure":
    """The picture of a profile, 1200 x 900 pixels (taller with more than 12 components).

    Args:
        profile: the profile to draw.
        gravity: joint positions (rad or m), shape (n,), and the generalised force that would
            balance gravity there (N·m or N), shape (n,): minus gravity's own. None: not drawn.

    Returns:
        a figure with three axes: force, components, damping; with a learned force a fourth: its
        resistance over velocity. Data are in SI units; tick labels carry a prefix where the numbers
        ask for one.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with house_style():
        counts = [len(getattr(profile.channels, name).components) for name in CHANNELS]
        bars = max(1, sum(counts) + len(profile.effects))
        strip = min(bars * BAR, MAX_STRIP)
        learned = next((e for e in profile.effects if isinstance(e, LearnedForce)), None)
        beside = BOTTOM + SPEEDS if learned else 0.0
        frame = TOP + BOTTOM + beside + 2 * GAP
        panels = max(HEIGHT + beside - frame - strip, MIN_PANELS)
        height = frame + strip + panels
        figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)  # attaches itself; the labels are measured with it

        def axes(bottom: float, tall: float, share: "Axes | None" = None) -> "Axes":
            left, wide = LEFT / WIDTH, 1 - (LEFT + RIGHT) / WIDTH
            return figure.add_axes((left, bottom / height, wide, tall / height), sharex=share)

        lower, bottom = (1 - FORCE_SHARE) * panels, BOTTOM + beside
        force = axes(bottom + lower + strip + 2 * GAP, panels - lower)
        middle = axes(bottom + lower + GAP, strip, force)
        damping = axes(bottom, lower, force)
        lo, hi = profile.joint.range
        margin = 0.012 * (hi - lo)
        force.set_xlim(lo - margin, hi + margin)

        _force_panel(figure, force, profile, gravity)
        component_strip(figure, middle, profile)
        _damping_panel(damping, profile)
        if learned:
            table_panel(axes(BOTTOM, SPEEDS), learned, profile.joint)
        _headline(figure, profile)
    return figure


def _force_panel(
    figure: "Figure", axes: "Axes", profile: Profile, gravity: tuple[Array, Array] | None
) -> None:
    lo, hi = profile.joint.range
    channels = profile.channels
    hinge = profile.joint.type == "hinge"
    noun, unit = ("torque", "N·m") if hinge else ("force", "N")
    s = _samples(channels.conservative, channels.friction)
    q = lo + s * (hi - lo)
    value = evaluate(channels.conservative, s)[0]

    axes.axhline(0, color="#999999", linewidth=0.7, zorder=1)
    drawn = [value]
    bands = {"± dry friction": friction_bounds(profile, s, np.inf)}
    if any(isinstance(effect, StribeckFriction) for effect in profile.effects):
        bands["± at rest, before it breaks away"] = friction_bounds(profile, s)
    for label, (positive, negative) in bands.items():
        if positive.any() or negative.any():
            band = value - positive, value + negative
            style: dict[str, Any] = {"color": COLOURS["friction"], "alpha": 0.25, "linewidth": 0}
            axes.fill_between(q, *band, label=label, zorder=2, **style)
            drawn += band
    if gravity is not None:
        axes.plot(
            gravity[0],
            gravity[1],
            color=GRAVITY,
            linestyle="--",
            linewidth=1.5,
            label="gravity equilibrium (red above it: drives +q)",
            zorder=3,
        )
        drawn.append(np.asarray(gravity[1], dtype=float))
    axes.plot(
        q,
        value,
        color=COLOURS["conservative"],
        linewidth=1.8,
        label=f"conservative {noun}",
        zorder=4,
    )
    if not (channels.conservative.components or len(drawn) > 1 + (gravity is not None)):
        note(axes, f"no conservative {noun}, no dry friction", 0.62)
    _value_axis(axes, drawn, noun, unit)

    def normalised(x: Any) -> Any:
        return (x - lo) / (hi - lo)

    def physical(x: Any) -> Any:
        return lo + x * (hi - lo)

    top = axes.secondary_xaxis("top", functions=(normalised, physical))
    top.set_xlabel("normalised position s", fontsize=8, color=INK)
    top.tick_params(labelsize=8)
    top.spines[:].set_visible(False)
    axes.tick_params(axis="x", labelbottom=False)
    aside: dict[str, Any] = {"rotation": 90, "fontsize": 7, "color": "#666666"}
    aside["transform"] = axes.transAxes
    axes.text(1.012, 1, "above: +q →", va="top", **aside)
    axes.text(1.012, 0, "← below: \N{MINUS SIGN}q", va="bottom", **aside)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(  # above the panel, so that it hides no curve
        handles[::-1],
        labels[::-1],
        loc="upper left",
        bbox_to_anchor=(LEFT / WIDTH, 1 - 0.33 / figure.get_figheight()),
        borderaxespad=0,
        borderpad=0,
        ncols=3,
        frameon=False,
        fontsize=8,
    )


def _damping_panel(axes: "Axes", profile: Profile) -> None:
    lo, hi = profile.joint.range
    s = _samples(profile.channels.damping)
    value = evaluate(profile.channels.damping, s)[0]
    q, speed = lo + s * (hi - lo), f"{profile.joint.unit}/s"
    axes.plot(q, value, color=COLOURS["damping"], linewidth=1.8, label="damping")
    drawn = [value]
    varied = DirectionDependentDamping | QuadraticDamping | LearnedForce
    if any(isinstance(effect, varied) for effect in profile.effects):
        for v, line in ((1.0, "--"), (-1.0, ":")):
            there = damping(profile, s, v)
            label = f"at {number(v)} {speed}"
            axes.plot(q, there, line, color=COLOURS["damping"], linewidth=1.5, label=label)
            drawn.append(there)
        axes.legend(frameon=False, fontsize=7, ncols=3, loc="upper right")
    if not any(values.any() for values in drawn):
        note(axes, "no damping")
    _value_axis(axes, drawn, "damping", profile.joint.unit_of("damping"))
    axes.set_xlabel(f"joint position q ({profile.joint.unit})", fontsize=9, color=INK)


def _headline(figure: "Figure", profile: Profile) -> None:
    """Joint name, type and range."""
    joint = profile.joint
    lo, hi = joint.range
    span = f"{number(lo)} to {number(hi)} {joint.unit}"
    if joint.type == "hinge":
        span += f" ({number(math.degrees(lo))}° to {number(math.degrees(hi))}°)"
    tail = f"{joint.type} · {span}"
    y = 1 - 0.2 / figure.get_figheight()
    common: dict[str, Any] = {"va": "center_baseline", "parse_math": False, "color": INK}
    room = (WIDTH - LEFT - RIGHT) * DPI - text_width(figure, tail, 9) - 0.2 * DPI
    name = shorten(figure, clean(joint.name) or "unnamed joint", 11, room, weight="bold")
    figure.text(LEFT / WIDTH, y, name, fontsize=11, weight="bold", **common)
    figure.text(1 - RIGHT / WIDTH, y, tail, fontsize=9, ha="right", **common)


def _value_axis(axes: "Axes", drawn: list[Array], noun: str, unit: str) -> None:
    """Limits with zero in view, and tick labels in the unit's fitting multiple."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    low = min(0.0, *(float(values.min()) for values in drawn))
    high = max(0.0, *(float(values.max()) for values in drawn))
    peak = max(-low, high)
    if peak == 0:
        low, high = (0.0, 1.0) if noun == "damping" else (-1.0, 1.0)
    axes.set_ylim(low - 0.05 * (high - low), high + 0.08 * (high - low))
    exponent = 0
    if peak > 0 and not 0.1 <= peak < 1e4:
        exponent = min(max(3 * math.floor(math.log10(peak) / 3), -12), 12)
    axes.yaxis.set_major_locator(
        MaxNLocator(4 if noun == "damping" else 6, steps=[1, 2, 2.5, 5, 10])
    )
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: number(y / 10.0**exponent)))
    axes.set_ylabel(f"{noun}\n({PREFIXES[exponent]}{unit})", fontsize=9, color=INK)
    axes.yaxis.set_label_coords(-0.56 / (WIDTH - LEFT - RIGHT), 0.5)
    axes.tick_params(labelsize=8)
    axes.grid(color="#e8e8e8", linewidth=0.6)
    axes.set_axisbelow(True)


def _samples(*channels: Channel) -> Array:
    """Normalised positions that show every curve: evenly spaced, and denser in each component.

    A channel may jump where a component begins or ends. Both sides of the jump are sampled, the
    point itself is not: there, two components that touch count double.
    """
    ends = {e for channel in channels for c in channel.components for e in c.interval} - {0.0, 1.0}
    local = np.linspace(0, 1, 129)
    parts = [np.linspace(0, 1, 1001)]
    for channel in channels:
        for component in channel.components:
            a, b = component.interval
            parts.append(a + np.concatenate((local, component.x)) * (b - a))
    edges = np.array(sorted(ends))
    parts += [np.nextafter(edges, 0), np.nextafter(edges, 1)]
    s = np.unique(np.concatenate(parts))
    return s[(s >= 0) & (s <= 1) & ~np.isin(s, edges)]
