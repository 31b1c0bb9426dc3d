"""The effect templates that a proposal can name, and their previews."""

import shutil
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from joda.errors import JodaError
from joda.pictures.sheet import sheet
from joda.pictures.style import write_png
from joda.template import Template, read_templates
from joda.terminal import options
from joda.terminal.say import print_json, say


def templates(
    folders: Sequence[str | Path] = (),
    output: str | Path | None = None,
    *,
    name: str | None = None,
    force: bool = False,
) -> dict[str, Template]:
    """The library's templates and those of further folders; their previews as a picture.

    Args:
        folders: folders of JSON files; a template there replaces one of the same name.
        output: PNG to write, one preview per template. None: no picture.
        name: only this template.
        force: overwrite the output.

    Returns:
        name to template, sorted by name.

    Raises:
        JodaError: a folder or the name does not exist, a file is no template, or the output cannot
            be written.
    """
    found = read_templates(folders)
    if name is not None:
        if name not in found:
            listed = ", ".join(f"'{known}'" for known in found)
            raise JodaError(f"no template '{name}'; there are: {listed}.")
        found = {name: found[name]}
    if output is not None:
        write_png(sheet(found), output, force)
    return found


def command(
    name: Annotated[
        str | None, typer.Argument(help="Only this template.", show_default=False)
    ] = None,
    folders: options.Templates = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="PNG to write, with a preview of each."),
    ] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """List the effect templates, or picture their curves.

    Example:

        joda templates -o templates.png
    """
    found = templates(folders or (), output, name=name, force=force)
    if as_json:
        print_json([one.model_dump(mode="json", exclude_unset=True) for one in found.values()])
    elif output:
        say(output)
    else:
        _say_templates(found.values())


def _say_templates(found: Iterable[Template]) -> None:
    """A paragraph per template, no wider than the terminal."""
    say(*"\n\n".join(map(_paragraph, found)).split("\n"))


def _paragraph(template: Template) -> str:
    present = ", ".join(name for name, curve in template.channels if curve)
    texts = (
        template.description,
        f"Placement: {template.placement}",
        f"Channels: {present or 'none'}",
    )
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    wrap = textwrap.TextWrapper(width, initial_indent="  ", subsequent_indent="  ")
    return "\n".join((template.name, *map(wrap.fill, texts)))
