"""Arguments and options that several commands have."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import typer

from joda.errors import JodaError

Force = Annotated[bool, typer.Option("--force", help="Overwrite files that exist.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]
JsonFile = Annotated[
    Path | None,
    typer.Option("--json", help="Write all numbers to this file; to -, print nothing else."),
]
STDOUT = Path("-")
"""As a `JsonFile`: what would be written is printed, for scripts."""
Model = Annotated[Path, typer.Argument(help="MJCF or URDF file.", show_default=False)]
Runs = Annotated[
    list[Path],
    typer.Argument(
        help="Measured runs (CSV: time, position, perhaps force, ctrl:ACTUATOR; or position:JOINT "
        "of several joints) or curves (position, force)."
    ),
]
Joint = Annotated[
    str, typer.Option("--joint", help="A name, body:NAME[:K] or #K.", show_default=False)
]
Joints = Annotated[
    list[str] | None,
    typer.Option(
        "--joint",
        help="A name, body:NAME[:K] or #K; of logs with position:JOINT several, or all [default: "
        "all].",
        show_default=False,
    ),
]
Report = Annotated[Path | None, typer.Option(help="Write an HTML page with pictures to this file.")]
Picture = Annotated[
    Path | None, typer.Option("-o", "--output", help="Write the picture (PNG) to this file.")
]
Passive = Annotated[
    bool, typer.Option("--passive", help="The joint's actuators were off while it was measured.")
]
Corrections = Annotated[
    Path | None,
    typer.Option(
        help="What is wrong with the runs: the NEW.corrections.json that add or improve left "
        "beside NEW.xml."
    ),
]
Trust = Annotated[
    list[str] | None,
    typer.Option(
        "--trust",
        metavar="NAME=WIDTH",
        help="How far off a number may be (one standard deviation; 0: not at all), as in mass=0.05 "
        "for 5 %; of mass, inertia, gravity, damping, frictionloss, stiffness, "
        "force_scale, actuator_gain; in their units center_of_mass (rad), force_offset (N·m or N), "
        "time_delay (s), position_offset (rad or m).",
    ),
]
Folder = Annotated[Path, typer.Option("-o", "--output", help="Folder to fill.", show_default=False)]
Scene = Annotated[Path, typer.Option("-o", "--output", help="Scene to write.", show_default=False)]
Templates = Annotated[
    list[Path] | None,
    typer.Option(
        "--templates", help="Further folders of templates (*.json) and of archetypes (*.toml)."
    ),
]
Effects = Annotated[
    list[Path] | None,
    typer.Option(
        "--templates", help="Further folders of templates (*.json) of effects that may be missing."
    ),
]
Key = Annotated[
    str, typer.Option("--key", help="Another key draws other numbers for the same words.")
]
Vlm = Annotated[
    str | None,
    typer.Option(help="The model that anthropic or openai asks [default: $JODA_VLM, or a Claude]."),
]
BaseUrl = Annotated[
    str | None,
    typer.Option(
        help="Address of the server that is asked, as http://127.0.0.1:8000/v1 [default: "
        "$OPENAI_BASE_URL, $ANTHROPIC_BASE_URL, or the service's own]."
    ),
]
Efforts = Annotated[
    Literal["low", "medium", "high", "xhigh", "max"] | None,
    typer.Option("--effort", help="How much the model puts in [default: as it does by itself]."),
]
Proposer = Annotated[
    str | None,
    typer.Option(
        help="anthropic, openai, offline or a proposal.json [default: anthropic where "
        "ANTHROPIC_API_KEY is set, else offline]."
    ),
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with what the folder holds.")]
Rounds = Annotated[int, typer.Option(min=1, help="At most so many proposals.")]


ALONE = ("--release", "--push", "--impulse", "--hand")
"""Options of `joda simulate` that may stand alone, for what is usual."""
USUAL = "usual"
"""The value of such an option where none is given."""


def several(joints: Sequence[str] | None) -> bool:
    """Whether `--joint` means several joints of a log, or all."""
    return not joints or len(joints) > 1 or joints[0] == "all"


def one_joint_only(report: Path | None, picture: Path | None) -> None:
    """Raises JodaError where pictures are asked for of several joints."""
    if report or picture:
        option = "--report" if report else "-o"
        raise JodaError(f"{option} is of one joint; name it with --joint, or use --json.")


def with_usual(arguments: list[str]) -> list[str]:
    """The arguments with a word for the usual after options of simulate that stand alone."""
    if arguments[:1] != ["simulate"]:
        return arguments
    out: list[str] = []
    for option, after in zip(arguments, [*arguments[1:], "-"], strict=True):
        out.append(option)
        if option in ALONE and (
            after == "-" or (after[0:1] == "-" and after[1:2].isalpha()) or after.startswith("--")
        ):
            out.append(USUAL)
    return out
