"""Language-guided revision: what the user complains about changes, the rest stays."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from joda.component import LONGEST_TEXT
from joda.errors import JodaError
from joda.pictures.changes import changes, overlay
from joda.pictures.style import write_png
from joda.propose import Proposer
from joda.propose.asking import Effort
from joda.propose.generation import choose
from joda.propose.history import History
from joda.propose.session import Progress, Session, silent
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.rounds import say_cost, say_round
from joda.terminal.say import print_json, say, say_changes


@dataclass(frozen=True)
class Revised:
    """What a revision did.

    Attributes:
        folder: what `joda.generate` left, revised.
        changes: a line per changed component.
        picture: the profile before and after, PNG.
        history: the rounds, this one included.
        notes: what the user should be told, a sentence each.
    """

    folder: Path
    changes: tuple[str, ...]
    picture: Path
    history: History
    notes: tuple[str, ...] = ()


def revise(
    folder: str | Path,
    feedback: str,
    *,
    proposer: str | Path | Proposer | None = None,
    vlm: str | None = None,
    base_url: str | None = None,
    effort: Effort | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> Revised:
    """Revises a generated profile as the user asks, and writes the folder's files anew.

    Args:
        folder: what `joda.generate` left.
        feedback: what is wrong or wanted, in words.
        proposer, vlm, base_url, effort: as for `joda.generate`.
        force: go on although composed.json was edited by hand since; the edit is lost.
        progress: told what is being done.

    Returns:
        what changed; `before_after.png` in the folder shows it.

    Raises:
        JodaError: the folder holds no generation, the feedback is not understood, or no revised
            proposal was to be had.
    """
    path = Path(folder)
    if not feedback.strip():
        raise JodaError("feedback is empty; say what is wrong, in words.")
    if len(feedback) > LONGEST_TEXT:
        said = f"feedback has {len(feedback)} characters"
        raise JodaError(f"{said}; say it in at most {LONGEST_TEXT}.")
    session = Session.resume(path, progress)
    if not session.turns:
        raise JodaError(f"{path}: holds no proposal yet; go on with: joda generate --resume")
    if not force:
        session.check_unedited()
    chosen = choose(proposer, session.history.key, vlm, base_url, effort)
    before = session.turns[-1].profile
    session.ask(chosen, feedback.strip())
    after = session.turns[-1].profile
    balance = -np.array(session.context.gravity_force)
    picture = path / "before_after.png"
    figure = overlay(before, after, (np.array(session.context.positions), balance))
    write_png(figure, picture, force=True)
    return Revised(
        folder=path,
        changes=tuple(changes(before, after)),
        picture=picture,
        history=session.history,
        notes=tuple(session.notes),
    )


def command(
    folder: Annotated[Path, typer.Argument(help="What joda generate left.", show_default=False)],
    feedback: Annotated[
        str, typer.Option(help="What is wrong or wanted, in words.", show_default=False)
    ],
    proposer: Annotated[
        str | None, typer.Option(help="anthropic, openai or offline [default: as for generate].")
    ] = None,
    vlm: options.Vlm = None,
    base_url: options.BaseUrl = None,
    effort: options.Efforts = None,
    force: Annotated[
        bool, typer.Option("--force", help="Although composed.json was edited by hand since.")
    ] = False,
    as_json: options.Json = False,
) -> None:
    """Change a generated profile in words; the rest stays.

    Example:

        joda revise oven --feedback "the final closing pull is too strong"
    """
    with spinner("revise") as progress:
        result = revise(
            folder, feedback, proposer=proposer, vlm=vlm, base_url=base_url, effort=effort,
            force=force, progress=progress,
        )  # fmt: skip
    if as_json:
        last = result.history.rounds[-1].model_dump(mode="json")
        print_json({"changes": result.changes, "picture": str(result.picture), "round": last})
        return
    say_changes(result.changes)
    say_round(result.history.rounds[-1])
    say_cost(result.history.usage)
    for note in result.notes:
        say(note)
    say(result.picture)
