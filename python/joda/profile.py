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
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from joda.component import MAX_COMPONENTS, MAX_POINTS, Component, Frozen, numbers
from joda.effects import AddedInertia, AnyEffect, Effect, GravityOffset
from joda.errors import JodaError
from joda.files import read_json
from joda.plain import plain

CHANNELS = ("conservative", "friction", "damping")
NOUNS = {"conservative": "force", "friction": "friction", "damping": "damping"}
"""What a channel is of, in words."""
ATTRIBUTES = (
    "range",
    *(f"{name}{part}" for name in CHANNELS for part in ("", "_combine")),
    "effects",
)
"""The plugin's attributes for one joint."""

BOTH = {
    "quadratic_damping": "in both directions excludes that in one",
    "end_stop_restitution": "at both ends excludes that at one",
}
"""Effects that act on both sides unless they name one, and what follows from it."""

FARTHEST, NARROWEST = 1e6, 1e-9
"""Bounds of a joint's range, rad or m: beyond them its positions are not finite or not distinct."""


class File(Frozen):
    """The content of a JSON file."""

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Reads and checks a file; raises JodaError with file, key and remedy."""
        try:
            return cls.model_validate_json(read_json(Path(path)))
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

        return plain(strings_or_lists.sub(fold, text)) + "\n"


class Channel(Frozen):
    """Components and how they are combined: summed, or the largest of those that cover s.

    There are at most 200 components in it, which together have at most 2000 control points.
    """

    combine: Literal["sum", "max"] = "sum"
    components: Annotated[tuple[Component, ...], Field(max_length=MAX_COMPONENTS)] = ()

    @model_validator(mode="after")
    def _bearable(self) -> Self:
        points = sum(len(component.x) for component in self.components)
        if points > MAX_POINTS:
            raise ValueError(
                f"the components have {points} control points together; at most {MAX_POINTS} are "
                "possible"
            )
        return self

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
        if max(map(abs, self.range)) > FARTHEST or self.range[1] - self.range[0] < NARROWEST:
            raise ValueError(
                f"range must lie between -{FARTHEST:g} and {FARTHEST:g} and be {NARROWEST:g} wide"
            )
        if self.unit != ("rad" if self.type == "hinge" else "m"):
            raise ValueError("unit must be rad for a hinge and m for a slide")
        return self

    @property
    def force_unit(self) -> Literal["N·m", "N"]:
        """Of the generalised force on it."""
        return "N·m" if self.type == "hinge" else "N"

    def unit_of(self, channel: str) -> str:
        """Of a channel's values: a force's, or of damping a force's per velocity."""
        return f"{self.force_unit}·s/{self.unit}" if channel == "damping" else self.force_unit


class JointLimitHint(Frozen):
    """How the joint's end stops feel: `elasticity` sets the damping ratio of the limit.

    MuJoCo has one set of limit parameters for both ends; `selected_side` none leaves them alone.
    """

    selected_side: Literal["low_end", "high_end", "none"] = "none"
    elasticity: Literal["none", "weak", "medium", "strong"] = "none"


class Profile(File):
    """A joint's profile: the content of `composed.json`."""

    schema_version: Literal[1, 2] = 1
    joint: Joint
    channels: Channels = Channels()
    effects: tuple[AnyEffect, ...] = ()
    joint_limit_hint: JointLimitHint = JointLimitHint()

    @model_validator(mode="before")
    @classmethod
    def _version(cls, content: Any) -> Any:
        """Effects need version 2: who reads only version 1 would leave them out."""
        if isinstance(content, dict) and content.get("effects"):
            return {**content, "schema_version": max(content.get("schema_version") or 2, 2)}
        return content

    @model_validator(mode="after")
    def _check_effects(self) -> Self:
        keys = [effect.key for effect in self.effects]
        for number, (effect, key) in enumerate(zip(self.effects, keys, strict=True)):
            if key in keys[:number]:
                raise ValueError(f"effects[{number}]: the joint has {key} already")
            if isinstance(effect, GravityOffset) and not effect.fits(self.joint.type):
                needed = "sin and cos" if self.joint.type == "hinge" else "force"
                raise ValueError(f"effects[{number}]: a {self.joint.type} needs {needed}")
        for name, said in BOTH.items():
            if f"{name} both" in keys and sum(name in key for key in keys) > 1:
                raise ValueError(f"{name} {said}")
        return self

    @property
    def added_inertia(self) -> float:
        """What its effects add to the joint's inertia, kg·m² or kg."""
        return sum((e.inertia for e in self.effects if isinstance(e, AddedInertia)), 0.0)

    def with_effect(self, effect: AnyEffect) -> Self:
        """The profile with the effect, in the place of one of the same name and side."""
        kept = tuple(other for other in self.effects if other.key != effect.key)
        return type(self)(
            joint=self.joint,
            channels=self.channels,
            effects=(*kept, effect),
            joint_limit_hint=self.joint_limit_hint,
        )

    def with_component(self, channel: str, component: Component) -> Self:
        """The profile with one more component in a channel; raises JodaError if it is full."""
        old: Channel = getattr(self.channels, channel)
        try:
            new = type(old)(combine=old.combine, components=(*old.components, component))
        except ValidationError as error:
            raise JodaError(
                f"joint '{self.joint.name}': {channel} takes no more: {describe(error)}"
            ) from None
        channels = self.channels.model_copy(update={channel: new})
        return self.model_copy(update={"channels": channels})

    def attributes(self) -> dict[str, str]:
        """The plugin's attributes for the joint, key to text; empty channels are left out."""
        out = {"range": numbers(self.joint.range)}
        for name in CHANNELS:
            channel: Channel = getattr(self.channels, name)
            if channel.components:
                out[name] = channel.text()
            if channel.combine != "sum":
                out[f"{name}_combine"] = channel.combine
        if self.effects:
            out["effects"] = "; ".join(effect.text() for effect in self.effects)
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
        effects = [Effect.fields_of(piece) for piece in _pieces(attributes.get("effects", ""))]
        content = {"joint": joint.model_dump(), "channels": channels, "effects": effects}
        try:
            return cls.model_validate(content)
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
    elif first["type"] == "union_tag_invalid":
        what = (
            f"there is no effect {first['ctx']['tag']!r}; known are {first['ctx']['expected_tags']}"
        )
    elif first["type"] == "union_tag_not_found":
        what = 'the key "effect" is missing; it names the effect'
    elif key == "schema_version":
        what = f"this version of joda reads schema_version 1 and 2, the file has {first['input']!r}"
    elif first["type"] == "string_pattern_mismatch":
        what = "must not hold ';', '|' or line breaks"
    elif first["type"] == "json_invalid":
        what = what.replace("Invalid JSON: ", "not JSON (") + ")"
    elif first["type"] == "float_parsing":
        what = f"must be a number, not {first['input']!r}"
    elif first["type"] == "too_long":
        most, count = first["ctx"]["max_length"], first["ctx"]["actual_length"]
        last = first["loc"][-1]
        noun = "components" if last == "components" else "numbers"
        limit = most if last in ("interval", "range") else f"at most {most}"
        what = f"must have {limit} {noun}, not {count}"
    return f"{key}: {what}." if key else f"{what}."


def _pieces(text: str) -> list[str]:
    """What an attribute lists, separated by ';'."""
    return [piece for piece in text.split(";") if piece.strip()]


def _parse(where: str, text: str) -> list[dict[str, Any]]:
    """Components from an attribute's text; the inverse of Channel.text."""
    components = []
    for piece in _pieces(text):
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
