"""`joda studio`: a page in the browser, on this machine only, to look at a joint and change it."""

from collections.abc import Callable, Sequence
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from joda.errors import JodaError
from joda.terminal import interrupt, options
from joda.terminal.say import say


def studio(
    scene: str | Path,
    joint: str | None = None,
    runs: Sequence[str | Path] = (),
    *,
    passive: bool = False,
    folder: str | Path | None = None,
    port: int | None = None,
    browser: bool = True,
    ready: Callable[[str], None] = lambda address: None,
) -> None:
    """Serves a page on which a joint's profile is seen and changed, until it is interrupted.

    Once in a process: NiceGUI has one application.

    Args:
        scene: MJCF or URDF, with or without a profile on the joint. It is never changed.
        joint: its name or address, see `joda.scenes.model.find_joint`; by default the one that
            carries a profile, or that is the only one.
        runs: measured CSV files to show beside the model; more can be added on the page.
        passive: whether the actuators on the joint, if there are any, were off.
        folder: of the project: nothing outside of it is read or written. By default the scene's.
        port: of the page on 127.0.0.1; by default 8642, or if that is taken another one.
        browser: whether to open the page in a browser.
        ready: told the page's address, with its token, when it answers.

    Raises:
        JodaError: NiceGUI is not installed, a file cannot be read or lies outside the folder, the
            joint is not clear, or the port is taken.
    """
    if find_spec("nicegui") is None:
        raise JodaError('joda studio needs NiceGUI: install it with: pip install "joda[studio]"')
    from joda.commands.studio.guard import free_port
    from joda.commands.studio.session import StudioSession

    place = Path(folder) if folder is not None else None
    with closing(StudioSession(Path(scene), joint, place, passive)) as session:
        for run in runs:
            session.add_run(Path(run).absolute())
        number = free_port(port)

        from joda.commands.studio.page import serve
        from joda.commands.studio.shared import Shared

        serve(Shared(session), number, browser, ready)


def command(
    scene: options.Model,
    runs: Annotated[
        list[Path] | None,
        typer.Argument(help="Measured runs (CSV: time, position, force).", show_default=False),
    ] = None,
    joint: Annotated[
        str | None,
        typer.Option(help="A name, body:NAME[:K] or #K [default: the one there is]."),
    ] = None,
    passive: options.Passive = False,
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

    def ready(address: str) -> None:
        say(f"{address}   (Ctrl-C ends it)")

    studio(
        scene, joint, runs or (), passive=passive, folder=folder, port=port, browser=browser,
        ready=ready,
    )  # fmt: skip
    interrupt.forget()
