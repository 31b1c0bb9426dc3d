"""A folder in which one joint's profile is generated: everything in it follows from its history.

    context.json  pictures/  proposal.json  composed.json  profile.png  scene.xml  history.json

A round is in `history.json` before the files that follow from it are written: a session that was
interrupted goes on where it stopped, and what was paid for is not asked again.
"""

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from joda.compiling import compile
from joda.errors import JodaError
from joda.files import make_folder, read_text, write_bytes, write_text
from joda.interaction.behaviour import Behaviour, behaviour
from joda.interaction.surroundings import surroundings
from joda.pictures.draw import draw
from joda.pictures.offscreen import HEIGHT, WIDTH
from joda.pictures.positions import render
from joda.pictures.style import png
from joda.plain import plain
from joda.profile import Profile, describe
from joda.proposal import Proposal
from joda.propose import Answer, Proposer, Task, Turn, Usage, total
from joda.propose.archetype import Archetype, read_archetypes
from joda.propose.history import Failure, History, Round
from joda.propose.plausible import CLOSING, STAYING
from joda.propose.recognise import recognise
from joda.propose.requirements import Requirement, read_requirements, unmet
from joda.propose.sketch import sketch
from joda.scenes.attaching import attach
from joda.scenes.context import Context, context
from joda.template import read_templates


class Pictures(NamedTuple):
    """Of a joint: at how many positions from end to end, and how large, in pixels."""

    number: int
    size: tuple[int, int] = (WIDTH, HEIGHT)


PICTURES, NONE = Pictures(5), Pictures(0)
"""For a proposer that looks at them, and for nobody."""

SURE = 0.5
"""How sure it must be what a joint is, before somebody's proposal is questioned for its force."""

Progress = Callable[[str], None]


def silent(what: str) -> None:
    """Tells nobody what is being done."""


