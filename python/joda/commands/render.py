"""`joda render`: pictures of a joint."""

from typing import Annotated

import typer

from joda.pictures.positions import render
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.say import say


def command(
    model: options.Model,
    joint: options.Joint,
    output: options.Folder,
    count: Annotated[int, typer.Option(min=2, help="How many positions.")] = 5,
    force: options.Force = False,
) -> None:
    """Picture a joint at several positions.

    They show what it moves, its axis, and which way is +q. Example:

        joda render out/oven.xml --joint door -o pictures
    """
    with spinner("render"):
        paths = render(model, joint, output, count=count, force=force)
    for path in paths:
        say(path)
