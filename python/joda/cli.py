"""The command line: each command is a Python function of the same name."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from math import degrees
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from joda.errors import JodaError
from joda.plugin import load

app = typer.Typer(
    help="Joint dynamics for articulated objects in MuJoCo: latches, detents, friction, damping.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Force = Annotated[bool, typer.Option("--force", help="Overwrite files that exist.")]
Model = Annotated[Path, typer.Argument(help="MJCF or URDF file.", show_default=False)]
Joint = Annotated[
    str, typer.Option("--joint", help="A name, body:NAME[:K] or #K.", show_default=False)
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for scripts.")]


@app.command()
def demo(
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder to fill [default: joda_demo].")
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Let a microwave door go nearly closed, with a latch profile and without.

    Needs no key and no network. Example:

        joda demo -o joda_demo
    """
    from joda import demo as run

    with _progress("demo") as progress:
        result = run(output, force=force, progress=progress)
    if as_json:
        _print_json(
            {key: str(v) if isinstance(v, Path) else v for key, v in asdict(result).items()}
        )
        return
    start, end = degrees(result.start), degrees(result.plain_end)
    print(f"Both doors were let go at rest, {start:.1f} degrees open.")
    print(f"  without a profile: after {result.duration:g} s still {end:.1f} degrees open")
    print(f"  with the latch:    shut itself after {result.shut_after:.2f} s")
    print("Files:")
    for what in ("picture", "profile", "scene", "composed", "plain"):
        print(f"  {getattr(result, what)}")
    print(f"See it move: python -m mujoco.viewer --mjcf={result.scene}")


@app.command()
def attach(
    model: Model,
    composed: Annotated[
        list[Path],
        typer.Argument(help="Profiles (composed.json), one per joint.", show_default=False),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Scene to write.", show_default=False)
    ],
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
    force: Force = False,
) -> None:
    """Write profiles into an existing scene; everything else in the file stays.

    The scene loads in plain MuJoCo wherever joda is installed. Example:

        joda attach microwave.xml composed.json -o scene.xml
    """
    from joda import attach as run

    for note in run(model, composed, output, joint=joint, native=native, force=force):
        print(note)
    print(output)


@app.command()
def compile(
    proposal: Annotated[Path, typer.Argument(help="proposal.json.", show_default=False)],
    model: Annotated[Path, typer.Option("--model", help="MJCF or URDF file.", show_default=False)],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="composed.json to write.", show_default=False)
    ],
    joint: Annotated[
        str | None, typer.Option("--joint", help="The joint, if not the one the proposal names.")
    ] = None,
    templates: Annotated[
        list[Path] | None, typer.Option("--templates", help="Further folders of templates.")
    ] = None,
    key: Annotated[
        str, typer.Option("--key", help="Another key draws other numbers for the same words.")
    ] = "",
    force: Force = False,
) -> None:
    """Compile a proposal's words (weak, medium, strong...) to physical curves.

    The same proposal and key give the same bytes. Example:

        joda compile proposal.json --model microwave.xml --joint door -o composed.json
    """
    from joda import compile as run

    run(proposal, model, joint, output, templates=templates or (), key=key, force=force)
    print(output)


@app.command()
def context(
    model: Model,
    joint: Joint,
    as_json: Annotated[
        Path | None, typer.Option("--json", help="Write the whole context to this file.")
    ] = None,
    force: Force = False,
) -> None:
    """Tell what the model knows of a joint: axes, range, inertia, gravity, which end is up.

    Example:

        joda context microwave.xml --joint door
    """
    from joda import context as run
    from joda.files import check_target, write_text

    if as_json:
        check_target(as_json, force)
    found = run(model, joint)
    if as_json:
        write_text(as_json, found.model_dump_json(indent=2) + "\n")
    print(found.describe())
    if as_json:
        print(as_json)


@app.command()
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
    """Draw a profile: force with its friction band, gravity's equilibrium, damping, components.

    Gravity is drawn for a scene. Example:

        joda plot scene.xml --joint door -o profile.png
    """
    from joda import plot as run

    print(run(source, output, joint=joint, force=force))


@app.command()
def render(
    model: Model,
    joint: Joint,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder to fill.", show_default=False)
    ],
    count: Annotated[int, typer.Option(min=2, help="How many positions.")] = 5,
    force: Force = False,
) -> None:
    """Picture a joint at several positions: what it moves, its axis, which way is +q.

    Example:

        joda render microwave.xml --joint door -o pictures
    """
    from joda import render as run

    with _progress("render"):
        paths = run(model, joint, output, count=count, force=force)
    for path in paths:
        print(path)


@app.command()
def bench(
    scene: Annotated[
        Path | None, typer.Argument(help="Scene with profiles [default: hinges of our own].")
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure what profiles cost per step, as ratios within one run.

    Example:

        joda bench
    """
    from joda import bench as run

    with _progress("bench") as progress:
        rows = run(scene, progress=progress)
    if as_json:
        _print_json([asdict(row) for row in rows])
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("comparison", "ratio", "required", "µs per step", box=None, pad_edge=False)
    for row in rows:
        ours, other = row.microseconds
        table.add_row(
            row.what, f"{row.ratio:.3f} ± {row.spread:.3f}", row.bar, f"{ours:.2f} / {other:.2f}"
        )
    Console(width=None if sys.stdout.isatty() else 110).print(table)


@app.command()
def schema(
    file: Annotated[
        Literal["composed", "proposal", "template"], typer.Argument(help="Which file.")
    ] = "composed",
) -> None:
    """Print the JSON Schema of a file format.

    Example:

        joda schema composed
    """
    from joda import schema as run

    _print_json(run(file))


def main() -> None:
    """Runs the command line; a user's mistake is one sentence on stderr and exit status 2."""
    try:
        load()
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except JodaError as error:
        status = _fail(str(error))
    except (typer.Abort, KeyboardInterrupt):
        status = _fail("interrupted.", 130)
    except typer.TyperException as error:
        status = _fail(error.format_message() + " Try --help.")
    sys.exit(status if isinstance(status, int) else 0)


def _fail(message: str, status: int = 2) -> int:
    print(f"joda: {message}", file=sys.stderr)
    return status


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2, ensure_ascii=False))


@contextmanager
def _progress(task: str) -> Iterator[Any]:
    """A spinner on stderr that tells what is being done; silent where stderr is no terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda what: None
        return
    with console.status(task) as status:
        yield lambda what: status.update(f"{task}: {what}")
