"""Commands that measure: profiles against measured motions, and what they cost."""

from collections.abc import Sequence
from dataclasses import asdict
from json import loads
from pathlib import Path
from typing import Annotated

import typer

from joda.cli.options import (
    STDOUT,
    Corrections,
    Force,
    Joint,
    Joints,
    Json,
    JsonFile,
    Model,
    Passive,
    Runs,
    Scene,
    one_joint_only,
    several,
)
from joda.cli.progress import loss_bar, spinner
from joda.cli.say import say
from joda.cli.tell import (
    print_json,
    tell_changes,
    tell_errors,
    tell_joints,
    tell_ratios,
    tell_worlds,
    with_text_paths,
)
from joda.errors import JodaError


def refine(
    model: Annotated[
        Path, typer.Argument(help="Scene whose joint carries a profile.", show_default=False)
    ],
    runs: Runs,
    joint: Joint,
    output: Scene,
    check: Annotated[
        list[Path] | None, typer.Option(help="A run that is only compared, not fitted.")
    ] = None,
    iterations: Annotated[int, typer.Option(min=1, help="Most iterations of a fit.")] = 120,
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
    finer: Annotated[
        int, typer.Option(min=0, max=3, help="So many times control points are doubled first.")
    ] = 0,
    passive: Passive = False,
    scene: Annotated[
        bool | None,
        typer.Option(
            "--scene/--no-scene",
            help="Simulate the whole scene in MJX, or the joint by itself [default: the scene "
            "where other joints of the logs, or contacts, move the joint].",
            show_default=False,
        ),
    ] = None,
    corrections: Corrections = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Bend a joint's profile until it moves as was measured.

    Leaves, beside the scene, its .composed.json, .png and .history.json, and .corrections.json
    where what is wrong with the runs was given. Example:

        joda refine oven/scene.xml out/let_go_5.csv out/let_go_45.csv --joint door -o better.xml
    """
    from joda import Profile
    from joda import refine as run

    with loss_bar() as bar:
        result = run(
            model, joint, runs, output, check=check or (), iterations=iterations,
            fit=[name.strip() for name in fit.split(",") if name.strip()],  # type: ignore[misc]
            keep_shape=not free_shape, finer=finer, passive=passive, scene=scene,
            corrections=corrections, force=force, progress=bar,
        )  # fmt: skip
    if as_json:
        print_json(with_text_paths(asdict(result)))
        return
    tell_changes(result.changes)
    tell_errors(result, Profile.read(result.composed).joint.unit)
    for note in result.notes:
        say(note)
    beside = result.composed, result.picture, result.history, result.corrections
    for path in filter(None, (result.scene, *beside)):
        say(path)


def compare(
    model: Model,
    runs: Runs,
    joint: Joints = None,
    as_json: JsonFile = None,
    report: Annotated[
        Path | None, typer.Option(help="Write an HTML page with pictures to this file.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the picture (PNG) to this file.")
    ] = None,
    corrections: Corrections = None,
    passive: Passive = False,
    force: Force = False,
) -> None:
    """Replay measured runs: how far off the model is, and where.

    Example:

        joda compare oven/scene.xml out/let_go_5.csv out/let_go_45.csv --joint door --report compare.html
    """  # noqa: E501
    from joda import compare as run
    from joda.measured.comparison import sentences

    written = None if as_json == STDOUT else as_json
    if several(joint):
        one_joint_only(report, output)
        from joda import compare_all

        with spinner("compare") as progress:
            every = compare_all(
                model, runs, joint or (), passive=passive, corrections=corrections, json=written,
                force=force, progress=progress,
            )  # fmt: skip
        if as_json == STDOUT:
            print_json(loads(every.to_json()))
            return
        tell_joints(every)
        if as_json:
            say(as_json)
        return
    assert joint
    with spinner("compare") as progress:
        found = run(
            model, joint[0], runs, passive=passive, corrections=corrections, json=written,
            report=report, picture=output, force=force, progress=progress,
        )  # fmt: skip
    if as_json == STDOUT:
        print_json(loads(found.to_json()))
        return
    for sentence in (*found.notes, *sentences(found)):
        say(sentence)
    for path in filter(None, (written, report, output)):
        say(path)


def bench(
    scene: Annotated[
        Path | None, typer.Argument(help="Scene with profiles [default: hinges of our own].")
    ] = None,
    warp: Annotated[
        bool, typer.Option("--warp", help="In MuJoCo Warp, from 1 to 8192 worlds.")
    ] = False,
    worlds: Annotated[
        list[int] | None, typer.Option(min=1, help="With --warp: so many worlds instead.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw how the cost grows with joints and components: a PNG."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Measure what profiles cost per step, as ratios.

    Example:

        joda bench scene.xml
    """
    if worlds and not warp:
        raise JodaError("--worlds is of --warp; add --warp.")
    if plot and (warp or scene):
        raise JodaError("--plot draws hinges of our own; leave out the scene and --warp.")
    if plot:
        _bench_plot(plot, force, as_json)
        return
    if warp:
        _bench_warp(scene, worlds or (), as_json)
        return
    from joda import bench as run

    with spinner("bench") as progress:
        rows = run(scene, progress=progress)
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    tell_ratios(rows)


def _bench_plot(plot: Path, force: bool, as_json: bool) -> None:
    """`joda bench --plot`."""
    from joda.commands.bench_plot import bench_plot as run

    with spinner("bench") as progress:
        growth = run(plot, force=force, progress=progress)
    if as_json:
        print_json(asdict(growth))
        return
    say(plot)


def _bench_warp(scene: Path | None, worlds: Sequence[int], as_json: bool) -> None:
    """`joda bench --warp`."""
    from joda.plugin import load

    load()
    from joda.warp import quiet
    from joda.warp.bench import WORLDS
    from joda.warp.bench import bench as run

    quiet()
    with spinner("bench") as progress:
        rows = run(scene, worlds=worlds or WORLDS, progress=progress)
    if as_json:
        print_json([asdict(row) for row in rows])
        return
    tell_worlds(rows)
