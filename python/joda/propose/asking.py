"""What all vision-language models have in common: how they are asked until an answer can be used.

A service says how a request is sent (`VisionModel.sending`); what is asked, what is made of a reply
that is cut off, declined or invalid, and what all of it cost, is the same for all. Everything that
was paid for is accounted for: an answer carries its usage, and so does the failure to get one.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeVar

from joda.errors import JodaError
from joda.profile import Profile
from joda.propose import Answer, Task, Turn, Usage, replies
from joda.propose import prompt as prompts
from joda.propose.price import Tally, Tokens, price, tokens
from joda.template import Template

T = TypeVar("T")
Request = dict[str, Any]
"""Keyword arguments of a request, as the Messages API has them; other services translate them."""

Effort = Literal["low", "medium", "high", "xhigh", "max"]
MAX_RETRIES = 4
ROUND, ANSWER = 1_500, 4_000
"""Tokens by which a round makes the next request longer, and of an answer, reasoning included: an
estimate, on the high side."""


class ProposalFailed(JodaError):
    """No usable answer was to be had.

    Attributes:
        usage: what it cost all the same.
    """

    def __init__(self, sentence: str, usage: Usage) -> None:
        """Takes the sentence for the user and the usage."""
        super().__init__(sentence)
        self.usage = usage


class ProposalInterrupted(KeyboardInterrupt):
    """The user did not wait for the answer.

    Attributes:
        usage: what it had cost until then.
    """

    def __init__(self, usage: Usage) -> None:
        """Takes the usage."""
        super().__init__()
        self.usage = usage


@dataclass(frozen=True)
class Reply:
    """What came back.

    Attributes:
        text: the answer; secrets are hidden in it.
        end: whether it is whole, was cut off, or was declined.
        why: why it was declined, if that is said.
    """

    text: str
    end: Literal["whole", "cut", "declined"] = "whole"
    why: str = ""


Send = Callable[[Request, Tally], Reply]
"""Sends a request and pays for it; raises ProposalFailed or ProposalInterrupted."""


class VisionModel(ABC):
    """Proposes by asking a model that reads text and pictures.

    Attributes:
        model: its name.
        name: of the proposer: service and model.
        price: None where it is not known.
    """

    service: str

    def __init__(self, model: str) -> None:
        """Raises JodaError if JODA_VLM_PRICE cannot be read."""
        self.model, self.name = model, f"{self.service}:{model}"
        self.price = price(model)

    @abstractmethod
    def sending(self) -> AbstractContextManager[Send]:
        """The way to the service, while it is open; raises ProposalFailed if there is none."""

    def propose(self, task: Task, turns: Sequence[Turn]) -> Answer:
        """The next proposal, see `joda.propose.Proposer`.

        Raises:
            ProposalFailed: no usable answer was to be had; it carries the usage.
            ProposalInterrupted: a KeyboardInterrupt that carries it.
        """
        tally, asked = Tally(self.price), self.request(task, turns)
        with self.sending() as send:
            proposal = converse(
                self.model, send, asked, tally, lambda text: replies.parse(text, task, turns)
            )
        return Answer(proposal, tally.usage, tally.notes)

    def estimate(self, task: Task, rounds: int, factor: float = 1.0) -> Usage:
        """What so many rounds will about cost, at `factor` times the price; nobody is asked.

        Of later rounds and of answers only the usual size is known; the cache is left out.
        """
        tally, first = Tally(self.price), tokens(self.request(task, ()))
        for k in range(rounds):
            tally.sent()
            tally.pay(Tokens(first + k * ROUND, ANSWER), factor)
        return tally.usage

    def ablate(self, task: Task) -> tuple[Profile, Usage]:
        """A profile as the model draws it without templates: the paper's ablation.

        Raises:
            ProposalFailed: as `propose`.
        """
        tally, asked = Tally(self.price), {"model": self.model, **prompts.ablation(task)}
        with self.sending() as send:
            profile = converse(
                self.model, send, asked, tally, lambda text: replies.parse_ablation(text, task)
            )
        return profile, tally.usage

    def request(self, task: Task, turns: Sequence[Turn], *, lasting: bool = False) -> Request:
        """A request for the next proposal, see `joda.propose.prompt.request`."""
        sheet = _sheet(tuple(one.model_dump_json() for one in task.templates.values()))
        return {"model": self.model, **prompts.request(task, turns, sheet, lasting=lasting)}


def converse(
    model: str,
    send: Send,
    asked: Request,
    tally: Tally,
    parse: Callable[[str], T],
    reply: Reply | None = None,
) -> T:
    """What `parse` makes of the answer: asked again once if cut off, and once if invalid.

    Args:
        model: its name.
        send: the way to it.
        asked: the request.
        tally: of what is asked here.
        parse: raises JodaError on an invalid answer.
        reply: the first answer, where there is one already.

    Raises:
        ProposalFailed: no usable answer was to be had.
    """
    grown = repaired = False
    while True:
        reply = reply or send(asked, tally)
        if reply.end == "declined":
            why = f" ({reply.why.rstrip('.')})" if reply.why else ""
            raise ProposalFailed(
                f"{model} declined to answer{why}; describe the joint in other words, or choose "
                "another model with --vlm.",
                tally.usage,
            )
        if reply.end == "cut":
            if grown:
                raise ProposalFailed(
                    f"the answer of {model} was cut off after {asked['max_tokens']} tokens; choose "
                    "another model with --vlm.",
                    tally.usage,
                )
            grown, asked = True, {**asked, "max_tokens": 2 * asked["max_tokens"]}
            tally.notes.append("The answer was cut off, and asked for again with more room.")
        else:
            try:
                return parse(reply.text)
            except JodaError as error:
                if repaired:
                    raise ProposalFailed(
                        f"{model} gave no valid proposal, not even when told what is wrong: "
                        f"{error}",
                        tally.usage,
                    ) from None
                repaired, asked = True, prompts.repair(asked, reply.text, str(error))
                tally.notes.append(f"The answer was invalid, and asked for again: {error}")
        reply = None


def refused(model: str, status: int, reason: str, advice: dict[int, str]) -> str:
    """The service's refusal in one sentence, with what to do.

    Args:
        model: its name.
        status: of HTTP.
        reason: the service's words; empty if it gives none.
        advice: what to do by status, where the service has something of its own to say.
    """
    detail = f"{status}: {(reason or 'no reason given').rstrip('.')}"
    known = {
        402: "see to the account's credit",
        403: "use another key, or choose another model with --vlm",
        404: f"choose another model than '{model}' with --vlm",
        413: "give fewer or smaller pictures",
        429: "wait a while",
        **advice,
    }
    other = "try again later" if status >= 500 else "choose another model with --vlm"
    return f"the service refuses to answer for {model} ({detail}); {known.get(status, other)}."


def chosen(model: str | None, default: str = "") -> str:
    """The name of the model: the given one, or the environment's JODA_VLM, or the default."""
    return model or os.environ.get("JODA_VLM") or default


@cache
def _sheet(templates: tuple[str, ...]) -> bytes:
    """PNG file of templates, each given as JSON."""
    from joda.pictures.sheet import sheet
    from joda.pictures.style import png

    read = [Template.model_validate_json(text) for text in templates]
    return png(sheet({template.name: template for template in read}))
