"""Asks a Claude model for proposals, one at a time or many in one Message Batch.

The package `anthropic` is imported when it is first needed.
"""

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from joda.errors import JodaError
from joda.propose import Answer, Ask, Usage, replies
from joda.propose.asking import (
    MAX_RETRIES,
    Effort,
    ProposalFailed,
    ProposalInterrupted,
    Reply,
    Request,
    Send,
    VisionModel,
    chosen,
    converse,
    refused,
)
from joda.propose.batch import HALF, Batches, why
from joda.propose.price import Tally, Tokens
from joda.propose.service import Credentials, counted, host

if TYPE_CHECKING:
    from anthropic import Anthropic as Client
    from anthropic import APIError
    from anthropic.types import Message

DEFAULT_MODEL = "claude-opus-5-5"


@dataclass(frozen=True)
class Abilities:
    """What a model can do, as far as the service says so.

    Attributes:
        thinks: whether it decides by itself how much to think (adaptive thinking).
        efforts: which it takes; None: not said.
        obeys: whether its answer can be held to a JSON Schema; where not, that is asked in words.
    """

    thinks: bool = False
    efforts: tuple[str, ...] | None = None
    obeys: bool = True


class Anthropic(VisionModel):
    """Proposes by asking a Claude model.

    Args:
        model: its name; by default the environment's JODA_VLM, or DEFAULT_MODEL.
        base_url: another address of the service; by default ANTHROPIC_BASE_URL, or Anthropic's.
        effort: how much to put into an answer; by default the model's own, which is "high".
        timeout: of one request, in seconds.

    Raises:
        JodaError: the package `anthropic` is missing, the key or the address cannot be used, or
            JODA_VLM_PRICE (two numbers, dollars per million input and output tokens, "3/15") cannot
            be read.
    """

    service = "anthropic"

    def __init__(
        self,
        model: str | None = None,
        base_url: str | None = None,
        *,
        effort: Effort | None = None,
        timeout: float = 600.0,
    ) -> None:
        """Checks what can be checked without asking."""
        try:
            import anthropic  # noqa: F401
        except ImportError:
            raise JodaError(
                'asking a Claude model needs the package anthropic: pip install ".[vlm]".'
            ) from None
        self._credentials = Credentials("ANTHROPIC", base_url)
        if not self._credentials.key:
            raise JodaError(
                "ANTHROPIC_API_KEY is not set; set it to a key from platform.claude.com, or choose "
                "the proposer 'offline'."
            )
        super().__init__(chosen(model, DEFAULT_MODEL))
        self._effort, self._timeout = effort, timeout
        self._abilities: Abilities | None = None

    @contextmanager
    def sending(self) -> Iterator[Send]:
        """See `VisionModel`."""
        with self._client() as client:
            yield lambda asked, tally: self._reply(
                self._send(client, tally, self._suited(client, asked))
            )

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
        with self._client() as client:
            for ask in asks:
                try:
                    asked = self.request(ask.task, ask.turns, lasting=True)
                except JodaError as error:
                    yield ask.name, error
                    continue
                asked = self._suited(client, asked)
                wanted[_key(ask.name, asked)] = ask, asked
            requests = {key: asked for key, (_, asked) in wanted.items()}
            batches = Batches(client, store, lambda e: self._sentence(e, client), progress, sleep)
            for key, result in batches.results(requests):
                ask, asked = wanted.pop(key)
                yield ask.name, self._collect(client, ask, asked, result)
        for ask, _ in wanted.values():
            yield ask.name, JodaError("the batch came back without a result for this; ask again.")

    def _client(self) -> "Client":
        from anthropic import Anthropic as Client

        return Client(
            api_key=self._credentials.key,
            base_url=self._credentials.base_url,
            max_retries=MAX_RETRIES,
            timeout=self._timeout,
        )

    def _suited(self, client: "Client", asked: Request) -> Request:
        """The request as the model takes it: how much it thinks, how its answer is held.

        Raises:
            JodaError: it takes no such effort, or the service cannot be asked what it takes.
        """
        if self._abilities is None:
            self._abilities = self._look_up(client)
        takes = self._abilities.efforts
        if self._effort and takes is not None and self._effort not in takes:
            instead = f"it takes {', '.join(takes)}" if takes else "leave --effort out"
            raise JodaError(f"{self.model} takes no effort '{self._effort}'; {instead}.")
        out, config = dict(asked), dict(asked["output_config"])
        if self._abilities.thinks:
            out["thinking"] = {"type": "adaptive"}
        if self._effort:
            config["effort"] = self._effort
        if not self._abilities.obeys:
            words = replies.PLAINLY + json.dumps(config.pop("format")["schema"])
            out["system"] = [*asked["system"], {"type": "text", "text": words}]
        del out["output_config"]
        return {**out, "output_config": config} if config else out

    def _look_up(self, client: "Client") -> Abilities:
        """What the model can do; nothing is assumed where the service does not know it."""
        from anthropic import APIError, APIStatusError

        try:
            return _abilities(client.models.retrieve(self.model))
        except APIStatusError as error:
            if error.status_code in (401, 429) or error.status_code >= 500:
                raise ProposalFailed(self._sentence(error, client), Usage()) from None
        except APIError as error:
            raise ProposalFailed(self._sentence(error, client), Usage()) from None
        except (ValueError, RecursionError):  # JSON that is cut off, or brackets too deep
            pass
        return Abilities()

    def _send(self, client: "Client", tally: Tally, asked: Request) -> "Message":
        from anthropic import APIError

        def count(request: Any, send: Callable[[Any], Any]) -> Any:
            tally.sent()
            return send(request)

        message: Message | None
        try:
            message = client.with_options(middleware=[count]).messages.create(**asked)
        except APIError as error:
            raise ProposalFailed(self._sentence(error, client), tally.usage) from None
        except KeyboardInterrupt:
            raise ProposalInterrupted(tally.usage) from None
        except (ValueError, RecursionError):  # JSON that is cut off, or brackets too deep
            message = None
        if not _usable(message):  # a web page, say
            told = (
                "does not answer as the Messages API does; check --base-url or ANTHROPIC_BASE_URL."
            )
            raise ProposalFailed(f"{host(client)} {told}", tally.usage)
        tally.pay(_tokens(message))
        return message

    def _reply(self, message: "Message") -> Reply:
        said = "".join(getattr(one, "text", "") for one in message.content if _kind(one) == "text")
        text = self._credentials.hide(replies.bare(said))
        if message.stop_reason == "refusal":
            details = getattr(message, "stop_details", None)
            why = getattr(details, "explanation", None) or getattr(details, "category", None)
            return Reply(text, "declined", self._credentials.hide(str(why or "")))
        cut = message.stop_reason in ("max_tokens", "model_context_window_exceeded")
        return Reply(text, "cut" if cut else "whole")

    def _collect(
        self, client: "Client", ask: Ask, asked: Request, result: Any
    ) -> Answer | ProposalFailed:
        """The answer in a batch's result; an invalid one is repaired outside of the batch."""
        tally = Tally(self.price, Usage(requests=1))
        if result.type != "succeeded":
            return ProposalFailed(self._credentials.hide(why(result)), tally.usage)
        if not _usable(result.message):
            return ProposalFailed("the service's answer is no message; ask again.", tally.usage)
        tally.pay(_tokens(result.message), HALF)
        try:
            proposal = converse(
                self.model,
                lambda asked, tally: self._reply(self._send(client, tally, asked)),
                asked,
                tally,
                lambda text: replies.parse(text, ask.task, ask.turns),
                self._reply(result.message),
            )
        except ProposalFailed as error:
            return error
        return Answer(proposal, tally.usage, tally.notes)

    def _sentence(self, error: "APIError", client: "Client") -> str:
        """What is wrong and what to do, in one sentence."""
        import anthropic

        if isinstance(error, anthropic.APITimeoutError):
            return f"{host(client)} does not answer within {self._timeout:g} s; try again later."
        if not isinstance(error, anthropic.APIStatusError):
            said = "cannot be reached, or breaks off; check the network and the address."
            return f"{host(client)} {said}"
        reason = self._credentials.hide(str(error.api_message or ""))
        advice = {
            401: "set ANTHROPIC_API_KEY to a valid key",
            429: "wait a while, or ask in a batch",
        }
        return refused(self.model, error.status_code, reason, advice)


