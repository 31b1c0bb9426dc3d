"""A local PCHIP curve over a joint's position: what profiles and effects are made of."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from joda.plain import plain

MIN_WIDTH = 1e-9
"""Narrowest interval, and narrowest gap between control points, in normalised position."""
MAX_VALUE = 1e15
"""Largest magnitude of a control point's value; no coefficient of a cubic can overflow."""
MAX_COMPONENTS = 200
"""Most components of one channel."""
MAX_POINTS = 2000
"""Most control points of one channel, all its components' together."""

LONGEST_TEXT = 10_000
"""Characters of a text; a page has fewer."""


class Frozen(BaseModel):
    """A part of a file: immutable, finite, of bounded texts, without unknown keys."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, str_max_length=LONGEST_TEXT
    )


Points = Annotated[tuple[float, ...], Field(max_length=MAX_POINTS)]
"""Numbers of a curve's control points."""


class Curve(Frozen):
    """A PCHIP curve on an interval of the joint's position.

    Attributes:
        interval: [a, b] in normalised joint position, 0 <= a < b <= 1.
        x: control points in the local coordinate u = (s - a) / (b - a), from 0 to 1.
        y: values there.
    """

    interval: tuple[float, float]
    x: Points
    y: Points

    @model_validator(mode="after")
    def _check_curve(self) -> Self:
        a, b = self.interval
        if not 0 <= a < b <= 1:
            raise ValueError("interval must satisfy 0 <= a < b <= 1, in normalised joint position")
        if b - a < MIN_WIDTH:
            raise ValueError("interval is narrower than 1e-9 of the range")
        if len(self.x) < 2:
            raise ValueError("at least two control points are needed")
        if len(self.x) != len(self.y):
            raise ValueError(
                f"x has {len(self.x)} numbers and y has {len(self.y)}; they must be equally many"
            )
        if self.x[0] != 0 or self.x[-1] != 1:
            raise ValueError("x must begin at 0 and end at 1")
        gaps = ((right - left) * (b - a) for left, right in pairwise(self.x))
        if any(not gap >= MIN_WIDTH for gap in gaps):
            raise ValueError("x must increase, by at least 1e-9 of the joint's range")
        if max(map(abs, self.y)) > MAX_VALUE:
            raise ValueError("y must lie between -1e15 and 1e15")
        return self

    def curve_text(self) -> str:
        """The curve as in the plugin's attributes: a b | x ... | y ..."""
        return " | ".join(numbers(part) for part in (self.interval, self.x, self.y))


class Component(Curve):
    """A local curve of a channel.

    Attributes:
        label: what it stands for; shown in pictures and kept in the MJCF. No ';', '|' or
            control characters.
        y: N or N·m; N·s/m or N·m·s/rad for damping.
    """

    label: Annotated[str, Field(pattern=r"^[^;|\x00-\x1f]*$")] = ""

    @field_validator("label")
    @classmethod
    def _check_label(cls, label: str) -> str:
        if plain(label) != label:
            raise ValueError("must not hold control characters or what turns text around")
        return label

    def text(self) -> str:
        """The component as in the plugin's attributes."""
        return (f"{self.label.strip()}: " if self.label.strip() else "") + self.curve_text()


def numbers(values: Iterable[float]) -> str:
    """Numbers that read back exactly, 1 rather than 1.0."""
    return " ".join(repr(value).removesuffix(".0") for value in values)
