"""Archetypes: what kinds of joints there are, by which features they are told, what each does.

They are a table that a person can extend: TOML files in `archetypes/`, and in the folders that are
given with `--templates`. `joda schema archetype` is their format.
"""

import tomllib
from collections.abc import Sequence
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from joda.component import Frozen
from joda.errors import JodaError
from joda.files import read_text
from joda.profile import describe
from joda.propose.archetype_effects import ArchetypeEffect
from joda.propose.plausible import forces
from joda.propose.requirements import REQUIREMENTS
from joda.scenes.shape import Shape

Feature = bool | float | str | tuple[float, float]
"""What an archetype expects of a feature: a value, or from where to where a number lies."""


class Archetype(Frozen):
    """A kind of joint.

    Attributes:
        title: what it is called; one of a later folder replaces one of the same title.
        evidence: why such joints do what is said of them.
        joint: hinge, slide, or either.
        part: concepts of `words.toml`, one of which names the joint or the body that it moves.
        object: concepts, one of which names the object that it belongs to.
        needs_object: whether without such a name it is not this kind.
        shape: what features of `joda.scenes.shape.Shape` it is told by.
        closed: whether the end where it is closed must be "known", or "unknown".
        driven: whether it is one of a machine's joints.
        common: how common it is before anything is known of it, as a logarithm; 0 as any other.
        unknown: whether this is what remains where no other fits.
        force: the row of `forces.toml` that says what opening one takes.
        requirements: what it does, by name, see `joda.propose.requirements`.
        effects: the effects that it does it by.
    """

    title: str
    evidence: str
    joint: Literal["hinge", "slide", "hinge or slide"]
    part: tuple[str, ...] = ()
    object: tuple[str, ...] = ()
    needs_object: bool = False
    shape: dict[str, Feature] = Field(default_factory=dict)
    closed: Literal["known", "unknown", "any"] = "any"
    driven: bool = False
    common: float = 0.0
    unknown: bool = False
    force: str = ""
    requirements: tuple[str, ...]
    effects: Annotated[tuple[ArchetypeEffect, ...], Field(max_length=20)]

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, value in self.shape.items():
            field = Shape.model_fields.get(name)
            if field is None:
                listed = ", ".join(Shape.model_fields)
                raise ValueError(f"shape.{name} is no feature; there are: {listed}")
            number = isinstance(field.default, int | float) and not isinstance(field.default, bool)
            if number == isinstance(value, bool | str):
                raise ValueError(f"shape.{name} must be {'a number' if number else 'a word'}")
            if isinstance(value, tuple) and value[0] > value[1]:
                raise ValueError(f"shape.{name} must be [least, most]")
        for requirement in self.requirements:
            if requirement not in REQUIREMENTS:
                raise ValueError(
                    f"requirements: '{requirement}' is none of {', '.join(REQUIREMENTS)}"
                )
        if self.force and self.force not in forces():
            raise ValueError(f"force: '{self.force}' is none of {', '.join(forces())}")
        return self


class Archetypes(Frozen):
    """The content of a file of archetypes."""

    archetype: tuple[Archetype, ...]


def read_archetypes(folders: Sequence[str | Path] = ()) -> tuple[Archetype, ...]:
    """The library's archetypes and those of further folders, the latter first.

    Args:
        folders: folders of *.toml files.

    Raises:
        JodaError: a folder does not exist, or a file holds no archetypes.
    """
    found = {archetype.title: archetype for archetype in _bundled()}
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise JodaError(f"{folder}: no such folder of archetypes.")
        for path in sorted(folder.glob("*.toml")):
            found |= {archetype.title: archetype for archetype in _read(path)}
    return tuple(found.values())


@cache
def _bundled() -> tuple[Archetype, ...]:
    with as_file(files("joda.propose") / "archetypes") as folder:
        return tuple(one for path in sorted(folder.glob("*.toml")) for one in _read(path))


def _read(path: Path) -> tuple[Archetype, ...]:
    try:
        return Archetypes.model_validate(tomllib.loads(read_text(path))).archetype
    except tomllib.TOMLDecodeError as error:
        raise JodaError(f"{path}: is no TOML: {error}.") from None
    except ValidationError as error:
        raise JodaError(f"{path}: {describe(error)}") from None
