"""Message Batches: many requests at half the price, in a store until their results are collected.

What a request asks is its caller's; here it has a key, by which a batch that is running or done is
known again: nothing is paid for twice.
"""

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joda.component import Frozen
from joda.errors import JodaError
from joda.files import write_text
from joda.profile import File
from joda.propose.asking import Request

if TYPE_CHECKING:
    from anthropic import Anthropic as Client
    from anthropic import APIError

HALF = 0.5
"""Of the price."""
MAX_REQUESTS, MAX_BYTES = 100_000, 256_000_000
POLL, SLOWEST_POLL = 5.0, 60.0
"""Seconds between looks at a batch, growing."""


class _Batch(Frozen):
    """A batch, and the keys of its requests that are not yet collected."""

    id: str
    requests: tuple[str, ...]


class _Store(File):
    """The batches that are paid for and not yet collected."""

    batches: tuple[_Batch, ...] = ()


@dataclass
class Batches:
    """Sends requests in batches and collects their results.

    Attributes:
        client: of the service.
        store: JSON file in which running batches are kept; deleted when all is collected.
        explain: the service's failure as a sentence.
        progress: called with how many are done, and of how many.
        sleep: waits so many seconds.
    """

    client: "Client"
    store: Path
    explain: Callable[["APIError"], str]
    progress: Callable[[int, int], None] = lambda done, total: None
    sleep: Callable[[float], None] = time.sleep

    def results(self, requests: Mapping[str, Request]) -> Iterator[tuple[str, Any]]:
        """Key and result of each request, as soon as all are done.

        A result stays in the store until the next one is asked for: who is interrupted while
        handling it gets it again.

        Args:
            requests: keyword arguments of `client.messages.create` by key.

        Raises:
            JodaError: the store cannot be read or written, or the service cannot be reached.
        """
        delay = _poll()
        known = _Store.read(self.store).batches if self.store.exists() else ()
        known = self._start(known, requests)
        ours = [batch for batch in known if requests.keys() & set(batch.requests)]
        self._wait(ours, delay)
        for batch in ours:
            for key, result in self._download(batch):
                if key in requests and key in batch.requests:  # not collected before
                    yield key, result
                    known = _without(known, batch.id, {key})
                    self._save(known)
            known = _without(known, batch.id, batch.requests)
            self._save(known)

    def _start(
        self, known: tuple[_Batch, ...], requests: Mapping[str, Request]
    ) -> tuple[_Batch, ...]:
        """The batches, with new ones for what is in none yet; each is stored as it is created."""
        from anthropic import APIError

        paid = {key for batch in known for key in batch.requests}
        for part in _split({key: asked for key, asked in requests.items() if key not in paid}):
            entries: Any = [{"custom_id": key, "params": asked} for key, asked in part.items()]
            try:
                batch = self.client.messages.batches.create(requests=entries)
            except APIError as error:
                raise JodaError(self.explain(error)) from None
            known = (*known, _Batch(id=batch.id, requests=tuple(part)))
            self._save(known)
        return known

    def _wait(self, batches: Sequence[_Batch], delay: float) -> None:
        total = sum(len(batch.requests) for batch in batches)
        while True:
            looks = [self._look(batch) for batch in batches]
            self.progress(total - sum(look.request_counts.processing for look in looks), total)
            if all(look.processing_status == "ended" for look in looks):
                return
            self.sleep(delay)
            delay = min(1.5 * delay, max(delay, SLOWEST_POLL))

    def _look(self, batch: _Batch) -> Any:
        from anthropic import APIError, NotFoundError

        try:
            return self.client.messages.batches.retrieve(batch.id)
        except NotFoundError:
            raise JodaError(
                f"{self.store}: the service does not know batch {batch.id}; use the key that it "
                "was made with, or delete the file to pay for it anew."
            ) from None
        except APIError as error:
            raise JodaError(f"{self.store}: {self.explain(error)}") from None

    def _download(self, batch: _Batch) -> Iterator[tuple[str, Any]]:
        from anthropic import AnthropicError
        from httpx2 import HTTPError

        found = []
        try:
            for entry in self.client.messages.batches.results(batch.id):
                found.append((entry.custom_id, entry.result))
        except (AnthropicError, HTTPError) as error:
            raise JodaError(
                f"{self.store}: batch {batch.id} cannot be collected ({type(error).__name__}); run "
                "the same again."
            ) from None
        yield from found

    def _save(self, batches: tuple[_Batch, ...]) -> None:
        if batches:
            write_text(self.store, _Store(batches=batches).model_dump_json(indent=1) + "\n")
        else:
            self.store.unlink(missing_ok=True)


def why(result: Any) -> str:
    """Why a request in a batch gave no message, in one sentence."""
    if result.type == "expired":
        return "the batch expired before this was asked; ask again."
    if result.type == "canceled":
        return "the batch was cancelled before this was asked; ask again."
    found = getattr(getattr(result, "error", None), "error", None)
    detail = str(getattr(found, "message", "no reason given")).rstrip(".")
    return f"the service refuses the request ({detail})."


def _poll() -> float:
    text = os.environ.get("JODA_POLL_S") or str(POLL)
    try:
        return max(0.0, float(text))
    except ValueError:
        raise JodaError(f"JODA_POLL_S is '{text}'; give seconds, as 5.") from None


def _without(
    batches: Iterable[_Batch], number: str, collected: Iterable[str]
) -> tuple[_Batch, ...]:
    """The batches without what is collected of one; those with nothing left are left out."""
    gone = set(collected)
    kept = [
        _Batch(id=batch.id, requests=tuple(key for key in batch.requests if key not in gone))
        if batch.id == number
        else batch
        for batch in batches
    ]
    return tuple(batch for batch in kept if batch.requests)


def _split(requests: Mapping[str, Request]) -> Iterator[dict[str, Request]]:
    """Parts that a batch can hold."""
    part: dict[str, Request] = {}
    size = 0
    for key, asked in requests.items():
        more = len(json.dumps(asked)) + 200
        if part and (len(part) == MAX_REQUESTS or size + more > MAX_BYTES):
            yield part
            part, size = {}, 0
        part[key] = asked
        size += more
    if part:
        yield part
