"""`joda attach`: profiles into a scene."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from joda.scenes.attaching import attach
from joda.terminal import options
from joda.terminal.say import say


def command(
    model: options.Model,
    composed: Annotated[
        list[Path],
        typer.Argument(help="Profiles (composed.json), one per joint.", show_default=False),
    ],
    output: options.Scene,
    joint: Annotated[
        str | None,
        typer.Option(
            "--joint",
            help="Joint for the (only) profile, if not the one that it names: a name, "
            "body:NAME[:K] or #K.",
        ),
    ] = None,
    native: Annotated[
        Literal["replace", "keep"],
        typer.Option(help="The joint's own damping, stiffness and frictionloss."),
    ] = "replace",
    force: options.Force = False,
) -> None:
    """Write profiles into a scene; all else in the file stays.

    The scene loads in plain MuJoCo wherever joda is installed. Example:

        joda attach out/oven.xml out/composed.json -o scene.xml
    """
    for note in attach(model, composed, output, joint=joint, native=native, force=force):
        say(note)
    say(output)
