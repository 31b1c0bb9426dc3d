"""Commands that put a joint in motion."""

from dataclasses import fields
from pathlib import Path
from typing import Annotated

import typer

from joda.cli.options import Force, Joint, Json, Model
from joda.cli.progress import progress_bar, spinner
from joda.cli.say import say
from joda.cli.tell import print_json, tell_cases, with_text_paths
from joda.errors import JodaError

ALONE = ("--release", "--push", "--impulse", "--hand")
USUAL = "usual"


def simulate(
    scene: Model,
    joint: Joint,
    release: Annotated[
        str | None, typer.Option(help="Let it go here (rad or m); without a value: half-way.")
    ] = None,
    push: Annotated[
        str | None,
        typer.Option(
            help="Push with this force (N·m or N), see --for; without a value: 10 N at the edge."
        ),
    ] = None,
    impulse: Annotated[
        str | None,
        typer.Option(
            help="This impulse (N·m·s or N·s) within 20 ms; without a value: through "
            "the range in 1 s."
        ),
    ] = None,
    hand: Annotated[
        str | None,
        typer.Option(
            help="A hand takes it to these positions (rad or m, with commas) one after the other; "
            "without a value: opens it and shuts it."
        ),
    ] = None,
    open: Annotated[
        bool, typer.Option("--open", help="A hand opens it slowly, in 10 s: quasi-static.")
    ] = False,
    robot: Annotated[
        Path | None,
        typer.Option(help="A robot of the scene goes through this CSV: time, actuators by name."),
    ] = None,
    start: Annotated[
        float | None, typer.Option(help="Where it begins (rad or m) [default: as in the scene].")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--for", help="How long a push lasts (s) [default: all along].")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Speed of the hand (rad/s or m/s) [default: range / 3 s].")
    ] = None,
    strength: Annotated[
        float | None,
        typer.Option(help="Largest force of the hand (N·m or N) [default: 60 N at the lever arm]."),
    ] = None,
    stiffness: Annotated[
        float | None,
        typer.Option(
            help="Stiffness of the hand (N·m/rad or N/m) [default: 1000 N/m at the lever arm]."
        ),
    ] = None,
    pause: Annotated[
        float | None, typer.Option(help="How long the hand rests at each position (s).")
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(help="Length of the run (s) [default: 3, or until hand or robot is done]."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="CSV to write, and .png [default: beside SCENE]."),
    ] = None,
    gif: Annotated[Path | None, typer.Option(help="Write an animation to this file.")] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Let a joint go, push it, or take it by a hand, in its scene.

    Exactly one of --release, --push, --impulse, --hand, --open and --robot. Leaves a picture and a
    run, which holds time, position, velocity and the force on the joint from outside, as joda
    compare and joda diagnose read it. Example:

        joda simulate oven/scene.xml --joint door --release 0.09 -o shuts.csv

        joda simulate oven/scene.xml --joint door --hand 1.2,0 --pause 0.5 -o hand.csv
    """
    from joda import simulate as run

    with spinner("simulate") as progress:
        done = run(
            scene, joint, release=_number("release", release), push=_number("push", push),
            impulse=_number("impulse", impulse), hand=_positions(hand), open=open, robot=robot,
            start=start, seconds=seconds, speed=speed, strength=strength, stiffness=stiffness,
            pause=pause, duration=duration, output=output, gif=gif, force=force, progress=progress,
        )  # fmt: skip
    if as_json:
        told = {field.name: getattr(done, field.name) for field in fields(done)}
        told |= {"end": float(done.run.position[-1]), "seconds": float(done.run.time[-1])}
        print_json(with_text_paths({key: told[key] for key in told if key != "run"}))
        return
    for sentence in done.sentences:
        say(sentence)
    for path in filter(None, (done.csv, done.picture, done.film)):
        say(path)


def experiments(
    cases: Annotated[
        list[str] | None,
        typer.Argument(help="Names of cases [default: all].", show_default=False),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder to fill [default: joda_experiments]."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="How often each proposal is compiled.")] = 10,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run the paper's cases against both its baselines.

    Leaves a table, and a gallery of pictures. Each case has a number that says what its object
    does; a profile and the baselines fitted to it are parted where the numbers of all seeds are.
    Example:

        joda experiments switch --seeds 1 -o experiments
    """
    from joda import experiments as run

    with progress_bar() as bar:
        done = run(cases or (), output, seeds=seeds, force=force, progress=bar)
    if as_json:
        print_json({one.case.name: one.as_json() for one in done.cases})
        return
    tell_cases(done.cases)
    for path in (done.gallery, done.numbers):
        say(path)


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


def _number(option: str, text: str | None) -> float | bool | None:
    if text is None or text == USUAL:
        return None if text is None else True
    try:
        return float(text)
    except ValueError:
        raise JodaError(f"--{option} is '{text}'; give a number, or nothing.") from None


def _positions(text: str | None) -> list[float] | bool | None:
    if text is None or text == USUAL:
        return None if text is None else True
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise JodaError(
            f"--hand is '{text}'; give positions (rad or m) with commas, as in 1.2,0."
        ) from None
