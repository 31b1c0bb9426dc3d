"""Rounds of proposals for one joint: who is asked, where it goes on, and what it left."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from joda.errors import JodaError
from joda.proposal import Proposal
from joda.propose import Proposer
from joda.propose.asking import Effort
from joda.propose.history import History
from joda.propose.session import PICTURES, Pictures, Progress, Session, relative, silent
from joda.scenes.model import find_joint, load_model

ROUNDS = 3


@dataclass(frozen=True)
class Generated:
    """What a generation left in its folder.

    Attributes:
        folder: with context.json, pictures/, proposal.json, composed.json, profile.png, scene.xml
            and history.json.
        history: the rounds, what each proposed, what came of it, what it cost.
        notes: what the user should be told, a sentence each.
        stopped: why a further round came to nothing; empty where it did not.
    """

    folder: Path
    history: History
    notes: tuple[str, ...] = ()
    stopped: str = ""


def run(session: Session, proposer: Proposer, rounds: int, force: bool = False) -> None:
    """Asks the proposer until it has nothing to change, or `rounds` proposals are made.

    Raises:
        JodaError: no proposal was to be had; what it cost is kept. Or composed.json was edited and
            `force` is off.
    """
    if session.pending(rounds) and not force:
        session.check_unedited()
    while session.pending(rounds):
        session.ask(proposer)


def begin(
    folder: Path,
    model: Path,
    joint: str,
    describe: str,
    templates: Sequence[Path],
    key: str,
    resume: bool,
    progress: Progress = silent,
    pictures: Pictures = PICTURES,
) -> Session:
    """The session that a folder holds, if it is to be resumed, or a new one; raises JodaError."""
    if not resume or not (folder / "history.json").is_file():
        return Session.start(folder, model, joint, describe, templates, key, progress, pictures)
    history = History.read(folder / "history.json")
    if history.model != relative(model, folder) or not _same(model, joint, history.joint):
        raise JodaError(
            f"{folder}: holds joint '{history.joint}' of {(folder / history.model).resolve()}; "
            "resume with the same, or choose another folder with -o."
        )
    given = {
        "describe": (describe, history.description),
        "templates": (tuple(relative(path, folder) for path in templates), history.templates),
        "key": (key, history.key),
    }
    for option, (now, then) in given.items():
        if now and now != then and not (option == "describe" and history.reviewed):
            raise JodaError(
                f"{folder}: was begun with another --{option}; leave it out to go on with that, or "
                "choose another folder with -o."
            )
    return Session.resume(folder, progress)


def choose(
    proposer: str | Path | Proposer | None,
    key: str = "",
    vlm: str | None = None,
    base_url: str | None = None,
    effort: Effort | None = None,
) -> Proposer:
    """The proposer that is meant; see `generate`. Raises JodaError."""
    if proposer is not None and not isinstance(proposer, str | Path):
        return proposer
    name = str(proposer or ("anthropic" if os.environ.get("ANTHROPIC_API_KEY") else "offline"))
    if effort not in (None, *get_args(Effort)):
        raise JodaError(f"effort is '{effort}'; give one of {', '.join(get_args(Effort))}.")
    if name == "anthropic":
        from joda.propose.anthropic import Anthropic

        return Anthropic(vlm, base_url, effort=effort)
    if name == "openai":
        from joda.propose.openai import OpenAI

        return OpenAI(vlm, base_url, effort=effort)
    if vlm or base_url or effort:
        raise JodaError(
            f"--vlm, --base-url and --effort are of the proposers anthropic and openai, not of "
            f"'{name}'; add --proposer."
        )
    if name == "offline":
        from joda.propose.offline import Offline

        return Offline(key)
    if not Path(name).is_file():
        raise JodaError(
            f"{name}: no such proposer or file; give anthropic, openai, offline or a file."
        )
    from joda.propose.file import FileProposer

    Proposal.read(name)
    return FileProposer(Path(name))


def check_rounds(rounds: int) -> None:
    """Raises JodaError if there are none."""
    if rounds < 1:
        raise JodaError(f"rounds is {rounds}; give at least 1.")


def _same(path: Path, one: str, other: str) -> bool:
    """Whether two addresses mean the same joint."""
    if one == other:
        return True
    model = load_model(path)
    return find_joint(model, one) == find_joint(model, other)
