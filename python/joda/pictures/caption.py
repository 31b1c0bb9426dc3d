"""A line of text in the corner of a picture."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from PIL import Image

SIZE = 19 / 720
"""Of the letters, as a share of the picture's height."""


def captioned(image: NDArray[np.uint8], text: str) -> "Image.Image":
    """The picture, shape (height, width, 3), with the text in its lower left corner."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(image)
    pen = ImageDraw.Draw(picture, "RGBA")
    size = max(round(SIZE * picture.height), 11)
    font = _font(size)
    place = (size, picture.height - 1.25 * size)
    left, top, right, bottom = pen.textbbox(place, text, font, anchor="ls")
    pad = 0.42 * size
    box = (left - pad, top - pad, right + pad, bottom + pad)
    pen.rounded_rectangle(box, radius=pad, fill=(255, 255, 255, 217))
    pen.text(place, text, "#222222", font, anchor="ls")
    return picture


@cache
def _font(size: int) -> Any:
    import matplotlib
    from PIL import ImageFont

    face = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return ImageFont.truetype(str(face), size)
