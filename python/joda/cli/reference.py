"""Commands that say what may be written: the library of templates, and the files' formats."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from joda.cli.options import Force, Json, Templates
from joda.cli.tell import print_json, tell_templates


def templates(
    name: Annotated[
        str | None, typer.Argument(help="Only this template.", show_default=False)
    ] = None,
    folders: Templates = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="PNG to write, with a preview of each."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """List the effect templates that a proposal can name, or picture their curves.

    Example:

        joda templates -o templates.png
    """
    from joda import templates as run

    found = run(folders or (), output, name=name, force=force)
    if as_json:
        print_json([one.model_dump(mode="json", exclude_none=True) for one in found.values()])
    elif output:
        print(output)
    else:
        tell_templates(found.values())


def schema(
    file: Annotated[
        Literal["composed", "proposal", "template"], typer.Argument(help="Which file.")
    ] = "composed",
) -> None:
    """Print the JSON Schema of a file format.

    Example:

        joda schema composed
    """
    from joda import schema as run

    print_json(run(file))
