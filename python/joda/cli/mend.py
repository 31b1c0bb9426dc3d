"""Commands that find what a model lacks, and add it."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from joda.cli.options import (
    STDOUT,
    Effects,
    Force,
    Joint,
    Joints,
    Json,
    JsonFile,
    Model,
    Passive,
    Runs,
    Scene,
    Trust,
    one_joint_only,
    several,
)
from joda.cli.progress import progress_bar, spinner
from joda.cli.say import say
from joda.cli.tell import print_json

Report = Annotated[Path | None, typer.Option(help="Write an HTML page with pictures to this file.")]


def diagnose(
    model: Model,
    runs: Runs,
    joint: Joints = None,
    as_json: JsonFile = None,
    report: Report = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the picture (PNG) to this file.")
    ] = None,
    exclude: Annotated[
        list[str] | None, typer.Option(help="An effect that is not considered.")
    ] = None,
    passive: Passive = False,
    trust: Trust = None,
    templates: Effects = None,
    force: Force = False,
) -> None:
    """Tell which effect a model lacks, where, and how much of it.

    What --json writes is for joda add. Example:

        joda diagnose hidden/model.xml hidden/run?.csv --joint joint --json diagnosis.json
    """
    from joda import diagnose as run
    from joda.commands.diagnose import sentences
    from joda.measured.trust import read_trust

    written = None if as_json == STDOUT else as_json
    if several(joint):
        one_joint_only(report, output)
        from joda import diagnose_all

        with progress_bar() as bar:
            every = diagnose_all(
                model, runs, joint or (), exclude=exclude or (), passive=passive,
                trust=read_trust(trust or ()), templates=templates or (), json=written,
                force=force, progress=bar,
            )  # fmt: skip
        if as_json == STDOUT:
            print_json({"joints": {name: asdict(one) for name, one in every.items()}})
            return
        for name, one in every.items():
            say(f"{name}:")
            for sentence in sentences(one):
                say(f"  {sentence}")
        if as_json:
            say(as_json)
        return
    assert joint
    with progress_bar() as bar:
        found = run(
            model, joint[0], runs, exclude=exclude or (), json=written, report=report,
            picture=output, passive=passive, trust=read_trust(trust or ()),
            templates=templates or (), force=force,
            progress=bar,
        )  # fmt: skip
    if as_json == STDOUT:
        print_json(asdict(found))
        return
    for sentence in sentences(found):
        say(sentence)
    for path in filter(None, (written, report, output)):
        say(path)


def add(
    model: Model,
    runs: Runs,
    joint: Joint,
    diagnosis: Annotated[
        Path, typer.Option(help="What joda diagnose --json wrote.", show_default=False)
    ],
    output: Scene,
    effect: Annotated[
        str | None, typer.Option(help="Which effect [default: the diagnosis' first].")
    ] = None,
    passive: Passive = False,
    trust: Trust = None,
    templates: Effects = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Add the effect that a diagnosis names, if that helps.

    It helps if it is plausible and clearly lowers the error on runs held out; else nothing is
    written. Leaves, beside the scene, its .composed.json and .png, and .corrections.json where the
    diagnosis says that the runs' force, clock or zero is wrong. Example:

        joda add hidden/model.xml hidden/run?.csv --joint joint --diagnosis diagnosis.json -o new.xml
    """  # noqa: E501
    from joda import add as run
    from joda.commands.add import sentences
    from joda.measured.trust import read_trust

    with spinner("add") as progress:
        added = run(
            model, joint, diagnosis, runs, output, effect=effect, passive=passive,
            trust=read_trust(trust or ()), templates=templates or (), force=force,
            progress=progress,
        )  # fmt: skip
    if as_json:
        print_json(added.as_json())
        return
    for sentence in sentences(added):
        say(sentence)
    for path in filter(None, (added.scene, added.composed, added.picture, added.corrections)):
        say(path)


def improve(
    model: Model,
    runs: Runs,
    output: Scene,
    joint: Joints = None,
    report: Report = None,
    passive: Passive = False,
    trust: Trust = None,
    templates: Effects = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Diagnose and add until the data support nothing more.

    Leaves, beside the scene, its .composed.json and .png, and .corrections.json where the runs'
    force, clock or zero was wrong; without anything to add or correct, nothing but the report.
    Example:

        joda improve hidden/model.xml hidden/run?.csv --joint joint -o improved.xml
    """
    from joda import improve as run
    from joda.commands.improve import sentences
    from joda.measured.trust import read_trust

    if several(joint):
        one_joint_only(report, None)
        from joda import improve_all

        with spinner("improve") as progress:
            every = improve_all(
                model, runs, output, joint or (), passive=passive,
                trust=read_trust(trust or ()), templates=templates or (),
                force=force, progress=progress,
            )  # fmt: skip
        if as_json:
            print_json({"joints": {name: one.as_json() for name, one in every.items()}})
            return
        for name, one in every.items():
            say(f"{name}:")
            for sentence in sentences(one):
                say(f"  {sentence}")
            for path in filter(None, (one.scene, one.composed, one.picture, one.corrections)):
                say(path)
        return
    assert joint
    with spinner("improve") as progress:
        result = run(
            model, joint[0], runs, output, report=report, passive=passive,
            trust=read_trust(trust or ()), templates=templates or (), force=force,
            progress=progress,
        )  # fmt: skip
    if as_json:
        print_json(result.as_json())
        return
    for sentence in sentences(result):
        say(sentence)
    written = result.scene, result.composed, result.picture, result.corrections, report
    for path in filter(None, written):
        say(path)
