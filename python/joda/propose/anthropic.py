"""Asks a Claude model for proposals, one at a time or many in one Message Batch.

Everything that was paid for is accounted for: an answer carries its usage, and so does the failure
to get one. The package `anthropic` is imported when it is first needed.
"""

import hashlib
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from joda.errors import JodaError
from joda.files import write_text
from joda.profile import File, Frozen, Profile
from joda.propose import Answer, Task, Turn, Usage
from joda.propose import prompt as prompts
from joda.template import Template

if TYPE_CHECKING:
    from anthropic import Anthropic as Client
    from anthropic import APIError
    from anthropic.types import Message

T = TypeVar("T")
Request = dict[str, Any]
Price = tuple[float, float, float]

DEFAULT_MODEL = "claude-opus-5-5"
PRICES: dict[str, Price] = {
    "claude-fable-5-2": (8, 40, 0.2),
    "claude-fable-5-1": (10, 50, 0.25),
    "claude-fable-5": (10, 50, 1),
    "claude-opus-5-5": (4, 20, 0.2),
    "claude-opus-5": (5, 25, 0.5),
    "claude-opus-4-8": (5, 25, 0.5),
    "claude-opus-4-7": (5, 25, 0.5),
    "claude-opus-4-6": (5, 25, 0.5),
    "claude-opus-4-5": (5, 25, 0.5),
    "claude-sonnet-5-5": (2, 10, 0.1),
    "claude-sonnet-5": (2, 10, 0.2),
    "claude-sonnet-4-6": (3, 15, 0.3),
    "claude-sonnet-4-5": (3, 15, 0.3),
    "claude-haiku-5-5": (0.1, 0.5, 0.01),
    "claude-haiku-4-5": (1, 5, 0.1),
}
"""Dollars per million tokens: input, output, cache read (platform.claude.com, November 2026)."""
CACHE_READ, CACHE_WRITE, BATCH = 0.1, 1.25, 0.5
"""Multiples of the price; CACHE_READ where JODA_VLM_PRICE does not say."""

MAX_RETRIES = 4
BATCH_REQUESTS, BATCH_BYTES = 100_000, 256_000_000
POLL, SLOWEST_POLL = 5.0, 60.0
"""Seconds between looks at a batch, growing."""


class ProposalFailed(JodaError):
    """No usable answer was to be had.

    Attributes:
        usage: what it cost all the same.
    """

    def __init__(self, sentence: str, usage: Usage) -> None:
        """Takes the sentence for the user and the usage."""
        super().__init__(sentence)
        self.usage = usage


class _Batch(Frozen):
    id: str
    requests: tuple[str, ...]


class _Store(File):
    """The batches that are paid for and not yet collected."""

    batches: tuple[_Batch, ...] = ()


@dataclass
class _Tab:
    """What an answer has cost so far, and what the user should know of it."""

    price: Price | None
    usage: Usage = field(default_factory=Usage)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._grow(dollars=0.0 if self.price else None)

    def sent(self, request: Any, send: Callable[[Any], Any]) -> Any:
        """Middleware of the client: counts what is sent, retries too."""
        self._grow(requests=self.usage.requests + 1)
        return send(request)

    def pay(self, message: "Message", factor: float = 1.0) -> None:
        spent, before = message.usage, self.usage
        read, write = spent.cache_read_input_tokens or 0, spent.cache_creation_input_tokens or 0
        if self.price:
            into, out, cached = self.price
            fresh = spent.input_tokens * into + spent.output_tokens * out
            dollars = factor * (fresh + write * into * CACHE_WRITE + read * cached) / 1e6
            self._grow(dollars=(before.dollars or 0.0) + dollars)
        self._grow(
            input_tokens=before.input_tokens + spent.input_tokens + read + write,
            output_tokens=before.output_tokens + spent.output_tokens,
            cache_read_tokens=before.cache_read_tokens + read,
            cache_write_tokens=before.cache_write_tokens + write,
        )

    def _grow(self, **values: float | None) -> None:
        self.usage = self.usage.model_copy(update=values)


