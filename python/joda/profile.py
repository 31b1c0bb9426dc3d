"""A joint's profile, `composed.json`: three channels over the joint's position.

Positions are normalised, s = (q - lo) / (hi - lo). A channel is the sum, or the maximum, of local
components; a component is a PCHIP curve through its control points, on its closed interval [a, b]
of s and nowhere else. Where no component covers s the channel is zero. Beyond the joint's range a
channel keeps the value it has at that end.

The same numbers travel as text in the plugin's MJCF attributes (`Profile.attributes`):

    label: a b | x0 x1 ... | y0 y1 ... ; label: a b | ...
"""

import json
import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from joda.errors import JodaError
from joda.files import read_text

MIN_WIDTH = 1e-9
"""Narrowest interval, and narrowest gap between control points, in normalised position."""
MAX_VALUE = 1e15
"""Largest magnitude of a control point's value; no coefficient of a cubic can overflow."""

CHANNELS = ("conservative", "friction", "damping")
ATTRIBUTES = ("range", *(f"{name}{part}" for name in CHANNELS for part in ("", "_combine")))
"""The plugin's attributes for one joint."""


class Frozen(BaseModel):
    """A part of a file: immutable, finite, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class File(Frozen):
    """The content of a JSON file."""

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Reads and checks a file; raises JodaError with file, key and remedy."""
        try:
            return cls.model_validate_json(read_text(Path(path)))
        except ValidationError as error:
            raise JodaError(f"{path}: {describe(error)}") from None

    def to_json(self) -> str:
        """The file's text: indented, each list of numbers on one line."""
        text = json.dumps(self.model_dump(mode="json"), indent=2, ensure_ascii=False)
        strings_or_lists = re.compile(r'"(?:[^"\\]|\\.)*"|\[[^\[\]{}"]*\]')

        def fold(match: re.Match[str]) -> str:
            return (
                match[0]
                if match[0][0] == '"'
                else re.sub(r"\s+", " ", match[0]).replace("[ ", "[").replace(" ]", "]")
            )

        return strings_or_lists.sub(fold, text) + "\n"


