"""Commands that do others for many joints."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from joda.cli.options import (
    BaseUrl,
    Efforts,
    Folder,
    Force,
    Json,
    Key,
    Passive,
    Proposer,
    Resume,
    Rounds,
    Templates,
    Vlm,
)
from joda.cli.progress import progress_bar
from joda.cli.say import say
from joda.cli.tell import evaluation_as_json, print_json, tell_evaluation, telling_cost
from joda.errors import JodaError


def distribute(
    what: Annotated[
        Literal["diagnose", "improve", "generate"],
        typer.Argument(help="What to do with each joint.", show_default=False),
    ],
    cases: Annotated[
        Path,
        typer.Argument(
            help="Folder of folders with a model and its runs; for generate: of models.",
            show_default=False,
        ),
    ],
    output: Folder,
    joint: Annotated[
        str | None,
        typer.Option(help="Which of each model [default: the only one; for generate all]."),
    ] = None,
    passive: Passive = False,
    describe: Annotated[
        str, typer.Option(help="For generate: what the joints should do.", show_default=False)
    ] = "",
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Ray cluster, or local for Ray on this machine [default: processes, no Ray].",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Tasks at a time [default: one per core].")
    ] = None,
    resume: Resume = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Diagnose, improve or generate many joints at once.

    Leaves a folder per joint, with result.json last. Example:

        joda distribute generate out --joint door -o many
    """
    from joda import distribute as run

    with progress_bar() as bar:
        done = run(
            what, cases, output, joint=joint, passive=passive, describe=describe, ray=ray,
            workers=workers, resume=resume, force=force, progress=bar,
        )  # fmt: skip
    failed = sum(one.failed for one in done)
    if as_json:
        print_json([{**asdict(one), "folder": str(one.folder)} for one in done])
    else:
        for one in done:
            state = "failed: " if one.failed else "kept: " if one.kept else ""
            say(f"{one.label}: {state}{one.told}")
        say(f"{len(done) - failed} of {len(done)} done; {output}")
    if failed:
        raise JodaError(f"{failed} of {len(done)} joints have no result; see above.")


def evaluate(
    what: Annotated[
        Literal["proposer"], typer.Argument(help="What to evaluate.", show_default=False)
    ],
    models: Annotated[
        Path,
        typer.Argument(
            help="Folder of models, beside each its MODEL.expected.json.", show_default=False
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder to fill [default: joda_evaluation]."),
    ] = None,
    proposer: Proposer = None,
    rounds: Rounds = 3,
    templates: Templates = None,
    key: Key = "",
    vlm: Vlm = None,
    base_url: BaseUrl = None,
    effort: Efforts = None,
    resume: Resume = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Count what a proposer gets right, and its cost.

    Example:

        joda evaluate proposer out --proposer offline -o evaluated
    """
    from joda import evaluate as run

    with telling_cost(output, as_json), progress_bar() as bar:
        result = run(
            what, models, output, proposer=proposer, rounds=rounds, templates=templates or (),
            key=key, vlm=vlm, base_url=base_url, effort=effort, resume=resume, force=force,
            progress=bar,
        )  # fmt: skip
    if as_json:
        print_json(evaluation_as_json(result))
    else:
        tell_evaluation(result)
    failed = sum(bool(one.failed) for one in result.joints)
    if failed:
        raise JodaError(f"{failed} of {len(result.joints)} joints have no whole answer; see above.")
