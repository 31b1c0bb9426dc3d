"""Commands that give a joint its profile: the demo, the loop, and its steps by themselves."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from joda.cli.options import (
    BaseUrl,
    Efforts,
    Folder,
    Force,
    Joint,
    Json,
    Key,
    Model,
    Proposer,
    Resume,
    Rounds,
    Scene,
    Templates,
    Vlm,
)
from joda.cli.progress import progress_bar, spinner
from joda.cli.review import look_at
from joda.cli.say import say
from joda.cli.tell import (
    generated_as_json,
    print_json,
    tell_all,
    tell_changes,
    tell_cost,
    tell_doors,
    tell_estimate,
    tell_files,
    tell_nearest,
    tell_round,
    tell_viewer,
    telling_cost,
    with_text_paths,
)
from joda.errors import JodaError


def demo(
    what: Annotated[
        Literal["oven", "hidden-effect"],
        typer.Argument(
            help="An oven door gets its behaviour; or a joint's hidden effect is found and added."
        ),
    ] = "oven",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Folder to fill [default: joda_demo, or joda_hidden_effect]."
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="hidden-effect: draws the same joint again.")
    ] = None,
    reveal: Annotated[
        bool, typer.Option("--reveal", help="hidden-effect: say at once what is hidden.")
    ] = False,
    position_only: Annotated[
        bool, typer.Option("--position-only", help="hidden-effect: no force is recorded.")
    ] = False,
    alien: Annotated[
        bool, typer.Option("--alien", help="hidden-effect: a law of no catalogue, to be learned.")
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Give an oven door its behaviour, beside the door without.

    Or simulate a joint with an effect that its model lacks, find it from measured runs, add it,
    and open the seal. Needs no key and no network. Example:

        joda demo -o out

        joda demo hidden-effect --seed 9 --position-only -o hidden
    """
    if what == "hidden-effect":
        _hidden_effect(
            output, as_json, seed=seed, reveal=reveal, position_only=position_only, alien=alien,
            force=force,
        )  # fmt: skip
        return
    if seed is not None or reveal or position_only or alien:
        raise JodaError(
            "--seed, --reveal, --position-only and --alien go with joda demo hidden-effect."
        )
    from joda import demo as run

    with spinner("demo") as progress:
        result = run(output, force=force, progress=progress)
    if as_json:
        told = {key: value for key, value in vars(result).items() if key != "history"}
        print_json({**with_text_paths(told), "rounds": len(result.history.rounds)})
        return
    for round in result.history.rounds:
        tell_round(round)
    tell_doors(result)
    names = "demo.png", "profile.png", "scene.xml", "composed.json", "history.json", "oven.xml"
    tell_files(result.folder, names)
    tell_viewer(result.scene)


def _hidden_effect(output: Path | None, as_json: bool, **options: Any) -> None:
    from joda import hidden_effect

    if as_json:
        result = hidden_effect(output, **options)
        print_json({**with_text_paths(asdict(result))})
        return
    result = hidden_effect(output, say=say, **options)
    names = "compare.html", "diagnosis.html", "new.xml", "new.png", "unseen.html", "sealed.json"
    tell_files(result.folder, [name for name in names if (result.folder / name).exists()])


