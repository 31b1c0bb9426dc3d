"""The main job: from a joint to a profile that behaves like the object, in rounds."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import mujoco

from joda.errors import JodaError
from joda.files import occupied
from joda.proposal import Proposal
from joda.propose import Proposer
from joda.propose.asking import Effort, ProposalFailed
from joda.propose.history import History
from joda.propose.session import PICTURES, Pictures, Progress, Session, relative, silent
from joda.scenes.model import find_joint, joint_name, joint_type, load_model
from joda.scenes.model_cache import loading_once
from joda.template import read_templates

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


def only_joint(path: Path) -> str:
    """The model's only hinge or slide with a range; raises JodaError if it has several or none."""
    names = ranged(load_model(path))
    if len(names) == 1:
        return names[0]
    listed = ", ".join(f"'{name}'" for name in names)
    raise JodaError(
        f"{path}: choose a joint with --joint: {listed}."
        if names
        else f'{path}: holds no hinge or slide with a range; add range="lo hi" to the joint.'
    )


def ranged(model: mujoco.MjModel) -> list[str]:
    """Names of the joints that can have a profile: hinges and slides that have a range."""
    return [name for name, has in _movable(model) if has]


def endless(model: mujoco.MjModel) -> list[str]:
    """Names of the hinges and slides that have no range, and so can have no profile."""
    return [name for name, has in _movable(model) if not has]


def _movable(model: mujoco.MjModel) -> list[tuple[str, bool]]:
    """Hinges and slides, and whether they have a range."""
    return [
        (joint_name(model, k), bool(model.jnt_range[k][0] < model.jnt_range[k][1]))
        for k in range(model.njnt)
        if joint_type(model, k) in ("hinge", "slide")
    ]


def _same(path: Path, one: str, other: str) -> bool:
    """Whether two addresses mean the same joint."""
    if one == other:
        return True
    model = load_model(path)
    return find_joint(model, one) == find_joint(model, other)
