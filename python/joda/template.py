"""Effect templates: equivalent joint-level behaviours as prototype curves, one JSON file each."""

from collections.abc import Sequence
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Self

from pydantic import model_validator

from joda.component import Component, Frozen
from joda.errors import JodaError
from joda.profile import File


class Curve(Frozen):
    """A prototype: PCHIP control points, their largest magnitude 1."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
        Component(interval=(0, 1), x=self.x, y=self.y)
        if max(map(abs, self.y)) != 1:
            raise ValueError("the largest magnitude in y must be 1")
        return self


class Curves(Frozen):
    """Prototypes of the channels; a template may leave channels out."""

    conservative: Curve | None = None
    friction: Curve | None = None
    damping: Curve | None = None

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not any((self.conservative, self.friction, self.damping)):
            raise ValueError("give at least one of conservative, friction and damping")
        return self

    @model_validator(mode="after")
    def _nonnegative(self) -> Self:
        for name in ("friction", "damping"):
            curve = getattr(self, name)
            if curve and min(curve.y) < 0:
                raise ValueError(f"{name}.y is negative; friction and damping must not be")
        return self


class Template(File):
    """An effect that a joint may have.

    Attributes:
        name: the file's name without its ending.
        description: the behaviour, for people and models to choose by.
        placement: where on a joint it is typically found.
        title: what a model without it lacks, in a few words; by default the name's.
        shows: how it shows in measurements, a clause.
        channels: prototype curves in the interval's own coordinate u, from 0 at its low end to 1.
    """

    name: str
    description: str
    placement: str
    title: str = ""
    shows: str = "what is missing there has the shape of the template's curves"
    channels: Curves

    @property
    def named(self) -> str:
        """What a model without it lacks."""
        return self.title or self.name.replace("_", " ")


def read_templates(folders: Sequence[str | Path] = ()) -> dict[str, Template]:
    """The library's templates and those of further folders, by name.

    Args:
        folders: folders of *.json files; a template there replaces one of the same name.

    Returns:
        name to template, sorted by name.

    Raises:
        JodaError: a folder does not exist, or a file is no template.
    """
    paths = []
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise JodaError(f"{folder}: no such folder of templates.")
        paths += sorted(folder.glob("*.json"))
    templates = _library() | {path.stem: _read(path) for path in paths}
    return dict(sorted(templates.items()))


@cache
def _library() -> dict[str, Template]:
    """The library's own, read once."""
    with as_file(files("joda") / "templates") as bundled:
        return {path.stem: _read(path) for path in sorted(bundled.glob("*.json"))}


def _read(path: Path) -> Template:
    template = Template.read(path)
    if template.name != path.stem:
        raise JodaError(f"{path}: name: must be the file's name, '{path.stem}'.")
    return template
