"""What was proposed and what came of it, round by round: `history.json`."""

from pathlib import Path
from typing import Literal

from pydantic import field_validator

from joda.component import Frozen
from joda.interaction.behaviour import Behaviour
from joda.profile import File
from joda.proposal import Proposal
from joda.propose import Usage, total
from joda.propose.recognise import Recognition


class Round(Frozen):
    """A round.

    Attributes:
        number: from 1.
        proposer: who proposed.
        complaint: what the user had said before it; empty if nothing.
        proposal: what was proposed.
        behaviour: how the joint then behaved in simulation.
        facts: the same in a few lines.
        met: what was wished for and came, a sentence each.
        unmet: what was wished for and did not come, a sentence each.
        notes: what the proposer had to say besides.
        usage: what it cost.
        recognised: what the proposer took the joint for, and by what.
        picture: its forces, where the joint goes, and what came true, as SVG; empty in histories
            of before.
    """

    number: int
    proposer: str
    complaint: str = ""
    proposal: Proposal
    behaviour: Behaviour
    facts: str
    met: tuple[str, ...] = ()
    unmet: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    usage: Usage = Usage()
    recognised: Recognition | None = None
    picture: str = ""

    @property
    def sure(self) -> float:
        """How sure it is what the joint is, 0 to 1; not at all where no kind fits."""
        if self.recognised is None:
            return self.proposal.joint_summary.overall_confidence
        return 0.0 if self.recognised.unknown else self.recognised.likely


class Failure(Frozen):
    """A request that gave no proposal, and what it cost all the same."""

    reason: str
    usage: Usage = Usage()


class History(File):
    """The content of `history.json`.

    Attributes:
        model: path of the MJCF or URDF file, relative to the folder that the history is in.
        joint: its name or address in it.
        description: what the user wants of the joint, in words.
        kind: title of the archetype that the user says it is; empty where the rules may choose.
        reviewed: whether the user has looked at it and decided.
        templates: further folders of templates, relative as the model.
        key: with which proposals are compiled.
        pictures: names of the joint's pictures in `pictures/`; none where nothing could render.
        complete: whether the proposer had nothing to change any more.
        rounds: oldest first.
        failures: requests that gave nothing.
        composed: SHA-256 of the `composed.json` that the last round left.
        attached: what was told as its scene was written, a sentence each.
    """

    schema_version: Literal[1] = 1
    model: str
    joint: str
    description: str = ""
    kind: str = ""
    reviewed: bool = False
    templates: tuple[str, ...] = ()
    key: str = ""
    pictures: tuple[str, ...] | None = None
    complete: bool = False
    rounds: tuple[Round, ...] = ()
    failures: tuple[Failure, ...] = ()
    composed: str = ""
    attached: tuple[str, ...] = ()

    @field_validator("model", "templates")
    @classmethod
    def _check_paths(cls, value: str | tuple[str, ...]) -> str | tuple[str, ...]:
        if "\0" in "".join(value):
            raise ValueError("must be a path; there is a NUL in it")
        return value

    @field_validator("pictures")
    @classmethod
    def _check_names(cls, names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        if any(Path(name).name != name or "\0" in name for name in names or ()):
            raise ValueError("must be names of files in pictures/, not paths")
        return names

    @property
    def usage(self) -> Usage:
        """What all rounds and failures cost together."""
        spent = [item.usage for item in self.rounds] + [item.usage for item in self.failures]
        return total(spent)
