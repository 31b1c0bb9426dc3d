"""The main job: from a joint to a profile that behaves like the object, in rounds."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from joda.errors import JodaError
from joda.files import occupied
from joda.propose import Proposer, total
from joda.propose.asking import Effort, ProposalFailed
from joda.propose.estimate import Estimate
from joda.propose.estimate import estimate as expected_cost
from joda.propose.generate_all import SHEET, Results, generate_all, remarks
from joda.propose.generation import ROUNDS, Generated, begin, check_rounds, choose, run
from joda.propose.history import History
from joda.propose.joints import PassedOver, only_joint
from joda.propose.session import Progress, silent
from joda.scenes.model_cache import loading_once
from joda.template import read_templates
from joda.terminal import options
from joda.terminal.progress import progress_bar, spinner
from joda.terminal.reviewing import look_at
from joda.terminal.rounds import generated_as_json, say_cost, say_round, saying_cost
from joda.terminal.say import print_json, say, say_files, say_viewer


def generate(
    model: str | Path,
    joint: str | None,
    output: str | Path,
    *,
    proposer: str | Path | Proposer | None = None,
    rounds: int = ROUNDS,
    describe: str = "",
    templates: Sequence[str | Path] = (),
    key: str = "",
    vlm: str | None = None,
    base_url: str | None = None,
    effort: Effort | None = None,
    resume: bool = False,
    force: bool = False,
    progress: Progress = silent,
) -> Generated:
    """Proposes a joint's effects, compiles and simulates them, and revises until they fit.

    Args:
        model: MJCF or URDF file.
        joint: a hinge or slide with a range, as `joda.scenes.model.find_joint` takes it. None: the
            only one of the model.
        output: folder to fill; made if missing.
        proposer: "anthropic", "openai" (any server that speaks its chat API), "offline", the path
            of a proposal.json, or an object with a `propose` of its own. By default anthropic where
            ANTHROPIC_API_KEY is set, else offline.
        rounds: at most so many proposals, those of before included.
        describe: what the joint should do, in words.
        templates: further folders of effect templates.
        key: another key draws other strengths within the labels' bands.
        vlm: name of the model that is asked; by default JODA_VLM's, or one of Claude.
        base_url: address of the server that is asked; by default the environment's, or the
            service's own.
        effort: how much the model is to put into an answer: "low", "medium", "high", "xhigh" or
            "max"; by default as much as it does by itself.
        resume: go on with what the folder holds, where its last round left it; `describe`,
            `templates` and `key` are those of before.
        force: overwrite what another generation left in the folder; with `resume`, go on although
            composed.json was edited by hand since, the edit is lost.
        progress: told what is being done.

    Returns:
        what was made.

    Raises:
        ProposalFailed: no proposal was to be had; what was made and spent until then is in the
            folder.
        JodaError: a file cannot be read or written, or the joint does not fit.
    """
    check_rounds(rounds)
    folder, source = Path(output), Path(model)
    name = joint if joint is not None else only_joint(source)
    further = [Path(path) for path in templates]
    if not resume or not (folder / "history.json").is_file():
        _check_free(folder, force)
        # a mistake in it is found before anything is made
        chosen = choose(proposer, key, vlm, base_url, effort)
        if check := getattr(chosen, "check", None):
            check(read_templates(further))
    with loading_once(source):
        session = begin(folder, source, name, describe, further, key, resume, progress)
        asked = choose(proposer, session.history.key, vlm, base_url, effort)
        try:
            run(session, asked, rounds, force)
        except JodaError as error:
            raise ProposalFailed(str(error), session.history.usage) from error
    return Generated(folder, session.history, tuple(session.notes))


def _check_free(folder: Path, force: bool) -> None:
    """Raises JodaError if the folder holds anything but a generation that came to nothing."""
    if force or not occupied(folder):
        return
    path = folder / "history.json"
    if path.is_file():
        history = History.read(path)
        if not history.rounds and not history.failures:
            return
    more = " or go on with --resume" if path.is_file() else ""
    raise JodaError(f"{folder}: exists already; choose another folder with -o, add --force{more}.")


def command(
    model: Annotated[
        Path, typer.Argument(help="MJCF or URDF file, or a folder of them.", show_default=False)
    ],
    output: options.Folder,
    joint: Annotated[
        str | None,
        typer.Option(
            "--joint",
            help="A name, body:NAME[:K] or #K; not needed if there is only one. For a folder: only "
            "joints of this name.",
        ),
    ] = None,
    proposer: options.Proposer = None,
    rounds: options.Rounds = 3,
    describe: Annotated[
        str, typer.Option(help="What the joint should do, in words.", show_default=False)
    ] = "",
    templates: options.Templates = None,
    key: options.Key = "",
    vlm: options.Vlm = None,
    base_url: options.BaseUrl = None,
    effort: options.Efforts = None,
    resume: options.Resume = False,
    estimate: Annotated[
        bool, typer.Option("--estimate", help="Only estimate what asking a model will cost.")
    ] = False,
    review: Annotated[
        bool,
        typer.Option(
            "--review",
            help="Of a folder: ask about the doubtful joints, the least sure first; with --resume "
            "about those of before.",
        ),
    ] = False,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Give a joint the behaviour of its object.

    Effects are proposed, compiled, simulated and revised. Leaves context.json, pictures,
    proposal.json, composed.json, profile.png, scene.xml and history.json. A folder of models is
    done joint by joint, and ends with a contact sheet, sheet.html. Example:

        joda generate out/oven.xml --joint door -o stays --describe "it stays wherever it is left"
    """
    asked: dict[str, Any] = {
        "proposer": proposer, "rounds": rounds, "describe": describe, "templates": templates or (),
        "vlm": vlm, "base_url": base_url, "effort": effort,
    }  # fmt: skip
    if estimate or not (as_json or resume):
        expected = expected_cost(model, joint, output, **asked)
        if estimate or expected:
            _say_estimate(expected, as_json)
        if estimate:
            return
    asked |= {"key": key, "resume": resume, "force": force}
    if model.is_dir():
        with saying_cost(output, as_json), progress_bar() as bar:
            done = generate_all(model, output, joint=joint, progress=bar, **asked)
        if review:
            done = generate_all(
                model, output, joint=joint, review=look_at, **asked | {"resume": True}
            )
        _say_all(done, output / SHEET, as_json)
        return
    if review:
        raise JodaError("--review goes with a folder of models; change one joint with joda revise.")
    with saying_cost(output, as_json), spinner("generate") as progress:
        result = generate(model, joint, output, progress=progress, **asked)
    if as_json:
        print_json(generated_as_json(result))
        return
    for round in result.history.rounds:
        say_round(round)
    say_cost(result.history.usage)
    for note in result.notes:
        say(note)
    names = "profile.png", "scene.xml", "composed.json", "proposal.json", "history.json"
    say_files(result.folder, names)
    say_viewer(result.folder / "scene.xml")


