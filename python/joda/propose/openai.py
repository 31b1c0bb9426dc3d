"""Asks any server that speaks the chat API of OpenAI: OpenAI's own, vLLM, Ollama, llama.cpp, ...

Servers differ. One that takes no JSON Schema (`response_format`) is asked for JSON in plain words;
one that knows no `max_tokens` is given its newer name. The package `openai` is imported when it is
first needed.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from joda.errors import JodaError
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
    refused,
)
from joda.propose.price import Tally, Tokens
from joda.propose.replies import PLAINLY, bare
from joda.propose.service import Credentials, counted, host

if TYPE_CHECKING:
    from openai import APIError, APIStatusError
    from openai import OpenAI as Client

UNSENT = "none"
"""For a key where there is none: the package asks for one, servers of one's own do not."""
REFUSALS = (400, 415, 422)
"""Status of servers that do not take a request as it is."""
FORMAT = re.compile("schema|grammar|response_format|structured|json", re.IGNORECASE)
TOO_MUCH = re.compile(
    "max_tokens|max_completion_tokens|context (?:length|size|window)", re.IGNORECASE
)


@dataclass(frozen=True)
class Manner:
    """How a server is asked.

    Attributes:
        schema: whether it holds the answer to a JSON Schema; else that is asked in words.
        room: what the most tokens of an answer are called; empty: that is left to the server.
    """

    schema: bool = True
    room: str = "max_tokens"


class OpenAI(VisionModel):
    """Proposes by asking a model behind a chat API.

    Args:
        model: its name; by default the environment's JODA_VLM.
        base_url: the server's address, as http://127.0.0.1:8000/v1; by default OPENAI_BASE_URL, or
            OpenAI's.
        effort: how much to put into an answer; by default the model's own.
        timeout: of one request, in seconds.

    Raises:
        JodaError: the package `openai` or the model's name is missing, the key or the address
            cannot be used, or JODA_VLM_PRICE cannot be read.
    """

    service = "openai"

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
            import openai  # noqa: F401
        except ImportError:
            raise JodaError(
                'asking an OpenAI-compatible server needs the package openai: pip install ".[vlm]".'
            ) from None
        self._credentials = Credentials("OPENAI", base_url)
        if not (self._credentials.key or self._credentials.base_url):
            raise JodaError(
                "OPENAI_API_KEY is not set; set it to a key, or give the address of a server of "
                "your own with --base-url."
            )
        name = chosen(model)
        if not name:
            raise JodaError(
                "openai needs the name of a model; give it with --vlm or in JODA_VLM (GET /models "
                "of the server lists those that it has)."
            )
        super().__init__(name)
        self._effort, self._timeout = effort, timeout
        self._manner = Manner()

    @contextmanager
    def sending(self) -> Iterator[Send]:
        """See `VisionModel`."""
        yield self._send

    def _client(self, tally: Tally) -> "Client":
        """It counts what it sends, retries too."""
        from openai import DefaultHttpxClient
        from openai import OpenAI as Client

        return Client(
            http_client=DefaultHttpxClient(event_hooks={"request": [lambda request: tally.sent()]}),
            api_key=self._credentials.key or UNSENT,
            base_url=self._credentials.base_url,
            max_retries=MAX_RETRIES,
            timeout=self._timeout,
        )

    def _send(self, asked: Request, tally: Tally) -> Reply:
        """The reply; what the server cannot do is left out, and from then on remembered."""
        from openai import APIError, APIStatusError

        manner = self._manner
        with self._client(tally) as client:
            try:
                while True:
                    try:
                        reply = self._create(client, tally, asked, manner)
                    except APIStatusError as error:
                        other = _adapted(manner, error.status_code, _reason(error))
                        if other == manner:
                            raise
                        manner = other
                    else:
                        self._manner = manner
                        return reply
            except APIError as error:
                raise ProposalFailed(self._sentence(error, client), tally.usage) from None
            except KeyboardInterrupt:
                raise ProposalInterrupted(tally.usage) from None

    def _create(self, client: "Client", tally: Tally, asked: Request, manner: Manner) -> Reply:
        effort: dict[str, Any] = {"reasoning_effort": self._effort} if self._effort else {}
        try:
            answer: Any = client.chat.completions.create(**translated(asked, manner), **effort)
        except (ValueError, RecursionError):  # JSON that is cut off, or brackets too deep
            answer = None
        choice = next(iter(_list(getattr(answer, "choices", None))), None)
        said = getattr(choice, "message", None)
        if said is None:  # a web page, say
            told = "does not answer as the chat API does; check --base-url, it mostly ends in /v1."
            raise ProposalFailed(f"{host(client)} {told}", tally.usage)
        tally.pay(_tokens(getattr(answer, "usage", None)))
        text = self._credentials.hide(bare(_text(getattr(said, "content", None))))
        refusal = getattr(said, "refusal", None)
        end = getattr(choice, "finish_reason", None)
        if refusal or end == "content_filter":
            return Reply(text, "declined", self._credentials.hide(str(refusal or "")))
        return Reply(text, "cut" if end == "length" else "whole")

    def _sentence(self, error: "APIError", client: "Client") -> str:
        """What is wrong and what to do, in one sentence."""
        import openai

        if isinstance(error, openai.APITimeoutError):
            return f"{host(client)} does not answer within {self._timeout:g} s; try again later."
        if not isinstance(error, openai.APIStatusError):
            said = "cannot be reached, or breaks off; start the server, or check --base-url."
            return f"{host(client)} {said}"
        advice = {
            401: "set OPENAI_API_KEY to a valid key",
            404: f"check --base-url, which mostly ends in /v1, and the model '{self.model}'",
        }
        reason = self._credentials.hide(_reason(error))
        return refused(self.model, error.status_code, reason, advice)


