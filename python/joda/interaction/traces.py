"""Motions over time: position above, force below, sudden motion shaded."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from joda.profile import Joint
from joda.scenes.motion import Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHADE = "#f6dfae"
FORCE = "#c8202f"


def draw_position(
    axes: "Axes", motion: Motion, joint: Joint, *, colour: str, label: str = "", style: str = "-"
) -> None:
    """The joint's position over time: degrees of a hinge, mm of a short slide, else m."""
    factor, unit = shown(joint)
    axes.plot(motion.time, factor * motion.position, style, color=colour, lw=1.8, label=label)
    axes.set_ylabel(f"position ({unit})")
    axes.spines[["top", "right"]].set_visible(False)


def draw_force(
    axes: "Axes", motion: Motion, joint: Joint, *, colour: str, label: str = "", style: str = "-"
) -> None:
    """The force on the joint from outside over time."""
    axes.axhline(0, color="#999999", lw=0.7)
    axes.plot(motion.time, motion.force, style, color=colour, lw=1.4, label=label)
    axes.set_ylabel(f"force from outside ({joint.force_unit})")
    axes.spines[["top", "right"]].set_visible(False)


def shade(axes: "Axes", intervals: Sequence[tuple[float, float]], label: str) -> None:
    """Intervals of time (s), each at least as wide as can be seen."""
    begin, end = axes.get_xlim()
    least = 0.004 * (end - begin)
    for k, (a, b) in enumerate(intervals):
        room = max(least - (b - a), 0.0) / 2
        named = label if k == 0 else None
        axes.axvspan(a - room, b + room, color=SHADE, lw=0, zorder=-1, label=named)


def shown(joint: Joint) -> tuple[float, str]:
    """What positions are multiplied with to be shown, and their unit then."""
    if joint.type == "hinge":
        return float(np.rad2deg(1.0)), "degrees"
    return (1000.0, "mm") if np.ptp(joint.range) < 0.1 else (1.0, "m")