def generate(
    model: Annotated[
        Path, typer.Argument(help="MJCF or URDF file, or a folder of them.", show_default=False)
    ],
    output: Folder,
    joint: Annotated[
        str | None,
        typer.Option(
            "--joint",
            help="A name, body:NAME[:K] or #K; not needed if there is only one. For a folder: only "
            "joints of this name.",
        ),
    ] = None,
    proposer: Proposer = None,
    rounds: Rounds = 3,
    describe: Annotated[
        str, typer.Option(help="What the joint should do, in words.", show_default=False)
    ] = "",
    templates: Templates = None,
    key: Key = "",
    vlm: Vlm = None,
    base_url: BaseUrl = None,
    effort: Efforts = None,
    resume: Resume = False,
    estimate: Annotated[
        bool, typer.Option("--estimate", help="Only say what asking a model will about cost.")
    ] = False,
    review: Annotated[
        bool,
        typer.Option(
            "--review",
            help="Of a folder: ask about the doubtful joints, the least sure first; with --resume "
            "about those of before.",
        ),
    ] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Give a joint the behaviour of its object.

    Effects are proposed, compiled, simulated and revised. Leaves context.json, pictures,
    proposal.json, composed.json, profile.png, scene.xml and history.json. A folder of models is
    done joint by joint, and ends with a contact sheet, sheet.html. Example:

        joda generate out/oven.xml --joint door -o stays --describe "it stays wherever it is left"
    """
    from joda import generate as run
    from joda import generate_all as run_all

    asked: dict[str, Any] = {
        "proposer": proposer, "rounds": rounds, "describe": describe, "templates": templates or (),
        "vlm": vlm, "base_url": base_url, "effort": effort,
    }  # fmt: skip
    if estimate or not (as_json or resume):
        from joda.commands.estimate import estimate as cost

        expected = cost(model, joint, output, **asked)
        if estimate or expected:
            tell_estimate(expected, as_json)
        if estimate:
            return
    options = {**asked, "key": key, "resume": resume, "force": force}
    if model.is_dir():
        from joda.commands.generate_all import SHEET

        with telling_cost(output, as_json), progress_bar() as bar:
            done = run_all(model, output, joint=joint, progress=bar, **options)
        if review:
            done = run_all(model, output, joint=joint, review=look_at, **options | {"resume": True})
        tell_all(done, output / SHEET, as_json)
        return
    if review:
        raise JodaError("--review goes with a folder of models; change one joint with joda revise.")
    with telling_cost(output, as_json), spinner("generate") as progress:
        result = run(model, joint, output, progress=progress, **options)
    if as_json:
        print_json(generated_as_json(result))
        return
    for round in result.history.rounds:
        tell_round(round)
    tell_cost(result.history.usage)
    for note in result.notes:
        say(note)
    names = "profile.png", "scene.xml", "composed.json", "proposal.json", "history.json"
    tell_files(result.folder, names)
    tell_viewer(result.folder / "scene.xml")


def revise(
    folder: Annotated[Path, typer.Argument(help="What joda generate left.", show_default=False)],
    feedback: Annotated[
        str, typer.Option(help="What is wrong or wanted, in words.", show_default=False)
    ],
    proposer: Annotated[
        str | None, typer.Option(help="anthropic, openai or offline [default: as for generate].")
    ] = None,
    vlm: Vlm = None,
    base_url: BaseUrl = None,
    effort: Efforts = None,
    force: Annotated[
        bool, typer.Option("--force", help="Although composed.json was edited by hand since.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Change a generated profile in words; the rest stays.

    Example:

        joda revise oven --feedback "the final closing pull is too strong"
    """
    from joda import revise as run

    with spinner("revise") as progress:
        result = run(
            folder, feedback, proposer=proposer, vlm=vlm, base_url=base_url, effort=effort,
            force=force, progress=progress,
        )  # fmt: skip
    if as_json:
        last = result.history.rounds[-1].model_dump(mode="json")
        print_json({"changes": result.changes, "picture": str(result.picture), "round": last})
        return
    tell_changes(result.changes)
    tell_round(result.history.rounds[-1])
    tell_cost(result.history.usage)
    for note in result.notes:
        say(note)
    say(result.picture)


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
    key: Key = "",
    force: Force = False,
) -> None:
    """Compile a proposal's words to physical curves.

    The same proposal and key give the same bytes. Example:

        joda compile oven/proposal.json --model out/oven.xml -o composed.json
    """
    from joda import compile as run

    run(proposal, model, joint, output, templates=templates or (), key=key, force=force)
    say(output)


def weigh(
    model: Model,
    joint: Joint,
    output: Scene,
    force: Annotated[
        bool,
        typer.Option("--force", help="Overwrite the output; replace a mass that can be, too."),
    ] = False,
) -> None:
    """Give what a joint moves a mass estimated from its size.

    For models whose mass cannot be, as `joda context` and `joda generate` say. Rough, within a
    factor of three; a scale is better. Example:

        joda weigh out/oven.xml --joint door -o weighed.xml --force
    """
    from joda import weigh as run

    done = run(model, joint, output, force=force)
    for warning in done.warnings:
        say(warning)
    say(f"{done.describe()}; weigh it if you can.", output)


def attach(
    model: Model,
    composed: Annotated[
        list[Path],
        typer.Argument(help="Profiles (composed.json), one per joint.", show_default=False),
    ],
    output: Scene,
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
    """Write profiles into a scene; all else in the file stays.

    The scene loads in plain MuJoCo wherever joda is installed. Example:

        joda attach out/oven.xml out/composed.json -o scene.xml
    """
    from joda import attach as run

    for note in run(model, composed, output, joint=joint, native=native, force=force):
        say(note)
    say(output)


def export(
    scene: Annotated[Path, typer.Argument(help="Scene with profiles.", show_default=False)],
    to: Annotated[
        Literal["native", "urdf", "sdf", "usd"],
        typer.Option(help="native: MJCF without the plugin; urdf; sdf; usd.", show_default=False),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="File to write.", show_default=False)
    ],
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Write the nearest that URDF, SDF, USD or plain MJCF can say.

    Example:

        joda export scene.xml --to urdf -o scene.urdf
    """
    from joda import export as run

    result = run(scene, to, output, force=force)
    if as_json:
        print_json({**asdict(result), "files": [str(path) for path in result.files]})
        return
    tell_nearest(result.joints)
    for note in result.notes:
        say(note)
    for path in result.files:
        say(path)
