"""The house style of all figures: colours, numbers and texts as they are written, PNG files."""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joda.files import check_target, write_bytes
from joda.plain import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {"conservative": "#c8202f", "friction": "#d98c1f", "damping": "#1f8a70"}
EFFECTS = "#6b4fa0"
GRAVITY = "#1f5fbf"
INK = "#333333"

COMPRESSED = 3
"""Of 9, zlib's: files are a tenth larger than with its usual 6, and made in half the time."""


def write_png(figure: "Figure", path: str | Path, force: bool = False) -> None:
    """Writes the figure as PNG; raises JodaError if `path` exists and `force` is off."""
    target = Path(path)
    check_target(target, force)
    write_bytes(target, png(figure))


def png(figure: "Figure") -> bytes:
    """The figure as a PNG file's content."""
    content = io.BytesIO()
    with house_style():
        pil_kwargs = {"compress_level": COMPRESSED}
        figure.savefig(content, format="png", dpi=figure.dpi, pil_kwargs=pil_kwargs)
    return content.getvalue()


def note(axes: "Axes", text: str, height: float = 0.5) -> None:
    """A remark in a panel that would be empty."""
    style: dict[str, Any] = {"fontsize": 8, "color": "#999999", "style": "italic"}
    style |= {"ha": "center", "va": "center", "transform": axes.transAxes}
    axes.text(0.5, height, text, **style)


def number(value: float) -> str:
    """Four digits at most, with a minus sign proper."""
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")


def clean(text: str) -> str:
    """The text in one line, of bounded length."""
    return plain(" ".join(text.split())[:300])


def text_width(figure: Any, text: str, size: float, weight: str = "normal") -> float:
    """Width of a text in pixels."""
    from matplotlib.font_manager import FontProperties

    font = FontProperties(size=size, weight=weight)
    renderer = figure.canvas.get_renderer()
    return float(renderer.get_text_width_height_descent(text, font, ismath=False)[0])


def shorten(figure: Any, text: str, size: float, room: float, weight: str = "normal") -> str:
    """The text, or as much of its beginning as fits into `room` pixels, with an ellipsis."""
    if text_width(figure, text, size, weight) <= room:
        return text
    while text and text_width(figure, text + "…", size, weight) > room:
        text = text[:-1].rstrip()
    return text + "…" if text else ""


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's defaults whatever the user's matplotlibrc; no warning for a missing glyph."""
    import matplotlib.style

    with matplotlib.style.context("default"), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield
