"""The first contact: a microwave that shuts itself, beside the same one without a profile."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from joda._attach import attach
from joda._plot import plot
from joda.draw import write_png
from joda.errors import JodaError
from joda.files import make_folder, write_bytes, write_text
from joda.model import find_joint, load_model
from joda.motion import Motion, release
from joda.offscreen import Image, render

if TYPE_CHECKING:
    from matplotlib.figure import Figure

START = np.deg2rad(3.0)
DURATION = 1.0


@dataclass(frozen=True)
class Demo:
    """What the demo left behind, and what it saw.

    Attributes:
        plain: the microwave as it comes.
        composed: its profile.
        scene: the microwave with the profile.
        profile: picture of the profile.
        picture: both doors, released nearly closed.
        start: where they were let go, rad.
        plain_end, joda_end: where they were after `duration` seconds, rad.
        shut_after: when the door with the profile reached 0, s.
    """

    plain: Path
    composed: Path
    scene: Path
    profile: Path
    picture: Path
    start: float
    plain_end: float
    joda_end: float
    shut_after: float
    duration: float


def demo(
    output: str | Path | None = None,
    *,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Demo:
    """Attaches the bundled latch to the bundled microwave and lets both doors go at 3 degrees.

    Args:
        output: folder for everything that is made; created if missing. By default joda_demo, or
            the first of joda_demo_2, joda_demo_3, ... that does not exist.
        force: overwrite what an earlier demo left there.
        progress: told what is being done.

    Returns:
        the files and what happened.

    Raises:
        JodaError: the folder cannot be written, or holds files already.
    """
    folder = Path(output) if output is not None else _fresh("joda_demo")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())) and not force:
        raise JodaError(f"{folder}: exists already; choose another folder with -o or add --force.")
    make_folder(folder)
    plain, composed = folder / "microwave.xml", folder / "composed.json"
    progress("writing the microwave and its latch")
    with as_file(files("joda") / "models") as models:
        write_bytes(plain, (models / "microwave.xml").read_bytes())
        write_text(composed, (models / "microwave.latch.json").read_text("utf-8"))
    scene = folder / "scene.xml"
    attach(plain, composed, scene, force=True)

    progress("drawing the profile")
    model, before = load_model(scene), load_model(plain)
    joint = find_joint(model, "door")
    profile = plot(scene, folder / "profile.png", force=True)

    progress("letting both doors go at 3 degrees")
    motions = [release(m, joint, START, DURATION) for m in (before, model)]
    picture = folder / "release.png"
    progress("drawing both doors")
    views = render(scene, "front", "door", [motion.position[-1] for motion in motions])
    write_png(_picture(motions, views or []), picture, force=True)
    shut = motions[1].time[motions[1].position <= 0]
    return Demo(
        plain=plain,
        composed=composed,
        scene=scene,
        profile=profile,
        picture=picture,
        start=float(START),
        plain_end=float(motions[0].position[-1]),
        joda_end=float(motions[1].position[-1]),
        shut_after=float(shut[0]) if len(shut) else float("nan"),
        duration=DURATION,
    )


def _fresh(name: str) -> Path:
    candidates = (Path(f"{name}_{k}" if k > 1 else name) for k in count(1))
    return next(path for path in candidates if not path.exists())


def _picture(motions: list[Motion], views: Sequence[Image]) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 5.2 if views else 4), dpi=130, layout="constrained")
    names = ("without a profile", "with the latch profile")
    colours = ("#888888", "#c8202f")
    grid = figure.add_gridspec(
        len(views) or 1, 2 if views else 1, width_ratios=[2, 1] if views else None
    )
    axes = figure.add_subplot(grid[:, 0])
    for motion, name, colour in zip(motions, names, colours, strict=True):
        axes.plot(motion.time, np.rad2deg(motion.position), color=colour, lw=2.2, label=name)
    axes.axhline(0, color="#333333", lw=0.8)
    axes.annotate(
        "closed",
        (DURATION, 0),
        ha="right",
        va="bottom",
        fontsize=9,
        xytext=(0, 2),
        textcoords="offset points",
    )
    axes.set(xlabel="time (s)", ylabel="door angle (degrees)", xlim=(0, DURATION))
    axes.set_title("A microwave door, let go at 3 degrees", loc="left")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    for k, (view, name) in enumerate(zip(views, names, strict=False)):
        image = figure.add_subplot(grid[k, 1])
        image.imshow(view)
        image.set_title(f"{name}, after {DURATION:g} s", fontsize=9)
        image.axis("off")
    return figure
