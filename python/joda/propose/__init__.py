"""Who proposes a joint's effects: one interface, and behind it a model, rules, or a file.

A proposer is asked once per round. It is given the task and what came of its earlier proposals, and
answers with a proposal, or with None: the last one is complete.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable

from joda.component import Frozen
from joda.errors import JodaError
from joda.interaction.behaviour import Behaviour
from joda.profile import Profile
from joda.proposal import Proposal
from joda.propose.archetype import Archetype
from joda.propose.recognise import Recognition
from joda.scenes.context import Context
from joda.template import Template


@dataclass(frozen=True)
class Task:
    """What a proposer is given of a joint.

    Attributes:
        context: what the model knows of it.
        templates: the effects to choose from, by name.
        pictures: PNG files of the joint at several positions, labelled, from the low to the high
            end; empty where nothing can render.
        description: what the user wants of the joint, in words; may be empty.
        archetypes: kinds of joints to recognise; None: the library's.
    """

    context: Context
    templates: Mapping[str, Template]
    pictures: Sequence[bytes] = ()
    description: str = ""
    archetypes: Sequence[Archetype] | None = None


@dataclass(frozen=True)
class Turn:
    """A finished round, as the proposer is shown it.

    Attributes:
        proposal: what was proposed.
        profile: what it was compiled to.
        behaviour: how the joint behaved in simulation.
        picture: draws the profile, a PNG file; who looks at none need not wait for it.
        facts: the behaviour in a few lines.
        unmet: what was wished for and did not come, a sentence each.
        complaint: what the user said of it; may be empty.
    """

    proposal: Proposal
    profile: Profile
    behaviour: Behaviour
    picture: Callable[[], bytes]
    facts: str
    unmet: Sequence[str] = ()
    complaint: str = ""


class Usage(Frozen):
    """What an answer cost.

    Attributes:
        requests: how many were sent, failed ones included.
        input_tokens: in all, those read from or written to the prompt cache included.
        output_tokens: reasoning included.
        cache_read_tokens, cache_write_tokens: how many of the input tokens.
        dollars: None where the model's price is not known.
    """

    requests: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    cache_read_tokens: int = 0
    cache_write_tokens: int = 0
    dollars: float | None = None


@dataclass(frozen=True)
class Answer:
    """An answer.

    Attributes:
        proposal: None where the last proposal is complete.
        usage: zero for proposers that cost nothing.
        notes: what the user should be told, a sentence each.
        recognised: what the joint was taken for, and by what; None of who does not say.
    """

    proposal: Proposal | None
    usage: Usage = field(default_factory=Usage)
    notes: Sequence[str] = ()
    recognised: Recognition | None = None


class Proposer(Protocol):
    """Anything that proposes."""

    name: str

    def propose(self, task: Task, turns: Sequence[Turn]) -> Answer:
        """The next proposal.

        Args:
            task: the joint.
            turns: the rounds so far, oldest first; the last one's `complaint` asks for a change.

        Raises:
            JodaError: no usable answer was to be had.
        """
        ...


class Ask(NamedTuple):
    """One of many joints to propose for: a name of one's own, the task and its rounds."""

    name: str
    task: Task
    turns: Sequence[Turn]


@runtime_checkable
class BatchProposer(Proposer, Protocol):
    """A proposer that can be asked for many joints at once."""

    def propose_many(
        self,
        asks: Sequence[Ask],
        store: Path,
        progress: Callable[[int, int], None] = ...,
    ) -> Iterator[tuple[str, Answer | JodaError]]:
        """The next proposals of many joints, in any order.

        Interrupted, the same call picks up what is running or done and pays for nothing twice: an
        answer remains in the store until the next one is asked for.

        Args:
            asks: as for `propose`, each with a name.
            store: JSON file for what is paid for and not yet collected.
            progress: called with how many are done, and of how many.

        Returns:
            each ask's name, with its answer or the failure to get one.

        Raises:
            JodaError: two asks have the same name, the store cannot be read or written, or the
                service cannot be reached.
        """
        ...


def total(usages: Iterable[Usage]) -> Usage:
    """What they cost together; dollars are None if those of any are."""
    items = list(usages)
    prices = [item.dollars for item in items if item.requests]
    known = [price for price in prices if price is not None]
    return Usage(
        requests=sum(item.requests for item in items),
        input_tokens=sum(item.input_tokens for item in items),
        output_tokens=sum(item.output_tokens for item in items),
        cache_read_tokens=sum(item.cache_read_tokens for item in items),
        cache_write_tokens=sum(item.cache_write_tokens for item in items),
        dollars=sum(known) if len(known) == len(prices) else None,
    )
