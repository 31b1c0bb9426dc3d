"""A short animation of a scene, as GIF."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from joda.files import write_bytes
from joda.pictures.caption import captioned
from joda.pictures.offscreen import render

if TYPE_CHECKING:
    from PIL import Image

WIDTH, HEIGHT = 480, 360
RATE = 20.0
"""Pictures per second."""
LONGEST = 10.0
"""Of a film, s: what takes longer is shown faster."""
COLOURS = 256


def frames(time: NDArray[np.float64]) -> tuple[NDArray[np.intp], float]:
    """Which samples are shown, evenly in time, and how many seconds of motion each second shows.

    Args:
        time: of the samples, s, shape (n,).
    """
    pace = max(float(time[-1] - time[0]) / LONGEST, 1.0)
    at = np.arange(time[0], time[-1] + 1e-9, pace / RATE)
    return np.minimum(np.searchsorted(time, at - 1e-9), len(time) - 1), pace


def _together(pictures: "Sequence[Image.Image]") -> "Image.Image":
    """Pictures of one size, one above the other."""
    from PIL import Image

    out = Image.new("RGB", (pictures[0].width, len(pictures) * pictures[0].height))
    for k, picture in enumerate(pictures):
        out.paste(picture, (0, k * picture.height))
    return out


def write_film(
    scene: str | Path, poses: Sequence[NDArray[np.float64]], captions: Sequence[str], path: Path
) -> None:
    """Renders poses (qpos, shape (nq,)) and writes them with their captions.

    Raises:
        NoRenderer: nothing can render here; nothing is written.
        JodaError: the file cannot be written.
    """
    from PIL import Image

    images = render(scene, poses, width=WIDTH, height=HEIGHT)
    pictures = [captioned(*pair) for pair in zip(images, captions, strict=True)]
    palette = _together(pictures[:: max(len(pictures) // 8, 1)]).quantize(COLOURS)
    reduced = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    content = io.BytesIO()
    reduced[0].save(
        content,
        "gif",
        save_all=True,
        append_images=reduced[1:],
        duration=round(1000 / RATE),
        loop=0,
        optimize=True,
    )
    write_bytes(path, content.getvalue())
