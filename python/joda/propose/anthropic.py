"""Asks a Claude model for proposals, one at a time or many in one Message Batch.

Everything that was paid for is accounted for: an answer carries its usage, and so does the failure
to get one. The package `anthropic` is imported when it is first needed.
"""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from joda.errors import JodaError
from joda.profile import Profile
from joda.proposal import Proposal
from joda.propose import Answer, Ask, Task, Turn, Usage, replies
from joda.propose import prompt as prompts
from joda.propose.batch import HALF, Batches, Request, why
from joda.propose.price import Tally, price
from joda.propose.service import Credentials, host, usable
from joda.template import Template

if TYPE_CHECKING:
    from anthropic import Anthropic as Client
    from anthropic import APIError
    from anthropic.types import Message

T = TypeVar("T")

DEFAULT_MODEL = "claude-opus-5-5"
MAX_RETRIES = 4


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


class Anthropic:
    """Proposes by asking a Claude model.

    Args:
        model: its name; by default the environment's JODA_VLM, or DEFAULT_MODEL.
        base_url: another address of the service; by default ANTHROPIC_BASE_URL, or Anthropic's.
        timeout: of one request, in seconds.

    Raises:
        JodaError: the package `anthropic` is missing, the key or the address cannot be used, or
            JODA_VLM_PRICE (two numbers, dollars per million input and output tokens, "3/15") cannot
            be read.
    """

    def __init__(
        self, model: str | None = None, base_url: str | None = None, *, timeout: float = 600.0
    ) -> None:
        """Checks what can be checked without asking."""
        try:
            import anthropic  # noqa: F401
        except ImportError:
            raise JodaError(
                'asking a Claude model needs the package anthropic: pip install ".[vlm]".'
            ) from None
        self._credentials = Credentials(base_url)
        self.model = model or os.environ.get("JODA_VLM") or DEFAULT_MODEL
        self.name = f"anthropic:{self.model}"
        self._base_url, self._timeout = base_url, timeout
        self._price = price(self.model)

    def propose(self, task: Task, turns: Sequence[Turn]) -> Answer:
        """The next proposal, see `joda.propose.Proposer`.

        Raises:
            ProposalFailed: no usable answer was to be had; it carries the usage.
            ProposalInterrupted: a KeyboardInterrupt that carries it.
        """
        tally = Tally(self._price)
        asked = self._request(task, turns)
        with self._client() as client:
            proposal = self._converse(client, tally, asked, lambda t: replies.parse(t, task, turns))
        return Answer(proposal, tally.usage, tally.notes)

    def ablate(self, task: Task) -> tuple[Profile, Usage]:
        """A profile as the model draws it without templates: the paper's ablation.

        Raises:
            ProposalFailed: as `propose`.
        """
        tally = Tally(self._price)
        asked = {"model": self.model, **prompts.ablation(task)}
        with self._client() as client:
            profile = self._converse(
                client, tally, asked, lambda t: replies.parse_ablation(t, task)
            )
        return profile, tally.usage

    def propose_many(
        self,
        asks: Sequence[Ask],
        store: Path,
        progress: Callable[[int, int], None] = lambda done, total: None,
        *,
        sleep: Callable[[float], None] = time.sleep,
    ) -> Iterator[tuple[str, Answer | JodaError]]:
        """The next proposals of many joints, at half the price, within a day.

        See `joda.propose.BatchProposer`. The environment's JODA_POLL_S sets how many seconds pass
        at first between looks at the batch.

        Args:
            asks, store, progress: as there.
            sleep: waits so many seconds.
        """
        if len({ask.name for ask in asks}) < len(asks):
            raise JodaError("two asks of a batch have the same name; give each its own.")
        wanted: dict[str, tuple[Ask, Request]] = {}
        for ask in asks:
            try:
                asked = self._request(ask.task, ask.turns)
            except JodaError as error:
                yield ask.name, error
                continue
            wanted[_key(ask.name, asked)] = ask, asked
        requests = {key: asked for key, (_, asked) in wanted.items()}
        with self._client() as client:
            batches = Batches(client, store, lambda e: self._sentence(e, client), progress, sleep)
            for key, result in batches.results(requests):
                ask, asked = wanted.pop(key)
                yield ask.name, self._collect(client, ask, asked, result)
        for ask, _ in wanted.values():
            yield ask.name, JodaError("the batch came back without a result for this; ask again.")

    def _request(self, task: Task, turns: Sequence[Turn]) -> Request:
        sheet = _sheet(tuple(template.model_dump_json() for template in task.templates.values()))
        return {"model": self.model, **prompts.request(task, turns, sheet)}

    def _client(self) -> "Client":
        from anthropic import Anthropic as Client

        return Client(
            api_key=self._credentials.key,
            base_url=self._base_url,
            max_retries=MAX_RETRIES,
            timeout=self._timeout,
        )

    def _converse(
        self,
        client: "Client",
        tally: Tally,
        asked: Request,
        parse: Callable[[str], T],
        message: "Message | None" = None,
    ) -> T:
        """What `parse` makes of the answer: asked again once if cut off, and once if invalid.

        Args:
            client: to ask with.
            tally: pays for what is asked here.
            asked: the request.
            parse: raises JodaError on an invalid answer.
            message: the first answer, where there is one already.
        """
        grown = repaired = False
        while True:
            if message is None:
                message = self._send(client, tally, asked)
                tally.pay(message)
            said = "".join(block.text for block in message.content if block.type == "text")
            text = self._credentials.hide(said)
            if message.stop_reason == "refusal":
                raise ProposalFailed(
                    f"{self.model} declined to answer; describe the joint in other words, or "
                    "choose another model with JODA_VLM.",
                    tally.usage,
                )
            if message.stop_reason in ("max_tokens", "model_context_window_exceeded"):
                if grown:
                    raise ProposalFailed(
                        f"the answer of {self.model} was cut off after {asked['max_tokens']} "
                        "tokens; choose another model with JODA_VLM.",
                        tally.usage,
                    )
                grown, asked = True, {**asked, "max_tokens": 2 * asked["max_tokens"]}
                tally.notes.append("The answer was cut off, and asked for again with more room.")
            else:
                try:
                    return parse(text)
                except JodaError as error:
                    if repaired:
                        raise ProposalFailed(
                            f"{self.model} gave no valid proposal, not even when told what is "
                            f"wrong: {error}",
                            tally.usage,
                        ) from None
                    repaired, asked = True, prompts.repair(asked, text, str(error))
                    tally.notes.append(f"The answer was invalid, and asked for again: {error}")
            message = None

    def _send(self, client: "Client", tally: Tally, asked: Request) -> "Message":
        from anthropic import APIError

        message: Message | None
        try:
            counted = client.with_options(middleware=[tally.sent])
            message = counted.messages.create(**asked)
        except APIError as error:
            raise ProposalFailed(self._sentence(error, client), tally.usage) from None
        except KeyboardInterrupt:
            raise ProposalInterrupted(tally.usage) from None
        except ValueError:  # JSON that is cut off
            message = None
        if not usable(message):  # a web page, say
            told = "does not answer as the Messages API does; check ANTHROPIC_BASE_URL."
            raise ProposalFailed(f"{host(client)} {told}", tally.usage)
        return message

    def _collect(
        self, client: "Client", ask: Ask, asked: Request, result: Any
    ) -> Answer | ProposalFailed:
        """The answer in a batch's result; an invalid one is repaired outside of the batch."""
        tally = Tally(self._price, Usage(requests=1))
        if result.type != "succeeded":
            return ProposalFailed(self._credentials.hide(why(result)), tally.usage)
        if not usable(result.message):
            return ProposalFailed("the service's answer is no message; ask again.", tally.usage)
        tally.pay(result.message, HALF)

        def parse(text: str) -> Proposal | None:
            return replies.parse(text, ask.task, ask.turns)

        try:
            proposal = self._converse(client, tally, asked, parse, result.message)
        except ProposalFailed as error:
            return error
        return Answer(proposal, tally.usage, tally.notes)

    def _sentence(self, error: "APIError", client: "Client") -> str:
        """What is wrong and what to do, in one sentence."""
        import anthropic

        if isinstance(error, anthropic.APITimeoutError):
            return f"{host(client)} does not answer within {self._timeout:g} s; try again later."
        if not isinstance(error, anthropic.APIStatusError):
            return f"{host(client)} cannot be reached; check network and ANTHROPIC_BASE_URL."
        reason = self._credentials.hide(str(error.api_message or "no reason given")).rstrip(".")
        detail = f"{error.status_code}: {reason}"
        advice = {
            401: "set ANTHROPIC_API_KEY to a valid key",
            402: "see to the account's credit",
            403: "use another key, or choose another model with JODA_VLM",
            404: f"choose another model than '{self.model}' with JODA_VLM",
            413: "give fewer or smaller pictures",
            429: "wait a while, or ask in a batch",
        }
        other = "try again later" if error.status_code >= 500 else "choose another with JODA_VLM"
        return (
            f"the service refuses to answer for {self.model} ({detail}); "
            f"{advice.get(error.status_code, other)}."
        )


@cache
def _sheet(templates: tuple[str, ...]) -> bytes:
    """PNG file of templates, each given as JSON."""
    from joda.pictures.sheet import sheet
    from joda.pictures.style import png

    read = [Template.model_validate_json(text) for text in templates]
    return png(sheet({template.name: template for template in read}))


def _key(name: str, asked: Request) -> str:
    """By which a request is known again in a batch."""
    text = name + "\n" + json.dumps(asked, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:40]
