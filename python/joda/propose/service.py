"""The service that is asked: its key and address, what it answers, and what is never told of it."""

import os
import re
from typing import TYPE_CHECKING, Any, TypeGuard
from urllib.parse import urlsplit

from joda.errors import JodaError

if TYPE_CHECKING:
    from anthropic import Anthropic as Client
    from anthropic.types import Message

SHORTEST_SECRET = 6
"""Letters; less is no secret but a word."""
MOST_TOKENS = 10**9
"""Of an answer."""


class Credentials:
    """What proves who asks.

    Attributes:
        key: of the service.
    """

    def __init__(self, base_url: str | None) -> None:
        """Reads the environment.

        Args:
            base_url: the service's address; None: ANTHROPIC_BASE_URL, or the usual one.

        Raises:
            JodaError: ANTHROPIC_API_KEY is missing or no key, or the address holds a password.
        """
        self.key = os.environ.get("ANTHROPIC_API_KEY", "").strip()
        if not self.key:
            raise JodaError(
                "ANTHROPIC_API_KEY is not set; set it to a key from platform.claude.com, or choose "
                "the proposer 'offline'."
            )
        if not re.fullmatch("[!-~]+", self.key):
            raise JodaError("ANTHROPIC_API_KEY holds characters that no key has; set it anew.")
        if "@" in urlsplit(base_url or os.environ.get("ANTHROPIC_BASE_URL", "")).netloc:
            raise JodaError(
                "ANTHROPIC_BASE_URL holds a user name or a password, which logs would show; give "
                "them in ANTHROPIC_CUSTOM_HEADERS, as Authorization: Basic ..."
            )
        headers = os.environ.get("ANTHROPIC_CUSTOM_HEADERS", "").splitlines()
        values = [header.partition(":")[2].strip() for header in headers]
        values += [value.split()[-1] for value in values if value]  # without "Bearer"
        sent = {self.key, os.environ.get("ANTHROPIC_AUTH_TOKEN", ""), *values}
        self._secrets = sorted((s for s in sent if len(s) >= SHORTEST_SECRET), key=len)[::-1]

    def hide(self, said: str) -> str:
        """What the service says, without the secrets that it may echo."""
        for secret in self._secrets:
            said = said.replace(secret, "[secret]")
        return said


def host(client: "Client") -> str:
    """The service's address, without what a path or a query may hold."""
    return f"{client.base_url.scheme}://{client.base_url.netloc.decode()}"


def usable(message: Any) -> "TypeGuard[Message]":
    """Whether an answer is a message with texts and sensible counts of tokens."""
    usage, content = getattr(message, "usage", None), getattr(message, "content", None)
    counts = [getattr(usage, name, None) for name in ("input_tokens", "output_tokens")]
    for name in ("cache_read_input_tokens", "cache_creation_input_tokens"):
        counts.append(getattr(usage, name, None) or 0)
    return (
        all(isinstance(count, int) and 0 <= count <= MOST_TOKENS for count in counts)
        and isinstance(content, list)
        and all(isinstance(part.text, str) for part in content if _kind(part) == "text")
    )


def _kind(part: Any) -> str | None:
    return getattr(part, "type", None)