class Session:
    """One joint's generation.

    Attributes:
        folder: where everything is.
        history: what happened so far.
        context: the joint.
        task: what the proposer is given.
        turns: the rounds, as the proposer is shown them.
        notes: what the user should be told, a sentence each.
    """

    def __init__(
        self,
        folder: Path,
        history: History,
        progress: Progress = silent,
        pictures: Pictures = PICTURES,
    ) -> None:
        """Opens a session, and writes what its folder lacks.

        Args:
            folder: where everything is; made if missing.
            history: of a new session, without rounds, or of one to go on with.
            progress: told what is being done.
            pictures: which pictures of the joint, where there are none yet.

        Raises:
            JodaError: the model, the joint or the templates are not to be had; nothing is written.
        """
        self.folder, self.history, self.progress = folder, history, progress
        self.notes: list[str] = []
        self.model = self._path(history.model)
        self.context: Context = context(self.model, history.joint)
        self.notes += self.context.warnings
        self._around = surroundings(self.model, history.joint)
        if self._around:
            self.notes.append(
                f"In the scene {self._around.words}; behaviours are simulated in the scene as it "
                "is."
            )
        if self.context.actuators:
            driving = " and ".join(self.context.actuators)
            self.notes.append(
                f"On joint '{history.joint}' acts {driving}: behaviours are simulated without, as "
                "what the joint does by itself."
            )
        self._templates = [self._path(path) for path in history.templates]
        library, archetypes = read_templates(self._templates), self._archetypes()
        self.turns = [self._turn(round) for round in history.rounds]
        make_folder(folder)
        self._save()
        write_text(folder / "context.json", plain(self.context.model_dump_json(indent=2)) + "\n")
        self.task = Task(
            self.context,
            library,
            self._pictures(pictures),
            history.description,
            archetypes,
        )
        if self.turns and not self._finished():
            self._write(self.turns[-1])
        elif self.turns:
            self._tell(history.attached)

    @classmethod
    def start(
        cls,
        folder: Path,
        model: Path,
        joint: str,
        description: str = "",
        templates: Sequence[Path] = (),
        key: str = "",
        progress: Progress = silent,
        pictures: Pictures = PICTURES,
    ) -> "Session":
        """A new session in a folder that is made if missing; raises JodaError.

        Without `pictures` there are none of the joint, which rules do not look at.
        """
        try:
            history = History(
                model=relative(model, folder),
                joint=joint,
                description=description,
                templates=tuple(relative(path, folder) for path in templates),
                key=key,
                pictures=None if pictures.number else (),
            )
        except ValidationError as error:
            raise JodaError(describe(error)) from None
        return cls(folder, history, progress, pictures)

    @classmethod
    def resume(cls, folder: Path, progress: Progress = silent) -> "Session":
        """The session of a folder; raises JodaError if it has none."""
        path = folder / "history.json"
        if not path.is_file():
            raise JodaError(f"{folder}: holds no history.json; make it with: joda generate")
        history = History.read(path)
        model = (folder / history.model).resolve()
        if not model.is_file():
            raise JodaError(f"{path}: model: there is no {model}; put it back, or mend the path.")
        return cls(folder, history, progress)

    def again(self, description: str, kind: str) -> "Session":
        """Begins anew with what the user has said of the joint; raises JodaError, as it was then.

        Args:
            description: what it should do, in words.
            kind: title of the archetype that it is; empty where the rules may choose.
        """
        spent = Failure(reason="reviewed, and begun anew", usage=self.history.usage)
        history = self.history.model_copy(
            update={
                "description": description,
                "kind": kind,
                "reviewed": True,
                "complete": False,
                "rounds": (),
                "failures": (spent,) if spent.usage.requests else (),
            }
        )
        return type(self)(self.folder, history, self.progress)

    def pending(self, rounds: int) -> bool:
        """Whether there is more to ask, within so many rounds in all."""
        return not self.history.complete and len(self.history.rounds) < rounds

    def ask(self, proposer: Proposer, complaint: str = "") -> None:
        """Asks for the next proposal and makes a round of it; raises JodaError as `take`.

        Args:
            proposer: who is asked.
            complaint: what the user says of the last round.
        """
        self.progress(f"round {len(self.turns) + 1}: asking {proposer.name}")
        before = self.history
        answer: Answer | JodaError | None = None
        try:
            try:
                answer = proposer.propose(self.task, self._heard(complaint))
            except JodaError as error:
                answer = error
            self.take(answer, proposer.name, complaint)
        except KeyboardInterrupt as stopped:
            if self.history is before:  # nothing of it is kept yet
                self._fail(stopped, answer or stopped)
            raise

    def take(self, answer: Answer | JodaError, proposer: str, complaint: str = "") -> None:
        """Makes a round of an answer, and writes it; what an unusable one cost is kept.

        Args:
            answer: the proposer's, or the failure to get one.
            proposer: its name.
            complaint: the user's words that it answers.

        Raises:
            JodaError: there is no answer, it does not compile, or it cannot be written.
        """
        if isinstance(answer, JodaError):
            self._fail(answer, answer)
            raise answer
        if answer.proposal is None and self.turns and not complaint:
            self._complete(answer)
            return
        try:
            round, turn = self._round(answer, proposer, complaint)
        except JodaError as error:
            self._fail(error, answer)
            raise
        if not self.history.rounds:  # what an earlier generation left is no edit of this one's
            (self.folder / "composed.json").unlink(missing_ok=True)
        rounds = (*self.history.rounds, round)
        self.turns = [*self._heard(complaint), turn]
        self._save(rounds=rounds, complete=False, composed=_digest(turn.profile.to_json()))
        self._write(turn)

    def review(self) -> None:
        """Keeps that the user has looked at it, and leaves it as it is."""
        self._save(reviewed=True)

    def check_unedited(self) -> None:
        """Raises JodaError if `composed.json` is none that any round left."""
        if self._edited():
            raise JodaError(
                f"{self.folder / 'composed.json'}: was edited since it was generated, and another "
                "round would lose that; go on editing it, or add --force."
            )

    def _heard(self, complaint: str) -> list[Turn]:
        """The turns, the last of them with the complaint if there is one."""
        if not complaint or not self.turns:
            return self.turns
        return [*self.turns[:-1], replace(self.turns[-1], complaint=complaint)]

    def _round(self, answer: Answer, proposer: str, complaint: str) -> tuple[Round, Turn]:
        """What comes of an answer; raises JodaError if nothing does."""
        proposal = answer.proposal
        if proposal is None:
            requirement = f" for '{complaint}'" if complaint else ""
            raise JodaError(
                f"{proposer} has nothing to propose{requirement}; choose another proposer."
            )
        self.progress("simulating the proposal")
        profile = self._compiled(proposal)
        behaved = behaviour(self.context, profile, self._around)
        wanted = read_requirements(proposal.whole_motion_descrptn)
        # what was asked for at first may be what the user has complained about since
        heard = complaint or any(round.complaint for round in self.history.rounds)
        said = "" if heard else self.history.description
        every = [
            *wanted,
            *(requirement for requirement in read_requirements(said) if requirement not in wanted),
        ]
        lacking = unmet(every, behaved, self.context)
        came = (
            requirement.sentence
            for requirement in (Requirement("moves"), *every)
            if requirement.name not in lacking
        )
        met = tuple(f"It {sentence}." for sentence in came)
        round = Round(
            number=len(self.history.rounds) + 1,
            proposer=proposer,
            complaint=complaint,
            proposal=proposal,
            behaviour=behaved,
            facts=behaved.describe(self.context),
            met=met,
            unmet=tuple(lacking.values()),
            notes=(
                *answer.notes,
                *self._implausible(behaved, answer),
                *self._hindered(profile, every, lacking),
            ),
            usage=answer.usage,
            recognised=answer.recognised,
            picture=sketch(profile, self.context, behaved, met, tuple(lacking.values())),
        )
        return round, self._turn(round, profile)

    def _implausible(self, behaved: Behaviour, answer: Answer) -> tuple[str, ...]:
        """What it does otherwise than such joints, in numbers; rules wish for that themselves."""
        if answer.recognised is not None:
            return ()
        found = recognise(self.context, self.history.description, self.task.archetypes)[1]
        if found.force is None or found.likely < SURE:
            return ()
        asked = read_requirements(self.history.description)  # the user knows better where it holds
        told = found.force.wanted(CLOSING if asked else CLOSING | STAYING, self.context)
        warnings = [
            f"which {requirement.sentence} ({found.force.by(requirement.name)}), but {instead}"
            for requirement in told
            if (instead := requirement.instead(behaved, self.context))
        ]
        looks = f"It looks like a {found.title} ({found.likely:.0%}), {'; and '.join(warnings)}."
        return (looks,) if warnings else ()

    def _hindered(
        self, profile: Profile, every: Sequence[Requirement], lacking: Mapping[str, str]
    ) -> tuple[str, ...]:
        """What of the lacking the joint would do by itself: the scene is in the way of that."""
        if not self._around or not lacking:
            return ()
        alone = unmet(every, behaviour(self.context, profile), self.context)
        requirements = [requirement.sentence for requirement in (Requirement("moves"), *every)
                  if requirement.name in lacking.keys() - alone.keys()]  # fmt: skip
        return (
            (
                f"By itself it {', '.join(requirements)}; what forbids that is the scene: "
                f"{self._around.words}{self._around.remedy}.",
            )
            if requirements
            else ()
        )

    def _archetypes(self) -> tuple[Archetype, ...]:
        """Those to choose from, the one that the user chose first of all."""
        known, kind = read_archetypes(self._templates), self.history.kind
        chosen = tuple(one for one in known if one.title == kind)
        if kind and not chosen:
            listed = ", ".join(sorted(one.title for one in known))
            raise JodaError(f"there is no kind of joint '{kind}'; there are: {listed}.")
        if chosen and self.context.joint.type not in chosen[0].joint:
            raise JodaError(f"a {kind} is a {chosen[0].joint}, the joint is none; choose another.")
        return chosen or known

    def _compiled(self, proposal: Proposal) -> Profile:
        return compile(proposal, self.context, templates=self._templates, key=self.history.key)

    def _turn(self, round: Round, profile: Profile | None = None) -> Turn:
        """A round as the proposer is shown it."""
        profile = profile or self._compiled(round.proposal)
        positions, balance = np.array(self.context.positions), -np.array(self.context.gravity_force)
        later = (r.complaint for r in self.history.rounds if r.number == round.number + 1)
        return Turn(
            proposal=round.proposal,
            profile=profile,
            behaviour=round.behaviour,
            picture=cache(lambda: png(draw(profile, (positions, balance)))),
            facts=round.facts,
            unmet=round.unmet,
            complaint=next(later, ""),
        )

    def _complete(self, answer: Answer) -> None:
        """The last round stays; it bears the cost of the answer that says so."""
        *rounds, last = self.history.rounds
        spent = total((last.usage, answer.usage)) if answer.usage.requests else last.usage
        last = last.model_copy(update={"usage": spent, "notes": (*last.notes, *answer.notes)})
        self._save(rounds=(*rounds, last), complete=True)

    def _fail(self, error: BaseException, paid: object) -> None:
        """Keeps what was paid for nothing: the `usage` of an answer or of an exception."""
        usage = getattr(paid, "usage", Usage())
        if usage.requests:
            failure = Failure(reason=str(error) or "interrupted", usage=usage)
            self._save(failures=(*self.history.failures, failure))

    def _save(self, **changes: Any) -> None:
        history = self.history.model_copy(update=changes)
        write_text(self.folder / "history.json", history.to_json())
        self.history = history

    def _edited(self) -> bool:
        path = self.folder / "composed.json"
        ours = {self.history.composed, *(_digest(turn.profile.to_json()) for turn in self.turns)}
        return bool(self.turns) and path.is_file() and _digest(read_text(path)) not in ours

    def _finished(self) -> bool:
        """Whether the files that follow from the last round are there; an edit is left alone."""
        if self._edited():
            return True
        names = ("proposal.json", "composed.json", "profile.png", "scene.xml")
        if not all((self.folder / name).is_file() for name in names):
            return False
        found = _digest(read_text(self.folder / "composed.json"))
        return found in (self.history.composed, _digest(self.turns[-1].profile.to_json()))

    def _write(self, turn: Turn) -> None:
        write_text(self.folder / "proposal.json", turn.proposal.to_json())
        write_bytes(self.folder / "profile.png", turn.picture())
        joint = self.history.joint
        said = attach(self.model, turn.profile, self.folder / "scene.xml", joint=joint, force=True)
        self._save(attached=tuple(said))
        self._tell(said)
        write_text(self.folder / "composed.json", turn.profile.to_json())  # last, see _finished

    def _tell(self, sentences: Sequence[str]) -> None:
        self.notes += [sentence for sentence in sentences if sentence not in self.notes]

    def _pictures(self, wanted: Pictures) -> list[bytes]:
        """The joint at several positions, those of before or made now; none where none can be."""
        names = self.history.pictures
        paths = [self.folder / "pictures" / name for name in names or ()]
        if names is None or not all(path.is_file() for path in paths):
            self.progress("picturing the joint")
            folder = self.folder / "pictures"
            try:
                paths = render(
                    *(self.model, self.history.joint, folder),
                    count=wanted.number,
                    size=wanted.size,
                    force=True,
                )
            except JodaError as error:
                paths = []
                self.notes.append(f"No pictures, the proposer goes by the text: {error}")
            self._save(pictures=tuple(path.name for path in paths))
        return [path.read_bytes() for path in paths]

    def _path(self, relative: str) -> Path:
        """A path of the history, as short as it can be said here."""
        absolute = os.path.normpath(self.folder.resolve() / relative)
        return Path(min(absolute, os.path.relpath(absolute), key=len))


def relative(path: Path, folder: Path) -> str:
    """A path as the history of a folder keeps it."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
