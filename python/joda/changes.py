"""What changed from one profile of a joint to the next: as a list, and as a picture."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from joda.draw import COLOURS, GRAVITY, house_style
from joda.field import evaluate
from joda.profile import CHANNELS, Channel, Component, Profile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Parts = dict[tuple[str, str, int], Component]

NOUNS = {"conservative": "force", "friction": "friction", "damping": "damping"}


def changes(before: Profile, after: Profile) -> list[str]:
    """What is different, a line per component; empty if nothing is.

    Args:
        before, after: profiles of one joint; components of the same label and channel are taken
            for the same, in their order.
    """
    old, new = _parts(before), _parts(after)
    out = []
    for key in dict.fromkeys((*old, *new)):
        channel, label, _ = key
        unit = _unit(channel, after)
        if key not in new:
            out.append(f"{_where(label, old[key])}: {NOUNS[channel]} removed")
        elif key not in old:
            out.append(
                f"{_where(label, new[key])}: {NOUNS[channel]} {_peak(new[key])} {unit} added"
            )
        elif old[key] != new[key]:
            where = _where(label, new[key])
            if old[key].interval != new[key].interval:
                a, b = old[key].interval
                where += f", before {a:g} to {b:g}"
            peaks = _peak(old[key]), _peak(new[key])
            sizes = f"{peaks[0]} → {peaks[1]} {unit}" if peaks[0] != peaks[1] else "as strong"
            out.append(f"{where}: {NOUNS[channel]} {sizes}")
    if before.joint_limit_hint != after.joint_limit_hint:
        hint = after.joint_limit_hint
        out.append(f"end stops: {hint.elasticity} elasticity at {hint.selected_side}")
    return out


def overlay(
    before: Profile, after: Profile, gravity: tuple[Array, Array] | None = None
) -> "Figure":
    """Both profiles in one picture: before dashed and grey, after in colour.

    Args:
        before, after: profiles of one joint.
        gravity: as for `joda.draw.draw`.

    Returns:
        a figure with a panel per channel.
    """
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(8, 7), dpi=120, layout="constrained")
        panels = figure.subplots(3, 1, sharex=True, height_ratios=[2, 1, 1])
        s = np.linspace(0, 1, 2001)
        lo, hi = after.joint.range
        q = lo + s * (hi - lo)
        for axes, name in zip(panels, CHANNELS, strict=True):
            for profile, style in (
                (before, {"color": "#888888", "ls": "--", "label": "before"}),
                (after, {"color": COLOURS[name], "label": "after"}),
            ):
                channel: Channel = getattr(profile.channels, name)
                axes.plot(q, evaluate(channel, s)[0], lw=1.8, **style)
            if name == "conservative" and gravity is not None:
                axes.plot(*gravity, color=GRAVITY, ls=":", lw=1.4, label="balances gravity")
            axes.axhline(0, color="#bbbbbb", lw=0.7, zorder=0)
            axes.set_ylabel(f"{NOUNS[name]} ({_unit(name, after)})")
            axes.spines[["top", "right"]].set_visible(False)
        panels[0].legend(frameon=False, fontsize=9, ncols=3)
        panels[0].set_title(f"{after.joint.name}: before and after", loc="left", parse_math=False)
        panels[-1].set_xlabel(f"joint position ({after.joint.unit})")
        return figure


def _parts(profile: Profile) -> Parts:
    """Components by channel, label and which of that label."""
    out: Parts = {}
    for channel in CHANNELS:
        seen: dict[str, int] = {}
        for component in getattr(profile.channels, channel).components:
            number = seen[component.label] = seen.get(component.label, 0) + 1
            out[channel, component.label, number] = component
    return out


def _where(label: str, component: Component) -> str:
    a, b = component.interval
    return f"{label or 'component'} at s = {a:g} to {b:g}"


def _peak(component: Component) -> str:
    return f"{max(map(abs, component.y)):.3g}"


def _unit(channel: str, profile: Profile) -> str:
    hinge = profile.joint.type == "hinge"
    if channel == "damping":
        return "N·m·s/rad" if hinge else "N·s/m"
    return "N·m" if hinge else "N"
