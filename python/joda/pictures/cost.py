"""How the cost of profiles grows with the number of joints and of components, as a picture."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.files import check_target
from joda.pictures.style import COLOURS, INK, house_style, write_png
from joda.profile import Channel, Channels, Joint, Profile, Resistance
from joda.scenes.hinges import hinges
from joda.scenes.timing import seconds_per_step

if TYPE_CHECKING:
    from matplotlib.axes import Axes

JOINTS = (1, 2, 5, 10, 20, 50, 100, 200)
COMPONENTS = (3, 6, 12, 24, 48, 96)
ROUNDS = 150
FEW = 10
"""Joints that have so many components."""


@dataclass(frozen=True)
class Growth:
    """Time of a step over that of the same hinges with native spring, damping and friction.

    Attributes:
        joints: how many hinges.
        ours: with profiles of 8 components, for each number of joints.
        rows: with MuJoCo's elements and the constraint row of a profile's damping, but no plugin.
        components: of the profile of each of ten hinges.
        by_components: with such profiles.
    """

    joints: tuple[int, ...]
    ours: tuple[float, ...]
    rows: tuple[float, ...]
    components: tuple[int, ...]
    by_components: tuple[float, ...]


def draw_growth(
    output: str | Path,
    *,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Growth:
    """Measures and draws what profiles cost per step, for more and more joints and components.

    Each ratio is that of the fastest of many short swings, taken in turns.

    Args:
        output: the PNG file.
        force: overwrite it if it exists.
        progress: told what is being measured.

    Returns:
        what is drawn.

    Raises:
        JodaError: the file exists and `force` is off, or cannot be written.
    """
    import matplotlib.pyplot as plt

    check_target(Path(output), force)
    by_joints = []
    for count in JOINTS:
        progress(f"{count} joints")
        models = [hinges(count, kind) for kind in ("native", "rows", "joda")]
        times = _fastest(models)
        by_joints.append(times[1:] / times[0])
    progress(f"profiles of up to {COMPONENTS[-1]} components")
    models = [
        hinges(FEW, "native"),
        *(hinges(FEW, "joda", profile(n)) for n in COMPONENTS),
    ]
    times = _fastest(models)
    rows, ours = (tuple(map(float, ratios)) for ratios in zip(*by_joints, strict=True))
    growth = Growth(JOINTS, ours, rows, COMPONENTS, tuple((times[1:] / times[0]).tolist()))
    with house_style():
        figure, (left, right) = plt.subplots(
            1, 2, figsize=(8, 3), dpi=150, sharey=True, layout="constrained"
        )
        _draw(left, JOINTS, ours, "joints", "profiles of 8 components", COLOURS["conservative"])
        _draw(left, JOINTS, rows, "joints", "only the damping's row", COLOURS["damping"])
        label = f"{FEW} joints"
        _draw(right, COMPONENTS, growth.by_components, "components per joint", label, INK)
        left.set_ylabel("time of a step / native")
        write_png(figure, output, force)
        plt.close(figure)
    return growth


def _fastest(models: Sequence[mujoco.MjModel]) -> NDArray[np.float64]:
    """Seconds per step of each, of the fastest round: what else the machine does only adds."""
    times = [[seconds_per_step(model) for model in models] for _ in range(ROUNDS)]
    fastest: NDArray[np.float64] = np.min(times, axis=0)
    return fastest


def profile(components: int) -> Profile:
    """So many components, a third in each channel, side by side and overlapping by half."""
    count = components // 3
    width = 2 / (count + 1)
    intervals = [(width * k / 2, min(1.0, width * (k / 2 + 1))) for k in range(count)]
    parts = tuple(Component(interval=ends, x=(0, 0.5, 1), y=(0, 0.1, 0)) for ends in intervals)
    return Profile(
        joint=Joint(name="j", type="hinge", range=(0, 1.5), unit="rad"),
        channels=Channels(
            conservative=Channel(components=parts),
            friction=Resistance(components=parts),
            damping=Resistance(components=parts),
        ),
    )


def _draw(
    axes: "Axes", x: Sequence[int], y: Sequence[float], what: str, label: str, colour: str
) -> None:
    axes.semilogx(x, y, "o-", color=colour, label=label, markersize=4)
    axes.axhline(1, color="#999999", linewidth=0.8)
    axes.set_xlabel(what)
    axes.set_xticks(x, [str(value) for value in x])
    axes.minorticks_off()
    axes.legend(frameon=False, fontsize=8)