def translated(asked: Request, manner: Manner) -> Request:
    """A request of the Messages API as one of the chat API.

    Args:
        asked: as `joda.propose.prompt.request` makes it.
        manner: what the server can do.

    Returns:
        keyword arguments of `client.chat.completions.create`.
    """
    held = asked["output_config"]["format"]["schema"]
    system = "\n".join(block["text"] for block in asked["system"])
    out: Request = {"model": asked["model"]}
    if manner.schema:
        form = {"name": "answer", "strict": True, "schema": held}
        out["response_format"] = {"type": "json_schema", "json_schema": form}
    else:
        system += "\n" + PLAINLY + json.dumps(held)
    if manner.room:
        out[manner.room] = asked["max_tokens"]
    said = [
        {"role": each["role"], "content": _content(each["content"])} for each in asked["messages"]
    ]
    return {**out, "messages": [{"role": "system", "content": system}, *said]}


def _content(blocks: Sequence[Request]) -> str | list[Request]:
    """A text where there are no pictures, which every server takes."""
    if all(block["type"] == "text" for block in blocks):
        return "\n\n".join(block["text"] for block in blocks)
    return [
        {"type": "text", "text": block["text"]}
        if block["type"] == "text"
        else {"type": "image_url", "image_url": {"url": _data_url(block["source"])}}
        for block in blocks
    ]


def _data_url(source: Mapping[str, str]) -> str:
    return f"data:{source['media_type']};base64,{source['data']}"


def _adapted(manner: Manner, status: int, reason: str) -> Manner:
    """How else to ask after a refusal; the same if that would not help."""
    if status in REFUSALS and manner.room == "max_tokens" and "max_completion_tokens" in reason:
        return replace(manner, room="max_completion_tokens")
    if status in REFUSALS and manner.room and TOO_MUCH.search(reason):
        return replace(manner, room="")
    about = status in REFUSALS or (status >= 500 and FORMAT.search(reason))
    return replace(manner, schema=False) if about and manner.schema else manner


def _reason(error: "APIStatusError") -> str:
    """The server's words, wherever it puts them."""
    body = error.body
    if isinstance(body, dict):
        body = next((body[key] for key in ("message", "detail", "error") if body.get(key)), "")
    return str(body or "")


def _tokens(used: Any) -> Tokens | None:
    """None where the server does not count them, or not in earnest."""
    details = getattr(used, "prompt_tokens_details", None)
    read = getattr(details, "cached_tokens", None) or 0
    prompt: Any = getattr(used, "prompt_tokens", None)
    output: Any = getattr(used, "completion_tokens", None)
    if not counted(prompt, output, read) or read > prompt:
        return None
    return Tokens(prompt - read, output, read)


def _text(content: Any) -> str:
    """A message's text, which some servers give in parts."""
    if isinstance(content, str):
        return content
    parts = (part.get("text") for part in _list(content) if isinstance(part, dict))
    return "".join(part for part in parts if isinstance(part, str))


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
