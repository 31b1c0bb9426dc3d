"""A learned force in a picture: its resistance over velocity, a curve for each position."""

from typing import TYPE_CHECKING, Any

import numpy as np

from joda.effects import LearnedForce
from joda.field.table import resistance
from joda.pictures.style import EFFECTS, INK, number
from joda.profile import Joint

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SPEEDS = 1.6
"""Height of the panel, inches."""
MAX_CURVES = 5
"""Positions of which a curve is drawn."""
DRAWN_SPEEDS = 1.15
"""Part of the outermost velocities up to which it is drawn: it is level there."""


def table_panel(axes: "Axes", effect: LearnedForce, joint: Joint) -> None:
    """Draws the table; its control points as dots.

    Args:
        axes: to draw in.
        effect: the learned force.
        joint: of which it is.
    """
    lo, hi = joint.range
    slowest, fastest = effect.velocities[0], effect.velocities[-1]
    v = np.sort(
        [*np.linspace(DRAWN_SPEEDS * slowest, DRAWN_SPEEDS * fastest, 400), *effect.velocities]
    )
    count = len(effect.positions)
    chosen = np.unique(np.linspace(0, count - 1, min(MAX_CURVES, count)).round().astype(int))
    whole = effect.model_copy(update={"interval": (0.0, 1.0)})
    for order, k in enumerate(chosen):
        s = effect.positions[k]
        label = f"at q = {number(lo + s * (hi - lo))} {joint.unit}" if count > 1 else "everywhere"
        style: dict[str, Any] = {"color": EFFECTS, "alpha": 0.35 + 0.65 * (order + 1) / len(chosen)}
        axes.plot(v, resistance(whole, s, v)[0], linewidth=1.5, label=label, **style)
        axes.plot(effect.velocities, effect.y[k], ".", **style)
    axes.axhline(0, color="#999999", linewidth=0.7, zorder=1)
    axes.set_xlabel(f"velocity ({joint.unit}/s)", fontsize=9, color=INK)
    axes.set_ylabel(f"learned\nresistance\n({joint.force_unit})", fontsize=8, color=INK)
    axes.tick_params(labelsize=8)
    axes.grid(color="#e8e8e8", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(frameon=False, fontsize=7, loc="upper left")
