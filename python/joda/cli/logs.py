"""The command that makes runs of other logs."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from joda.cli.options import Force, Json
from joda.cli.progress import progress_bar
from joda.cli.say import say
from joda.cli.tell import print_json, tell_understood

if TYPE_CHECKING:
    from joda.commands.import_log import Imported

FILES = 3
"""So many runs are named; of more only how many there are."""


def import_log(
    log: Annotated[
        Path,
        typer.Argument(
            help="LeRobot dataset (folder), ROS bag (folder, .mcap, .db3, .bag) or CSV.",
            show_default=False,
        ),
    ],
    model: Annotated[
        Path, typer.Option(help="MJCF or URDF file whose joints they are.", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the runs.", show_default=False)
    ],
    joint: Annotated[
        str | None,
        typer.Option(help="Only this joint, in runs of one [default: all, in runs of several]."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TARGET=NAME",
            help="Which column is position:JOINT, velocity:JOINT, force:JOINT, ctrl:ACTUATOR or "
            "time.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=UNIT",
            help="A column's unit: rad, deg, turn, m, cm, mm, 0..1, 0..100 (percent), -100..100, "
            "raw; with - before it, the other direction; of times s, ms, us, ns. NAME may have *.",
        ),
    ] = None,
    zero: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=NUMBER",
            help="What a column has where the model has 0, in its own unit. NAME may have *.",
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A column to leave out. NAME may have *."),
    ] = None,
    episode: Annotated[
        list[int] | None, typer.Option(min=0, help="Of a dataset, only this one.")
    ] = None,
    topic: Annotated[list[str] | None, typer.Option(help="Of a bag, only this one.")] = None,
    interpolate: Annotated[
        bool,
        typer.Option("--interpolate", help="Bring what has times of its own to the positions'."),
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Make runs of a LeRobot dataset, a ROS bag or a CSV.

    Prints what it took each column for; what is not sure it refuses, and names the option that
    settles it. Options can be repeated. Reads LeRobot 2 and 3, and of bags (MCAP too) JointState
    and JointTrajectoryControllerState. Examples:

        joda import out/let_go_5.csv --model out/oven.xml --joint door -o runs
        joda import out/let_go_45.csv --model out/oven.xml --column position:door=position -o logs
    """
    from joda import import_log as run

    with progress_bar() as bar:
        made = run(
            log, model, output, joint=joint, columns=column or (), units=unit or (),
            zeros=zero or (), without=without or (), episodes=episode or (), topics=topic or (),
            interpolate=interpolate, force=force, progress=bar,
        )  # fmt: skip
    if as_json:
        print_json({**asdict(made), "runs": [str(path) for path in made.runs]})
        return
    _tell(made, output)


def _tell(made: "Imported", output: Path) -> None:
    runs = "1 run" if len(made.runs) == 1 else f"{len(made.runs)} runs"
    say(f"{made.format}: {runs}, {made.seconds:.3g} s, {made.samples} samples.")
    tell_understood(made.columns)
    for one in made.unused:
        say(f"Not used: {one.name}: {one.why}")
    for note in made.notes:
        say(note)
    _name(made.runs, output)


def _name(runs: Sequence[Path], output: Path) -> None:
    for path in runs[: FILES if len(runs) > FILES else len(runs)]:
        say(path)
    if len(runs) > FILES:
        say(f"and {len(runs) - FILES} more in {output}")
