"""Commands that say what there is: templates, the files' formats, what is installed and works."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from joda.cli.options import Force, Json, Templates
from joda.cli.progress import spinner
from joda.cli.say import say
from joda.cli.tell import print_json, tell_checks, tell_templates


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
    """List the effect templates, or picture their curves.

    Example:

        joda templates -o templates.png
    """
    from joda import templates as run

    found = run(folders or (), output, name=name, force=force)
    if as_json:
        print_json([one.model_dump(mode="json", exclude_unset=True) for one in found.values()])
    elif output:
        say(output)
    else:
        tell_templates(found.values())


def schema(
    file: Annotated[
        Literal["composed", "proposal", "template", "archetype", "expected", "corrections"],
        typer.Argument(help="Which file."),
    ] = "composed",
) -> None:
    """Print the JSON Schema of a file format.

    Example:

        joda schema composed
    """
    from joda import schema as run

    print_json(run(file))


def doctor(as_json: Json = False) -> None:
    """Say whether all works here, and what to do if not.

    Looks at what is installed, at the plugin, the renderers and joda's cache. Ends with status 1 if
    something that joda needs does not work. Example:

        joda doctor
    """
    from joda import doctor as run

    with spinner("doctor"):
        checks = run()
    fatal = any(check.fatal for check in checks)
    if as_json:
        print_json({"ok": not fatal, "checks": [asdict(check) for check in checks]})
    else:
        tell_checks(checks)
    raise typer.Exit(int(fatal))
