"""The command line: each command is a Python function of the same name."""

import json
import shutil
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from math import degrees
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from joda.errors import JodaError
from joda.plugin import load

if TYPE_CHECKING:
    from joda.template import Template

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
Templates = Annotated[
    list[Path] | None, typer.Option("--templates", help="Further folders of templates.")
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
    """Give an oven door its behaviour, and compare it with the same door without.

    Needs no key and no network. Example:

        joda demo -o joda_demo
    """
    from joda import demo as run

    with _progress("demo") as progress:
        result = run(output, force=force, progress=progress)
    if as_json:
        told = {key: value for key, value in vars(result).items() if key != "history"}
        told = {key: str(v) if isinstance(v, Path) else v for key, v in told.items()}
        _print_json({**told, "rounds": len(result.history.rounds)})
        return
    for round in result.history.rounds:
        _tell_round(round)
    rows = zip(result.starts, result.plain_ends, result.joda_ends, strict=True)
    for start, plain, ours in rows:
        print(
            f"Let go at {degrees(start):.0f} degrees, {result.duration:g} s later: without a "
            f"profile at {degrees(plain):.1f}, with it at {abs(degrees(ours)):.1f} degrees."
        )
    forces = zip(
        ("without a profile", "with it"), (result.plain_force, result.joda_force), strict=True
    )
    told_forces = [
        f"{name} it {'pulls' if force > 0 else 'holds back'} with up to {abs(force):.1f} N·m"
        for name, force in forces
    ]
    print(f"Opened slowly by hand: {', '.join(told_forces)}.")
    print("Files:")
    for name in (
        "demo.png",
        "profile.png",
        "scene.xml",
        "composed.json",
        "history.json",
        "oven.xml",
    ):
        print(f"  {result.folder / name}")
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
    templates: Templates = None,
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
def generate(
    model: Annotated[
        Path, typer.Argument(help="MJCF or URDF file, or a folder of them.", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder to fill.", show_default=False)
    ],
    joint: Annotated[
        str | None,
        typer.Option(
            "--joint",
            help="A name, body:NAME[:K] or #K; not needed if there is only one. For a folder: only "
            "joints of this name.",
        ),
    ] = None,
    proposer: Annotated[
        str | None,
        typer.Option(
            help="anthropic, offline or a proposal.json [default: anthropic where "
            "ANTHROPIC_API_KEY is set, else offline]."
        ),
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="At most so many proposals.")] = 3,
    describe: Annotated[
        str, typer.Option(help="What the joint should do, in words.", show_default=False)
    ] = "",
    templates: Templates = None,
    key: Annotated[
        str, typer.Option("--key", help="Another key draws other numbers for the same words.")
    ] = "",
    vlm: Annotated[
        str | None, typer.Option(help="The model that anthropic asks [default: $JODA_VLM].")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what the folder holds.")
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Give a joint the behaviour of the object: propose, compile, simulate, revise.

    Leaves context.json, pictures, proposal.json, composed.json, profile.png, scene.xml and
    history.json. A folder of models is done joint by joint. Example:

        joda generate microwave.xml --joint door -o out --describe "it latches shut"
    """
    from joda import generate as run
    from joda import generate_all as run_all

    options: dict[str, Any] = {
        "proposer": proposer, "rounds": rounds, "describe": describe, "templates": templates or (),
        "key": key, "vlm": vlm, "resume": resume, "force": force,
    }  # fmt: skip
    if model.is_dir():
        with _bar() as bar:
            done = run_all(model, output, joint=joint, progress=bar, **options)
        _tell_all(done, as_json)
        return
    with _progress("generate") as progress:
        result = run(model, joint, output, progress=progress, **options)
    if as_json:
        _print_json(_generated(result))
        return
    for round in result.history.rounds:
        _tell_round(round)
    _tell_cost(result.history.usage)
    for note in result.notes:
        print(note)
    print("Files:")
    for name in ("profile.png", "scene.xml", "composed.json", "proposal.json", "history.json"):
        print(f"  {result.folder / name}")
    print(f"See it move: python -m mujoco.viewer --mjcf={result.folder / 'scene.xml'}")


@app.command()
def revise(
    folder: Annotated[Path, typer.Argument(help="What joda generate left.", show_default=False)],
    feedback: Annotated[
        str, typer.Option(help="What is wrong or wanted, in words.", show_default=False)
    ],
    proposer: Annotated[
        str | None, typer.Option(help="anthropic or offline [default: as for generate].")
    ] = None,
    vlm: Annotated[
        str | None, typer.Option(help="The model that anthropic asks [default: $JODA_VLM].")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Although composed.json was edited by hand since.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Change a generated profile in words; what is not complained about stays.

    Example:

        joda revise out --feedback "the final closing pull is too strong"
    """
    from joda import revise as run

    with _progress("revise") as progress:
        result = run(folder, feedback, proposer=proposer, vlm=vlm, force=force, progress=progress)
    if as_json:
        last = result.history.rounds[-1].model_dump(mode="json")
        _print_json({"changes": result.changes, "picture": str(result.picture), "round": last})
        return
    for change in result.changes or ("Nothing changed.",):
        print(change)
    _tell_round(result.history.rounds[-1])
    _tell_cost(result.history.usage)
    for note in result.notes:
        print(note)
    print(result.picture)


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
def refine(
    model: Annotated[
        Path, typer.Argument(help="Scene whose joint carries a profile.", show_default=False)
    ],
    runs: Annotated[list[Path], typer.Argument(help="Measured runs (CSV: time, position, force).")],
    joint: Joint,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Scene to write.", show_default=False)
    ],
    check: Annotated[
        list[Path] | None, typer.Option(help="A run that is only compared, not fitted.")
    ] = None,
    iterations: Annotated[int, typer.Option(min=1, help="At most so many.")] = 15,
    method: Annotated[
        Literal["lm", "adam"], typer.Option(help="Levenberg-Marquardt or Adam.")
    ] = "lm",
    fit: Annotated[
        str,
        typer.Option(
            help="What may change, with commas: values, intervals, strengths, damping_ratio, "
            "inertia, gravity."
        ),
    ] = "values,intervals",
    free_shape: Annotated[
        bool, typer.Option("--free-shape", help="Let curves change sign, rising parts fall.")
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Bend a joint's profile until simulation matches measured motions.

    Leaves, beside the scene, its .composed.json, .png and .history.json. Example:

        joda refine scene.xml run1.csv run2.csv --joint door -o better.xml
    """
    from joda import refine as run

    with _loss_bar() as bar:
        result = run(
            model, joint, runs, output, check=check or (), iterations=iterations, method=method,
            fit=[name.strip() for name in fit.split(",") if name.strip()],  # type: ignore[misc]
            keep_shape=not free_shape, force=force, progress=bar,
        )  # fmt: skip
    if as_json:
        _print_json(
            {key: str(v) if isinstance(v, Path) else v for key, v in asdict(result).items()}
        )
        return
    for change in result.changes or ("Nothing changed.",):
        print(change)
    unit = "rad or m"
    print(
        f"Position error: {result.before:.3g} → {result.after:.3g} {unit} RMS after "
        f"{result.iterations} iterations; the measurement's noise is {result.noise:.2g}."
    )
    if result.checked:
        print(
            f"On the runs held out: {result.checked[0]:.3g} → {result.checked[1]:.3g} {unit} RMS."
        )
    for channel, places in result.unseen.items():
        if places:
            where = ", ".join(f"s = {a:.2f} to {b:.2f}" for a, b in places)
            print(f"The data tell little of {channel} at {where}; there it is as it was before.")
    for note in result.notes:
        print(note)
    for path in (result.scene, result.composed, result.picture, result.history):
        print(path)


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


@app.command()
def templates(
    name: Annotated[
        str | None, typer.Argument(help="Only this template.", show_default=False)
    ] = None,
    folders: Annotated[
        list[Path] | None, typer.Option("--templates", help="Further folders of templates.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="PNG to write, with a preview of each."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """List the effect templates that a proposal can name, or picture their curves.

    Example:

        joda templates -o templates.png
    """
    from joda import templates as run

    found = run(folders or (), output, name=name, force=force)
    if as_json:
        _print_json([one.model_dump(mode="json", exclude_none=True) for one in found.values()])
    elif output:
        print(output)
    else:
        print("\n\n".join(_describe(one) for one in found.values()))


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
        status = _fail(error.format_message().rstrip(".") + ". Try --help.")
    sys.exit(status if isinstance(status, int) else 0)


def _tell_round(round: Any) -> None:
    summary = round.proposal.joint_summary
    print(f"Round {round.number}, {round.proposer}: {summary.motion_description}")
    print(f"  {round.proposal.whole_motion_descrptn}")
    for effect in round.proposal.effect_proposals:
        where = f"{effect.start_ratio:g} to {effect.end_ratio:g}"
        print(f"  - {effect.effect_name}, s = {where}: {effect.reason}")
    print(indent(round.facts, "  "))
    for sentence in (*round.unmet, *round.notes):
        print(f"  ! {sentence}")


def _generated(result: Any) -> dict[str, Any]:
    told: dict[str, Any] = result.history.model_dump(mode="json")
    return {**told, "usage": result.history.usage.model_dump(mode="json"), "notes": result.notes}


def _tell_cost(usage: Any) -> None:
    if usage.requests:
        price = "price unknown" if usage.dollars is None else f"{usage.dollars:.3f} dollars"
        print(
            f"Asked {usage.requests} times: {usage.input_tokens} tokens in "
            f"({usage.cache_read_tokens} from the cache), {usage.output_tokens} out, {price}."
        )


def _tell_all(done: dict[str, Any], as_json: bool) -> None:
    """A line per joint; raises JodaError if some gave nothing."""
    from joda.propose import total

    failed = {label: result for label, result in done.items() if isinstance(result, JodaError)}
    if as_json:
        _print_json(
            {
                label: {"error": str(result)} if label in failed else _generated(result)
                for label, result in done.items()
            }
        )
    else:
        for label, result in done.items():
            if label in failed:
                print(f"{label}: {result}")
                continue
            last = result.history.rounds[-1]
            lacking = " ".join(last.unmet) or "as described"
            print(f"{label}: {last.proposal.joint_summary.motion_description}; {lacking}")
            for note in result.notes:
                print(f"  {note}")
        _tell_cost(total(r.history.usage for r in done.values() if not isinstance(r, JodaError)))
    if failed:
        raise JodaError(f"{len(failed)} of {len(done)} have no profile; see above.")


def _fail(message: str, status: int = 2) -> int:
    print(f"joda: {message}", file=sys.stderr)
    return status


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=2, ensure_ascii=False))


def _describe(template: "Template") -> str:
    """A template as a paragraph no wider than the terminal."""
    present = ", ".join(name for name, curve in template.channels if curve)
    texts = (
        template.description,
        f"Placement: {template.placement}",
        f"Channels: {present or 'none'}",
    )
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    wrap = textwrap.TextWrapper(width, initial_indent="  ", subsequent_indent="  ")
    return "\n".join((template.name, *map(wrap.fill, texts)))


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


@contextmanager
def _bar() -> Iterator[Any]:
    """A progress bar on stderr, silent where stderr is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("")
        yield lambda done, total, what: bar.update(
            task, completed=done, total=total, description=what
        )


@contextmanager
def _loss_bar() -> Iterator[Any]:
    """A progress bar of iterations with the present misfit, silent where stderr is no terminal."""
    with _bar() as bar:
        yield lambda stage, number, total, rms: bar(number, total, f"{stage}, RMS {rms:.3g}")
