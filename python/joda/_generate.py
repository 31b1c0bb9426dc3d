"""The main job: from a joint to a profile that behaves like the object, in rounds."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from joda.errors import JodaError
from joda.history import History
from joda.propose import Proposer
from joda.session import Session

ROUNDS = 3


@dataclass(frozen=True)
class Generated:
    """What a generation left in its folder.

    Attributes:
        folder: with context.json, pictures/, proposal.json, composed.json, profile.png, scene.xml
            and history.json.
        history: the rounds, what each proposed, what came of it, what it cost.
        notes: what the user should be told, a sentence each.
    """

    folder: Path
    history: History
    notes: tuple[str, ...] = ()


def generate(
    model: str | Path,
    joint: str | None = None,
    output: str | Path | None = None,
    *,
    proposer: str | Proposer | None = None,
    rounds: int = ROUNDS,
    describe: str = "",
    templates: Sequence[str | Path] = (),
    key: str = "",
    vlm: str | None = None,
    resume: bool = False,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Generated:
    """Proposes a joint's effects, compiles and simulates them, and revises until they fit.

    Args:
        model: MJCF or URDF file.
        joint: a hinge or slide with a range, as `joda.model.find_joint` takes it.
        output: folder to fill; made if missing.
        proposer: "anthropic", "offline", the path of a proposal.json, or an object with a
            `propose` of its own. By default anthropic where ANTHROPIC_API_KEY is set, else offline.
        rounds: at most so many proposals.
        describe: what the joint should do, in words.
        templates: further folders of effect templates.
        key: another key draws other strengths within the labels' bands.
        vlm: name of the model that the anthropic proposer asks.
        resume: go on with what the folder holds, where its last round left it.
        force: overwrite what another generation left in the folder.
        progress: told what is being done.

    Returns:
        what was made.

    Raises:
        JodaError: a file cannot be read or written, the joint does not fit, or no proposal was to
            be had; what was made and spent until then is in the folder.
    """
    if rounds < 1:
        raise JodaError(f"rounds is {rounds}; give at least 1.")
    if joint is None or output is None:
        raise JodaError("give a joint and a folder, with --joint and -o.")
    chosen = choose(proposer, key, vlm)
    folder = Path(output)
    if resume and (folder / "history.json").is_file():
        session = Session.resume(folder, progress)
        _check_same(session, Path(model), joint)
    else:
        _check_free(folder, force)
        further = [Path(path) for path in templates]
        session = Session.start(folder, Path(model), joint, describe, further, key, progress)
    run(session, chosen, rounds)
    return Generated(folder, session.history, tuple(session.notes))


def run(session: Session, proposer: Proposer, rounds: int) -> None:
    """Asks the proposer until it has nothing to change, or `rounds` proposals are made.

    Raises:
        JodaError: no proposal was to be had; what it cost is kept.
    """
    while not session.history.complete and len(session.history.rounds) < rounds:
        session.progress(f"round {len(session.history.rounds) + 1}: asking {proposer.name}")
        try:
            answer = proposer.propose(session.task, session.turns)
        except JodaError as error:
            session.fail(error)
            raise
        session.take(answer, proposer.name)


def choose(proposer: str | Proposer | None, key: str = "", vlm: str | None = None) -> Proposer:
    """The proposer that is meant; see `generate`. Raises JodaError."""
    if proposer is not None and not isinstance(proposer, str):
        return proposer
    name = proposer or ("anthropic" if os.environ.get("ANTHROPIC_API_KEY") else "offline")
    if name == "offline":
        from joda.propose.offline import Offline

        return Offline(key)
    if name == "anthropic":
        from joda.propose.anthropic import Anthropic

        return Anthropic(vlm)
    if not Path(name).is_file():
        raise JodaError(f"{name}: no such proposer or file; give anthropic, offline or a file.")
    from joda.propose.file import FileProposer

    return FileProposer(Path(name))


def _check_free(folder: Path, force: bool) -> None:
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())) and not force:
        more = " or go on with --resume" if (folder / "history.json").is_file() else ""
        raise JodaError(
            f"{folder}: exists already; choose another folder with -o, add --force{more}."
        )


def _check_same(session: Session, model: Path, joint: str) -> None:
    if session.model.resolve() != model.resolve() or session.history.joint != joint:
        raise JodaError(
            f"{session.folder}: holds joint '{session.history.joint}' of {session.model}; resume "
            "with the same, or choose another folder with -o."
        )
