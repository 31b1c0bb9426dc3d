"""A folder in which one joint's profile is generated: everything in it follows from its history.

    context.json  pictures/  proposal.json  composed.json  profile.png  scene.xml  history.json

Each round is written when it is finished, `history.json` last, so a session that was interrupted
goes on where it stopped.
"""

import hashlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from joda._attach import attach
from joda._compile import compile
from joda._context import Context, context
from joda._render import render
from joda.behaviour import behaviour
from joda.draw import draw, png
from joda.errors import JodaError
from joda.files import make_folder, read_text, write_bytes, write_text
from joda.history import Failure, History, Round
from joda.profile import Profile
from joda.proposal import Proposal
from joda.propose import Answer, Task, Turn, Usage, total
from joda.template import read_templates
from joda.wishes import read_wishes, unmet

PICTURES = 5


class Session:
    """One joint's generation.

    Attributes:
        folder: where everything is.
        history: what happened so far.
        context: the joint.
        task: what the proposer is given.
        notes: what the user should be told, a sentence each.
    """

    def __init__(
        self, folder: Path, history: History, progress: Callable[[str], None] = lambda what: None
    ) -> None:
        """Opens a session; the folder must exist.

        Args:
            folder: where everything is.
            history: of a new session, without rounds, or of one to go on with.
            progress: told what is being done.

        Raises:
            JodaError: the model, the joint or the templates are not to be had.
        """
        self.folder, self.history, self.progress = folder, history, progress
        self.notes: list[str] = []
        self.model = folder / history.model
        self.context: Context = context(self.model, history.joint)
        write_text(folder / "context.json", self.context.model_dump_json(indent=2) + "\n")
        templates = read_templates([folder / path for path in history.templates])
        self.task = Task(self.context, templates, self._pictures(), history.description)
        self.turns = [self._turn(round) for round in history.rounds]
        self._save()

    @classmethod
    def start(
        cls,
        folder: Path,
        model: Path,
        joint: str,
        description: str = "",
        templates: Sequence[Path] = (),
        key: str = "",
        progress: Callable[[str], None] = lambda what: None,
    ) -> "Session":
        """A new session in a folder that is made if missing; raises JodaError."""
        make_folder(folder)
        history = History(
            model=_relative(model, folder),
            joint=joint,
            description=description,
            templates=tuple(_relative(path, folder) for path in templates),
            key=key,
        )
        return cls(folder, history, progress)

    @classmethod
    def resume(cls, folder: Path, progress: Callable[[str], None] = lambda what: None) -> "Session":
        """The session of a folder; raises JodaError if it has none."""
        path = folder / "history.json"
        if not path.is_file():
            raise JodaError(f"{folder}: holds no history.json; make it with: joda generate")
        return cls(folder, History.read(path), progress)

    def take(self, answer: Answer, proposer: str, complaint: str = "") -> None:
        """Makes a round of an answer, and writes it; raises JodaError if it does not compile.

        Args:
            answer: the proposer's.
            proposer: its name.
            complaint: the user's words that it answers.
        """
        if answer.proposal is None:
            self._note(complete=True, usage=answer.usage)
            return
        self.progress("simulating the proposal")
        proposal = answer.proposal
        profile = self._compiled(proposal)
        behaved = behaviour(self.context, profile)
        wanted = read_wishes(proposal.whole_motion_descrptn)
        asked = [w for w in read_wishes(self.history.description) if w not in wanted]
        lacking = unmet([*wanted, *asked], behaved, self.context)
        round = Round(
            number=len(self.history.rounds) + 1,
            proposer=proposer,
            complaint=complaint,
            proposal=proposal,
            behaviour=behaved,
            facts=behaved.describe(self.context),
            unmet=tuple(lacking.values()),
            notes=tuple(answer.notes),
            usage=answer.usage,
        )
        turn = self._turn(round)
        self._write(turn)
        self.turns.append(turn)
        self.history = self.history.model_copy(
            update={
                "rounds": (*self.history.rounds, round),
                "complete": False,
                "composed": _digest(turn.profile.to_json()),
            }
        )
        self._save()

    def fail(self, error: JodaError) -> None:
        """Keeps what a failed request cost."""
        usage = getattr(error, "usage", Usage())
        failures = (*self.history.failures, Failure(reason=str(error), usage=usage))
        self.history = self.history.model_copy(update={"failures": failures})
        self._save()

    def complain(self, complaint: str) -> list[Turn]:
        """The turns, the last of them with a complaint."""
        last = self.turns[-1]
        changed = Turn(**{**vars(last), "complaint": complaint})
        return [*self.turns[:-1], changed]

    def edited(self) -> bool:
        """Whether `composed.json` is another than the last round left."""
        path = self.folder / "composed.json"
        return not path.is_file() or _digest(read_text(path)) != self.history.composed

    def _compiled(self, proposal: Proposal) -> Profile:
        templates = [self.folder / path for path in self.history.templates]
        return compile(proposal, self.context, templates=templates, key=self.history.key)

    def _turn(self, round: Round) -> Turn:
        profile = self._compiled(round.proposal)
        balance = -np.array(self.context.gravity_force)
        return Turn(
            proposal=round.proposal,
            profile=profile,
            behaviour=round.behaviour,
            picture=png(draw(profile, (np.array(self.context.positions), balance))),
            facts=round.facts,
            unmet=round.unmet,
            complaint=self._complaint(round.number + 1),
        )

    def _complaint(self, number: int) -> str:
        """What was said before this round."""
        return next((r.complaint for r in self.history.rounds if r.number == number), "")

    def _write(self, turn: Turn) -> None:
        write_text(self.folder / "proposal.json", turn.proposal.to_json())
        write_text(self.folder / "composed.json", turn.profile.to_json())
        write_bytes(self.folder / "profile.png", turn.picture)
        joint = self.history.joint
        said = attach(self.model, turn.profile, self.folder / "scene.xml", joint=joint, force=True)
        self.notes += [note for note in said if note not in self.notes]

    def _note(self, complete: bool, usage: Usage) -> None:
        rounds = self.history.rounds
        if rounds:
            last = rounds[-1]
            spent = total((last.usage, usage))
            rounds = (*rounds[:-1], last.model_copy(update={"usage": spent}))
        self.history = self.history.model_copy(update={"complete": complete, "rounds": rounds})
        self._save()

    def _save(self) -> None:
        write_text(self.folder / "history.json", self.history.to_json())

    def _pictures(self) -> list[bytes]:
        """The joint at several positions, from the folder or made now; none where none can be."""
        folder = self.folder / "pictures"
        begun = bool(self.history.rounds or self.history.failures)
        paths = sorted(folder.glob("*.png")) if begun else []
        if len(paths) != PICTURES:
            self.progress("picturing the joint")
            try:
                paths = render(self.model, self.history.joint, folder, count=PICTURES, force=True)
            except JodaError as error:
                self.notes.append(f"No pictures, the proposer goes by the text: {error}")
                return []
        return [path.read_bytes() for path in paths]


def _relative(path: Path, folder: Path) -> str:
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
