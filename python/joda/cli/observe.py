"""Commands that look at a joint and change nothing: what the model knows, pictures, its profile."""

from pathlib import Path
from typing import Annotated

import typer

from joda.cli.options import STDOUT, Folder, Force, Joint, JsonFile, Model
from joda.cli.progress import spinner
from joda.cli.say import say
from joda.cli.tell import print_json


def context(
    model: Model,
    joint: Joint,
    as_json: JsonFile = None,
    force: Force = False,
) -> None:
    """Tell what the model knows of a joint: axes, range, inertia.

    Also what gravity does to it, and which end is up. Example:

        joda context out/oven.xml --joint door
    """
    from joda import context as run
    from joda.files import check_target, write_text
    from joda.plain import plain

    if as_json and as_json != STDOUT:
        check_target(as_json, force)
    found = run(model, joint)
    if as_json == STDOUT:
        print_json(found.model_dump(mode="json"))
        return
    if as_json:
        write_text(as_json, plain(found.model_dump_json(indent=2)) + "\n")
    say(*found.describe().split("\n"), *found.warnings)
    if as_json:
        say(as_json)


def render(
    model: Model,
    joint: Joint,
    output: Folder,
    count: Annotated[int, typer.Option(min=2, help="How many positions.")] = 5,
    force: Force = False,
) -> None:
    """Picture a joint at several positions.

    They show what it moves, its axis, and which way is +q. Example:

        joda render out/oven.xml --joint door -o pictures
    """
    from joda import render as run

    with spinner("render"):
        paths = run(model, joint, output, count=count, force=force)
    for path in paths:
        say(path)


def plot(
    source: Annotated[Path, typer.Argument(help="composed.json, or a scene.", show_default=False)],
    joint: Annotated[
        str | None, typer.Option("--joint", help="Which joint of a scene with several profiles.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="PNG to write [default: beside SOURCE].")
    ] = None,
    force: Force = False,
) -> None:
    """Draw a profile: its components, gravity's equilibrium.

    Gravity is drawn for a scene. Example:

        joda plot scene.xml -o profile.png
    """
    from joda import plot as run

    say(run(source, output, joint=joint, force=force))