class Component(Frozen):
    """A local PCHIP curve.

    Attributes:
        label: what it stands for; shown in pictures and kept in the MJCF. No ';' or '|'.
        interval: [a, b] in normalised joint position, 0 <= a < b <= 1.
        x: control points in the local coordinate u = (s - a) / (b - a), from 0 to 1.
        y: values there, N or N·m; N·s/m or N·m·s/rad for damping.
    """

    label: Annotated[str, Field(pattern=r"^[^;|\x00-\x1f]*$")] = ""
    interval: tuple[float, float]
    x: tuple[float, ...]
    y: tuple[float, ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
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

    def text(self) -> str:
        """The component as in the plugin's attributes."""
        numbers = [_numbers(part) for part in (self.interval, self.x, self.y)]
        return (f"{self.label.strip()}: " if self.label.strip() else "") + " | ".join(numbers)


class Channel(Frozen):
    """Components and how they are combined: summed, or the largest of those that cover s."""

    combine: Literal["sum", "max"] = "sum"
    components: tuple[Component, ...] = ()

    def text(self) -> str:
        """The components as in the plugin's attributes."""
        return "; ".join(component.text() for component in self.components)


class Resistance(Channel):
    """A channel of dry friction or damping: nowhere negative."""

    @model_validator(mode="after")
    def _nonnegative(self) -> Self:
        for number, component in enumerate(self.components):
            if min(component.y) < 0:
                raise ValueError(
                    f"components[{number}].y is negative; friction and damping must not be"
                )
        return self


class Channels(Frozen):
    """The three channels of a profile."""

    conservative: Channel = Channel()
    friction: Resistance = Resistance()
    damping: Resistance = Resistance()


class Joint(Frozen):
    """The joint that a profile is for.

    Attributes:
        name: its name in the MJCF or URDF.
        type: hinge or slide.
        range: joint position at s = 0 and at s = 1, in `unit`.
        unit: rad for a hinge, m for a slide.
    """

    name: str
    type: Literal["hinge", "slide"]
    range: tuple[float, float]
    unit: Literal["rad", "m"]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.range[0] < self.range[1]:
            raise ValueError("range must be two increasing numbers")
        if self.unit != ("rad" if self.type == "hinge" else "m"):
            raise ValueError("unit must be rad for a hinge and m for a slide")
        return self


class JointLimitHint(Frozen):
    """How the joint's end stops feel: `elasticity` sets the damping ratio of the limit.

    MuJoCo has one set of limit parameters for both ends; `selected_side` none leaves them alone.
    """

    selected_side: Literal["low_end", "high_end", "none"] = "none"
    elasticity: Literal["none", "weak", "medium", "strong"] = "none"


class Profile(File):
    """A joint's profile: the content of `composed.json`."""

    schema_version: Literal[1] = 1
    joint: Joint
    channels: Channels = Channels()
    effects: tuple[Any, ...] = Field(default=(), max_length=0)
    joint_limit_hint: JointLimitHint = JointLimitHint()

    def attributes(self) -> dict[str, str]:
        """The plugin's attributes for the joint, key to text; empty channels are left out."""
        out = {"range": _numbers(self.joint.range)}
        for name in CHANNELS:
            channel: Channel = getattr(self.channels, name)
            if channel.components:
                out[name] = channel.text()
            if channel.combine != "sum":
                out[f"{name}_combine"] = channel.combine
        return out

    @classmethod
    def from_attributes(cls, joint: Joint, attributes: Mapping[str, str]) -> Self:
        """The profile of `joint` from the plugin's attributes, as the plugin reads them."""
        channels = {
            name: {
                "combine": attributes.get(f"{name}_combine") or "sum",
                "components": _parse(f"joint '{joint.name}': {name}", attributes.get(name, "")),
            }
            for name in CHANNELS
        }
        try:
            return cls.model_validate({"joint": joint.model_dump(), "channels": channels})
        except ValidationError as error:
            raise JodaError(f"joint '{joint.name}': {describe(error)}") from None


def rounded(value: float) -> float:
    """To six significant digits: readable, and the same bytes whatever rounded last."""
    return float(f"{value:.6g}") + 0.0


def describe(error: ValidationError) -> str:
    """The first thing wrong with a file, as one sentence: key, what, what would be right."""
    first = error.errors(include_url=False)[0]
    key = re.sub(r"\.(\d+)", r"[\1]", ".".join(map(str, first["loc"])))
    what = first["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    if first["type"] == "extra_forbidden":
        what = "unknown key; remove it or mend its spelling"
    elif first["type"] == "missing":
        what = "missing; add it"
    elif key == "effects":
        what = "effects beyond the three channels are not supported by this version; leave it empty"
    elif key == "schema_version":
        what = f"this version of joda reads schema_version 1, the file has {first['input']!r}"
    elif first["type"] == "string_pattern_mismatch":
        what = "must not hold ';', '|' or line breaks"
    elif first["type"] == "json_invalid":
        what = what.replace("Invalid JSON: ", "not JSON (") + ")"
    elif first["type"] == "float_parsing":
        what = f"must be a number, not {first['input']!r}"
    elif first["type"] == "too_long":
        count = first["ctx"]
        what = f"must have {count['max_length']} numbers, not {count['actual_length']}"
    return f"{key}: {what}." if key else f"{what}."


def _numbers(values: Iterable[float]) -> str:
    """Numbers that read back exactly, 1 rather than 1.0."""
    return " ".join(repr(value).removesuffix(".0") for value in values)


def _parse(where: str, text: str) -> list[dict[str, Any]]:
    """Components from an attribute's text; the inverse of Channel.text."""
    components = []
    for piece in filter(str.strip, text.split(";")):
        if piece.count("|") != 2:
            form = '"label: a b | x ... | y ..."'
            raise JodaError(f'{where}: expected {form}, got "{piece.strip()}".')
        head, x, y = piece.split("|")
        label, _, interval = head.rpartition(":")
        components.append(
            {
                "label": label.strip(),
                "interval": interval.split(),
                "x": x.split(),
                "y": y.split(),
            }
        )
    return components