def _say_estimate(estimated: Estimate | None, as_json: bool) -> None:
    """What a generation will about cost."""
    if as_json:
        print_json(estimated and estimated.model_dump(mode="json"))
        return
    if estimated is None:
        say("Nobody would be asked who costs anything.")
        return
    least, most = estimated.least, estimated.most
    dollars = (
        "price unknown (JODA_VLM_PRICE sets it)"
        if least.dollars is None or most.dollars is None
        else f"{_span(least.dollars, most.dollars, '.2g')} dollars"
    )
    say(
        f"Estimate, joints: {estimated.joints}, with {estimated.proposer}: "
        f"{_span(least.requests, most.requests)} requests, "
        f"{_span(least.input_tokens, most.input_tokens)} tokens in, "
        f"{_span(least.output_tokens, most.output_tokens)} out, {dollars}."
    )


def _span(low: float, high: float, form: str = "d") -> str:
    ends = f"{low:{form}}", f"{high:{form}}"
    return " to ".join(dict.fromkeys(ends))


def _say_all(done: Results, sheet: Path, as_json: bool) -> None:
    """A line per joint, what of all does not come true, and the contact sheet.

    Raises JodaError if some gave nothing.
    """
    failed = {label: result for label, result in done.items() if isinstance(result, JodaError)}
    mistakes = [one for one in failed.values() if not isinstance(one, PassedOver)]
    lost = (one.usage for one in mistakes if isinstance(one, ProposalFailed))
    made = {label: result for label, result in done.items() if not isinstance(result, JodaError)}
    if as_json:
        print_json(
            {
                label: {"error": str(failed[label])}
                if label in failed
                else generated_as_json(made[label])
                for label in done
            }
        )
    else:
        for label in done:
            if label in failed:
                say(f"{label}: {failed[label]}")
                continue
            result = made[label]
            last = result.history.rounds[-1]
            lacking = " ".join(last.unmet) or "as described"
            say(f"{label}: {last.proposal.joint_summary.motion_description}; {lacking}")
            for note in remarks(result):
                say(f"  {note}")
        say_cost(total([*(result.history.usage for result in made.values()), *lost]))
        lasts = [result.history.rounds[-1] for result in made.values()]
        came, not_ = (sum(len(getattr(r, what)) for r in lasts) for what in ("met", "unmet"))
        joints = sum(bool(last.unmet) for last in lasts)
        say(f"{came} of {came + not_} behaviours come true; {joints} joints lack one.")
        if over := len(failed) - len(mistakes):
            say(f"{over} {'joint has' if over == 1 else 'joints have'} no range and no profile.")
        say(f"Contact sheet: {sheet}")
    stopped = sum(bool(result.stopped) for result in made.values())
    lacks = [(len(mistakes), "have no profile"), (stopped, "stopped early and go on with --resume")]
    if told := [f"{count} of {len(done)} {what}" for count, what in lacks if count]:
        raise JodaError(f"{', '.join(told)}; see above.")
