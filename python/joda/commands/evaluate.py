"""How good a proposer is: models whose joints' behaviours were written down before, and a table."""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import typer

from joda.component import Frozen
from joda.errors import JodaError
from joda.files import file_name, fresh, make_folder, occupied, write_text
from joda.plain import line
from joda.profile import File
from joda.propose import Proposer, Usage, total
from joda.propose.asking import Effort, ProposalFailed
from joda.propose.expected import ENDING, Expectations, Expected, model_of
from joda.propose.generation import ROUNDS, begin, check_rounds, choose, run
from joda.propose.joints import MODELS
from joda.propose.offline import Offline
from joda.propose.session import NONE, PICTURES, Session
from joda.scenes.model import describe_joint, find_joint, load_model
from joda.terminal import options
from joda.terminal.progress import progress_bar
from joda.terminal.rounds import saying_cost
from joda.terminal.say import print_json, say

RESULT = "evaluation.json"
PATIENCE = 3
"""Joints in a row for which no answer was to be had, before the rest is not asked either."""


class Judged(Frozen):
    """What came of a joint.

    Attributes:
        label: model and joint.
        expected: what it should do.
        behaviours: each to what it does instead, a sentence; empty where it does it.
        rounds: proposals that were made.
        usage: what they cost.
        seconds: that they took, pictures and simulation included.
        failed: why there is no proposal; empty if there is one.
    """

    label: str
    expected: Expected
    behaviours: dict[str, str]
    rounds: int = 0
    usage: Usage = Usage()
    seconds: float = 0.0
    failed: str = ""

    @property
    def met(self) -> int:
        """How many behaviours it has."""
        return sum(not instead for instead in self.behaviours.values())


class Evaluation(File):
    """The content of `evaluation.json`.

    Attributes:
        proposer: service and model, or "offline".
        rounds: at most so many proposals per joint.
        effort: what the model was asked to put in.
        joints: those that are done, in the order in which they were.
    """

    schema_version: Literal[1] = 1
    proposer: str
    rounds: int
    effort: Effort | None = None
    joints: tuple[Judged, ...] = ()

    @property
    def met(self) -> int:
        """How many behaviours came true."""
        return sum(one.met for one in self.joints)

    @property
    def of(self) -> int:
        """Of how many."""
        return sum(len(one.behaviours) for one in self.joints)

    @property
    def usage(self) -> Usage:
        """What all cost together."""
        return total(one.usage for one in self.joints)

    @property
    def seconds(self) -> float:
        """What all took together."""
        return sum(one.seconds for one in self.joints)


class Case(NamedTuple):
    """A joint to be judged, and the folder for it."""

    label: str
    model: Path
    joint: str
    expected: Expected
    folder: Path