class Anthropic:
    """Proposes by asking a Claude model.

    Args:
        model: its name; by default the environment's JODA_VLM, or DEFAULT_MODEL.
        base_url: another address of the service; by default ANTHROPIC_BASE_URL, or Anthropic's.
        timeout: of one request, in seconds.

    Raises:
        JodaError: the package `anthropic` or ANTHROPIC_API_KEY is missing, or JODA_VLM_PRICE (two
            numbers, dollars per million input and output tokens, "3/15") cannot be read.
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
        self._key = os.environ.get("ANTHROPIC_API_KEY", "").strip()
        if not self._key:
            raise JodaError(
                "ANTHROPIC_API_KEY is not set; set it to a key from platform.claude.com, or choose "
                "the proposer 'offline'."
            )
        self.model = model or os.environ.get("JODA_VLM") or DEFAULT_MODEL
        self.name = f"anthropic:{self.model}"
        self._base_url, self._timeout = base_url, timeout
        self._price = _price(self.model)

    def propose(self, task: Task, turns: Sequence[Turn]) -> Answer:
        """The next proposal, see `joda.propose.Proposer`.

        Raises:
            ProposalFailed: no usable answer was to be had; it carries the usage.
        """
        tab = _Tab(self._price)
        asked = self._request(task, turns)
        with self._client() as client:
            proposal = self._converse(client, tab, asked, lambda t: prompts.parse(t, task, turns))
        return Answer(proposal, tab.usage, tab.notes)

    def ablate(self, task: Task) -> tuple[Profile, Usage]:
        """A profile as the model draws it without templates: the paper's ablation.

        Raises:
            ProposalFailed: as `propose`.
        """
        tab = _Tab(self._price)
        asked = {"model": self.model, **prompts.ablation(task)}
        with self._client() as client:
            profile = self._converse(client, tab, asked, lambda t: prompts.parse_ablation(t, task))
        return profile, tab.usage

    def propose_many(
        self,
        asks: Sequence[tuple[str, Task, Sequence[Turn]]],
        store: Path,
        progress: Callable[[int, int], None] = lambda done, total: None,
        *,
        sleep: Callable[[float], None] = time.sleep,
    ) -> dict[str, Answer | JodaError]:
        """The next proposals of many joints, at half the price, within a day.

        Interrupted, the same call picks up what is running or done and pays for nothing twice.

        Args:
            asks: a name of one's own, the task and its rounds, each as for `propose`.
            store: JSON file in which running batches are kept; deleted when all is collected.
            progress: called with how many are done, and of how many.
            sleep: waits so many seconds; the environment's JODA_POLL_S sets how long at first.

        Returns:
            name to answer, or to the failure to get one; in the order of the asks.

        Raises:
            JodaError: two asks have the same name, the store cannot be read or written, or the
                service cannot be reached.
        """
        delay = _poll()
        wanted: dict[str, tuple[str, Task, Sequence[Turn], Request]] = {}
        for name, task, turns in asks:
            asked = self._request(task, turns)
            wanted[_hash(name, asked)] = (name, task, turns, asked)
        if len({name for name, *_ in asks}) < len(asks):
            raise JodaError("two asks of a batch have the same name; give each its own.")
        answers: dict[str, Answer | JodaError] = {}
        with self._client() as client:
            known = _Store.read(store).batches if store.exists() else ()
            known = self._start(client, known, {key: ask[3] for key, ask in wanted.items()}, store)
            ours = [batch for batch in known if wanted.keys() & set(batch.requests)]
            self._wait(client, ours, store, progress, sleep, delay)
            for key, result in self._results(client, ours, store):
                if key in wanted:
                    name, task, turns, asked = wanted[key]
                    answers[name] = self._collect(client, task, turns, asked, result)
        others = tuple(batch for batch in known if batch not in ours)
        if others:
            _save(store, others)
        else:
            store.unlink(missing_ok=True)
        nothing = JodaError("the batch came back without a result for this; ask again.")
        return {name: answers.get(name, nothing) for name, *_ in asks}

    def _request(self, task: Task, turns: Sequence[Turn]) -> Request:
        sheet = _sheet(tuple(template.model_dump_json() for template in task.templates.values()))
        return {"model": self.model, **prompts.request(task, turns, sheet)}

    def _client(self) -> "Client":
        from anthropic import Anthropic as Client

        return Client(
            api_key=self._key,
            base_url=self._base_url,
            max_retries=MAX_RETRIES,
            timeout=self._timeout,
        )

    def _converse(
        self,
        client: "Client",
        tab: _Tab,
        asked: Request,
        parse: Callable[[str], T],
        message: "Message | None" = None,
    ) -> T:
        """What `parse` makes of the answer: asked again once if cut off, and once if invalid.

        Args:
            client: to ask with.
            tab: pays for what is asked here.
            asked: the request.
            parse: raises JodaError on an invalid answer.
            message: the first answer, where there is one already.
        """
        grown = repaired = False
        while True:
            if message is None:
                message = self._send(client, tab, asked)
                tab.pay(message)
            text = "".join(block.text for block in message.content if block.type == "text")
            if message.stop_reason == "refusal":
                raise ProposalFailed(
                    f"{self.model} declined to answer; describe the joint in other words, or "
                    "choose another model with JODA_VLM.",
                    tab.usage,
                )
            if message.stop_reason in ("max_tokens", "model_context_window_exceeded"):
                if grown:
                    raise ProposalFailed(
                        f"the answer of {self.model} was cut off after {asked['max_tokens']} "
                        "tokens; choose another model with JODA_VLM.",
                        tab.usage,
                    )
                grown, asked = True, {**asked, "max_tokens": 2 * asked["max_tokens"]}
                tab.notes.append("The answer was cut off, and asked for again with more room.")
            else:
                try:
                    return parse(text)
                except JodaError as error:
                    if repaired:
                        raise ProposalFailed(
                            f"{self.model} gave no valid proposal, not even when told what is "
                            f"wrong: {error}",
                            tab.usage,
                        ) from None
                    repaired, asked = True, prompts.repair(asked, text, str(error))
                    tab.notes.append(f"The answer was invalid, and asked for again: {error}")
            message = None

    def _send(self, client: "Client", tab: _Tab, asked: Request) -> "Message":
        from anthropic import APIError

        try:
            counted = client.with_options(middleware=[tab.sent])
            message: Message = counted.messages.create(**asked)
        except APIError as error:
            raise ProposalFailed(self._sentence(error, client), tab.usage) from None
        if getattr(message, "usage", None) is None:  # a web page, say
            raise ProposalFailed(
                f"{client.base_url} does not answer as the Messages API does; check "
                "ANTHROPIC_BASE_URL.",
                tab.usage,
            )
        return message

    def _start(
        self,
        client: "Client",
        known: tuple[_Batch, ...],
        wanted: Mapping[str, Request],
        store: Path,
    ) -> tuple[_Batch, ...]:
        """The batches, with new ones for what is in none yet; each is stored as it is created."""
        from anthropic import APIError

        paid = {key for batch in known for key in batch.requests}
        for part in _split({key: asked for key, asked in wanted.items() if key not in paid}):
            requests: Any = [{"custom_id": key, "params": asked} for key, asked in part.items()]
            try:
                batch = client.messages.batches.create(requests=requests)
            except APIError as error:
                raise JodaError(self._sentence(error, client)) from None
            known = (*known, _Batch(id=batch.id, requests=tuple(part)))
            _save(store, known)
        return known

    def _wait(
        self,
        client: "Client",
        batches: Sequence[_Batch],
        store: Path,
        progress: Callable[[int, int], None],
        sleep: Callable[[float], None],
        delay: float,
    ) -> None:
        total = sum(len(batch.requests) for batch in batches)
        while True:
            looks = [self._look(client, batch, store) for batch in batches]
            progress(total - sum(look.request_counts.processing for look in looks), total)
            if all(look.processing_status == "ended" for look in looks):
                return
            sleep(delay)
            delay = min(1.5 * delay, max(delay, SLOWEST_POLL))

    def _look(self, client: "Client", batch: _Batch, store: Path) -> Any:
        from anthropic import APIError, NotFoundError

        try:
            return client.messages.batches.retrieve(batch.id)
        except NotFoundError:
            raise JodaError(
                f"{store}: the service does not know batch {batch.id}; use the key that it was "
                "made with, or delete the file to pay for it anew."
            ) from None
        except APIError as error:
            raise JodaError(f"{store}: {self._sentence(error, client)}") from None

    def _results(
        self, client: "Client", batches: Sequence[_Batch], store: Path
    ) -> Iterator[tuple[str, Any]]:
        """Request and result, of all batches."""
        from anthropic import AnthropicError
        from httpx2 import HTTPError

        for batch in batches:
            try:
                for entry in client.messages.batches.results(batch.id):
                    yield entry.custom_id, entry.result
            except (AnthropicError, HTTPError) as error:
                raise JodaError(
                    f"{store}: batch {batch.id} cannot be collected ({error}); run the same again."
                ) from None

    def _collect(
        self, client: "Client", task: Task, turns: Sequence[Turn], asked: Request, result: Any
    ) -> Answer | JodaError:
        """The answer in a batch's result; an invalid one is repaired outside of the batch."""
        tab = _Tab(self._price, Usage(requests=1))
        if result.type != "succeeded":
            what = {
                "expired": "the batch expired before this was asked; ask again.",
                "canceled": "the batch was cancelled before this was asked; ask again.",
            }
            detail = f"the service refuses the request ({_error(result)})."
            return ProposalFailed(what.get(result.type, detail), tab.usage)
        tab.pay(result.message, BATCH)
        try:
            proposal = self._converse(
                client, tab, asked, lambda text: prompts.parse(text, task, turns), result.message
            )
        except JodaError as error:
            return error
        return Answer(proposal, tab.usage, tab.notes)

    def _sentence(self, error: "APIError", client: "Client") -> str:
        """What is wrong and what to do, in one sentence."""
        import anthropic

        if isinstance(error, anthropic.APITimeoutError):
            return f"{client.base_url} does not answer within {self._timeout:g} s; try again later."
        if not isinstance(error, anthropic.APIStatusError):
            return f"{client.base_url} cannot be reached; check network and ANTHROPIC_BASE_URL."
        detail = f"{error.status_code}: {(error.api_message or 'no reason given').rstrip('.')}"
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
    from joda.sheet import sheet

    read = [Template.model_validate_json(text) for text in templates]
    figure, out = sheet({template.name: template for template in read}), BytesIO()
    figure.savefig(out, format="png", dpi=figure.dpi)
    return out.getvalue()


