"""The effect templates that a proposal can name, and their previews."""

from collections.abc import Sequence
from pathlib import Path

from joda.errors import JodaError
from joda.pictures.sheet import sheet
from joda.pictures.style import write_png
from joda.template import Template, read_templates


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
