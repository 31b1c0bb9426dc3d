"""The command that opens the studio's page."""

from pathlib import Path
from typing import Annotated

import typer

from joda.cli import interrupt
from joda.cli.options import Model, Passive
from joda.cli.say import say


def studio(
    scene: Model,
    runs: Annotated[
        list[Path] | None,
        typer.Argument(help="Measured runs (CSV: time, position, force).", show_default=False),
    ] = None,
    joint: Annotated[
        str | None,
        typer.Option(help="A name, body:NAME[:K] or #K [default: the one there is]."),
    ] = None,
    passive: Passive = False,
    folder: Annotated[
        Path | None,
        typer.Option(help="Nothing outside of it is read or written [default: SCENE's]."),
    ] = None,
    port: Annotated[
        int | None, typer.Option(min=1, max=65535, help="Of the page [default: 8642, if free].")
    ] = None,
    browser: Annotated[bool, typer.Option(help="Whether to open it in a browser.")] = True,
) -> None:
    """Look at a joint in the browser, drag its curves, and save.

    The page is served on this machine only, to who has its address. Ctrl-C ends it. Example:

        joda studio oven/scene.xml --joint door
    """
    from joda import studio as run

    def ready(address: str) -> None:
        say(f"{address}   (Ctrl-C ends it)")

    run(
        scene, joint, runs or (), passive=passive, folder=folder, port=port, browser=browser,
        ready=ready,
    )  # fmt: skip
    interrupt.forget()