def _price(model: str) -> Price | None:
    text = os.environ.get("JODA_VLM_PRICE")
    if not text:
        return PRICES.get(re.sub(r"-\d{8}$", "", model))
    try:
        into, out = map(float, text.split("/"))
    except ValueError:
        raise JodaError(
            f"JODA_VLM_PRICE is '{text}'; give dollars per million input/output tokens, as 3/15."
        ) from None
    return into, out, CACHE_READ * into


def _poll() -> float:
    text = os.environ.get("JODA_POLL_S") or str(POLL)
    try:
        return max(0.0, float(text))
    except ValueError:
        raise JodaError(f"JODA_POLL_S is '{text}'; give seconds, as 5.") from None


def _hash(name: str, asked: Request) -> str:
    text = name + "\n" + json.dumps(asked, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:40]


def _split(requests: Mapping[str, Request]) -> Iterator[dict[str, Request]]:
    """Parts that a batch can hold."""
    part: dict[str, Request] = {}
    size = 0
    for key, asked in requests.items():
        more = len(json.dumps(asked)) + 200
        if part and (len(part) == BATCH_REQUESTS or size + more > BATCH_BYTES):
            yield part
            part, size = {}, 0
        part[key] = asked
        size += more
    if part:
        yield part


def _save(store: Path, batches: tuple[_Batch, ...]) -> None:
    write_text(store, _Store(batches=batches).model_dump_json(indent=1) + "\n")


def _error(result: Any) -> str:
    found = getattr(getattr(result, "error", None), "error", None)
    return str(getattr(found, "message", "no reason given")).rstrip(".")