def evaluate(
    what: Literal["proposer"],
    models: str | Path,
    output: str | Path | None = None,
    *,
    proposer: str | Path | Proposer | None = None,
    rounds: int = ROUNDS,
    templates: Sequence[str | Path] = (),
    key: str = "",
    vlm: str | None = None,
    base_url: str | None = None,
    effort: Effort | None = None,
    resume: bool = False,
    force: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Evaluation:
    """Lets a proposer do joints whose behaviours are known, and counts those that come true.

    Each joint is done as `joda.generate` does it, and judged by its last round's simulation. The
    proposer is not told what is expected. Interrupted, the same call with `resume` goes on, and
    pays for nothing twice.

    Args:
        what: "proposer".
        models: folder with models and, beside each, MODEL.expected.json
            (`joda.propose.expected.Expectations`); models without are passed over.
        output: folder to fill: what `joda.generate` leaves of each joint, and evaluation.json. By
            default joda_evaluation, or the first of joda_evaluation_2, ... that does not exist.
        proposer, rounds, templates, key, vlm, base_url, effort: as for `joda.generate`.
        resume: go on with what the folder holds; joints that failed are asked for again.
        force: overwrite what another evaluation left in the folder.
        progress: told how many joints are done, of how many, and which is next.

    Returns:
        a row per joint.

    Raises:
        JodaError: expectations are missing or wrong, the folder holds files already, or no answer
            is to be had from the proposer; what was done until then is kept.
    """
    if what != "proposer":
        raise JodaError(f"'{what}' cannot be evaluated; proposer can.")
    check_rounds(rounds)
    folder = _folder(output, resume, force)
    chosen = choose(proposer, key, vlm, base_url, effort)
    cases = list(_cases(Path(models), folder))
    before = _before(folder, chosen.name, rounds, effort) if resume else None
    result = before or Evaluation(proposer=chosen.name, rounds=rounds, effort=effort)
    make_folder(folder)
    further = [Path(path) for path in templates]
    lost = 0
    for number, case in enumerate(cases):
        progress(number, len(cases), case.label)
        kept = next((one for one in result.joints if one.label == case.label), None)
        if kept and not kept.failed and kept.expected == case.expected:
            continue
        judged, unanswered = _judge(case, chosen, rounds, further, key, bool(before))
        others = tuple(one for one in result.joints if one.label != case.label)
        result = result.model_copy(update={"joints": (*others, judged)})
        write_text(folder / RESULT, result.to_json())
        lost = lost + 1 if unanswered else 0
        if lost == PATIENCE:
            raise ProposalFailed(
                f"{lost} joints in a row got no proposal, the rest is not asked; go on with "
                f"--resume -o {folder}. The last: {judged.failed}",
                result.usage,
            )
    progress(len(cases), len(cases), "done")
    return result


def _judge(
    case: Case,
    proposer: Proposer,
    rounds: int,
    templates: Sequence[Path],
    key: str,
    resume: bool,
) -> tuple[Judged, bool]:
    """What comes of a joint, and whether the proposer could not be asked."""
    start, failed, unanswered = time.monotonic(), "", False
    session: Session | None = None
    said = case.expected.description
    try:
        if resume and (case.folder / "history.json").is_file():
            session = begin(case.folder, case.model, case.joint, said, templates, key, True)
        else:
            session = Session.start(
                case.folder,
                case.model,
                case.joint,
                said,
                templates,
                key,
                pictures=NONE if isinstance(proposer, Offline) else PICTURES,
            )
        run(session, proposer, rounds, force=True)
    except JodaError as error:
        failed, unanswered = str(error), isinstance(error, ProposalFailed)
    made = session is not None and bool(session.turns)
    return (
        Judged(
            label=case.label,
            expected=case.expected,
            behaviours=case.expected.judge(session.turns[-1].behaviour, session.context)
            if session is not None and made
            else dict.fromkeys(case.expected.sentences, "there is no proposal."),
            rounds=len(session.turns) if session else 0,
            usage=session.history.usage if session else Usage(),
            seconds=round(time.monotonic() - start, 3),
            failed=failed,
        ),
        unanswered,
    )


def _folder(output: str | Path | None, resume: bool, force: bool) -> Path:
    if output is None:
        if resume:
            raise JodaError("which evaluation is to go on? Give its folder with -o.")
        return fresh("joda_evaluation")
    folder = Path(output)
    if occupied(folder) and not (force or resume):
        raise JodaError(
            f"{folder}: exists already; choose another folder with -o, add --force or go on with "
            "--resume."
        )
    return folder


def _before(folder: Path, proposer: str, rounds: int, effort: Effort | None) -> Evaluation | None:
    """What the folder holds of the same proposer, asked in the same way; raises JodaError."""
    path = folder / RESULT
    if not path.is_file():
        return None
    found = Evaluation.read(path)
    if (found.proposer, found.rounds, found.effort) != (proposer, rounds, effort):
        how = f"--effort {found.effort}" if found.effort else "no --effort"
        raise JodaError(
            f"{path}: is of {found.proposer} with --rounds {found.rounds} and {how}; go on with "
            "the same, or choose another folder with -o."
        )
    return found


def _cases(source: Path, target: Path) -> Iterator[Case]:
    """The joints of whose behaviours something is written; raises JodaError."""
    if not source.is_dir():
        raise JodaError(f"{source}: no such folder.")
    made = target.resolve()
    paths = [path for path in source.rglob(f"*{ENDING}") if made not in path.resolve().parents]
    if not paths:
        raise JodaError(
            f"{source}: holds no MODEL{ENDING} beside a MODEL.xml; joda schema expected prints its "
            "format."
        )
    taken: set[Path] = set()
    for path in sorted(paths):
        model = model_of(path, MODELS)
        if model is None:
            raise JodaError(f"{path}: there is no model of that name beside it (XML or URDF).")
        compiled = load_model(model)
        stem = path.relative_to(source).as_posix().removesuffix(ENDING)
        for name, expected in Expectations.read(path).joints.items():
            try:
                describe_joint(compiled, find_joint(compiled, name))
            except JodaError as error:
                raise JodaError(f"{path}: joints: {error}") from None
            folder = target / stem / file_name(name)
            while folder in taken:
                folder = folder.with_name(f"{folder.name}_")
            taken.add(folder)
            yield Case(f"{stem}/{name}", model, name, expected, folder)


def command(
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
    proposer: options.Proposer = None,
    rounds: options.Rounds = 3,
    templates: options.Templates = None,
    key: options.Key = "",
    vlm: options.Vlm = None,
    base_url: options.BaseUrl = None,
    effort: options.Efforts = None,
    resume: options.Resume = False,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Count what a proposer gets right, and its cost.

    Example:

        joda evaluate proposer out --proposer offline -o evaluated
    """
    with saying_cost(output, as_json), progress_bar() as bar:
        result = evaluate(
            what, models, output, proposer=proposer, rounds=rounds, templates=templates or (),
            key=key, vlm=vlm, base_url=base_url, effort=effort, resume=resume, force=force,
            progress=bar,
        )  # fmt: skip
    if as_json:
        print_json(_as_json(result))
    else:
        _say(result)
    failed = sum(bool(one.failed) for one in result.joints)
    if failed:
        raise JodaError(f"{failed} of {len(result.joints)} joints have no whole answer; see above.")


def _as_json(result: Evaluation) -> dict[str, Any]:
    """What `joda evaluate --json` prints."""
    told: dict[str, Any] = result.model_dump(mode="json")
    for row, one in zip(told["joints"], result.joints, strict=True):
        row |= {"met": one.met, "of": len(one.behaviours)}
    usage = result.usage.model_dump(mode="json")
    return {
        **told, "met": result.met, "of": result.of, "usage": usage,
        "seconds": round(result.seconds, 3),
    }  # fmt: skip


def _say(result: Evaluation) -> None:
    """The table of `joda evaluate`; below it what was not met."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    heads = "joint", "met", "rounds", "tokens in", "out", "dollars", "seconds"
    table = Table(box=None, pad_edge=False)
    for k, head in enumerate(heads):
        table.add_column(head, justify="right" if k else "left")
    rows = [
        (one.label, one.met, len(one.behaviours), one.rounds, one.usage, one.seconds)
        for one in result.joints
    ]
    rounds = sum(one.rounds for one in result.joints)
    whole = f"{result.proposer}, {len(rows)} joints"
    rows.append((whole, result.met, result.of, rounds, result.usage, result.seconds))
    for label, met, of, count, usage, seconds in rows:
        dollars = "?" if usage.dollars is None else f"{usage.dollars:.3f}"
        tokens = map(str, (usage.input_tokens, usage.output_tokens))
        paid = (*tokens, dollars) if usage.requests else ("-", "-", "-")
        counts = f"{met} of {of}", str(count), *paid, f"{seconds:.1f}"
        table.add_row(Text(line(label)), *counts)
    Console(width=None if sys.stdout.isatty() else 120).print(table)
    for one in result.joints:
        lacking = [one.failed] if one.failed else [t for t in one.behaviours.values() if t]
        for sentence in lacking:
            say(f"{one.label}: {sentence}")