def _abilities(found: Any) -> Abilities:
    """What the service says of a model, which it may not."""
    said = getattr(found, "capabilities", None)
    efforts = getattr(said, "effort", None)
    known = [name for name in ("low", "medium", "high", "xhigh", "max") if _has(efforts, name)]
    types = getattr(getattr(said, "thinking", None), "types", None)
    form = getattr(getattr(said, "structured_outputs", None), "supported", None)
    takes = None if efforts is None else tuple(known)
    return Abilities(_has(types, "adaptive"), takes, form is not False)


def _has(said: Any, name: str) -> bool:
    return getattr(getattr(said, name, None), "supported", None) is True


def _tokens(message: "Message") -> Tokens:
    used = message.usage
    write = used.cache_creation_input_tokens or 0
    hour = getattr(used.cache_creation, "ephemeral_1h_input_tokens", None) or 0
    read = used.cache_read_input_tokens or 0
    return Tokens(used.input_tokens, used.output_tokens, read, write - hour, hour)


def _usable(message: Any) -> "TypeGuard[Message]":
    """Whether an answer is a message with texts and sensible counts of tokens."""
    used, content = getattr(message, "usage", None), getattr(message, "content", None)
    counts = [getattr(used, name, None) for name in ("input_tokens", "output_tokens")]
    read, write = (
        getattr(used, f"cache_{name}_input_tokens", None) or 0 for name in ("read", "creation")
    )
    kept = getattr(used, "cache_creation", None)
    hour = getattr(kept, "ephemeral_1h_input_tokens", None) or 0
    return (
        counted(*counts, read, write, hour)
        and hour <= write
        and isinstance(content, list)
        and all(isinstance(part.text, str) for part in content if _kind(part) == "text")
    )


def _kind(part: Any) -> str | None:
    return getattr(part, "type", None)


def _key(name: str, asked: Request) -> str:
    """By which a request is known again in a batch."""
    text = name + "\n" + json.dumps(asked, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:40]
