"""`joda compile`: words to curves."""

from pathlib import Path
from typing import Annotated

import typer

from joda.compiling import compile
from joda.terminal import options
from joda.terminal.say import say


def command(
    proposal: Annotated[Path, typer.Argument(help="proposal.json.", show_default=False)],
    model: Annotated[Path, typer.Option("--model", help="MJCF or URDF file.", show_default=False)],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="composed.json to write.", show_default=False)
    ],
    joint: Annotated[
        str | None, typer.Option("--joint", help="The joint, if not the one the proposal names.")
    ] = None,
    templates: options.Templates = None,
    key: options.Key = "",
    force: options.Force = False,
) -> None:
    """Compile a proposal's words to physical curves.

    The same proposal and key give the same bytes. Example:

        joda compile oven/proposal.json --model out/oven.xml -o composed.json
    """
    compile(proposal, model, joint, output, templates=templates or (), key=key, force=force)
    say(output)
