"""The services that are asked: keys and addresses, and what is never told of them."""

import os
import re
from typing import Any
from urllib.parse import urlsplit

from joda.errors import JodaError
from joda.propose.redaction import without

SHORTEST_SECRET = 6
"""Letters; less is no secret but a word."""
MAX_TOKENS = 10**9
"""Of an answer."""


class Credentials:
    """What proves who asks; all of it is from the environment.

    Attributes:
        key: of the service; empty where there is none.
        base_url: its address; None: the service's own.
    """

    def __init__(self, service: str, base_url: str | None) -> None:
        """Reads the environment.

        Args:
            service: "ANTHROPIC" or "OPENAI", as the variables' names begin.
            base_url: its address; None: the environment's, or the service's own.

        Raises:
            JodaError: the key is no key, or the address cannot be used.
        """
        self.key = os.environ.get(f"{service}_API_KEY", "").strip()
        if not re.fullmatch("[!-~]*", self.key):
            raise JodaError(f"{service}_API_KEY holds characters that no key has; set it anew.")
        self.base_url = base_url or os.environ.get(f"{service}_BASE_URL", "").strip() or None
        if self.base_url:
            _check_address(self.base_url, service)
        headers = os.environ.get(f"{service}_CUSTOM_HEADERS", "").splitlines()
        values = [header.partition(":")[2].strip() for header in headers]
        values += [value.split()[-1] for value in values if value]  # without "Bearer"
        others = (os.environ.get(f"{service}_{name}", "") for name in ("AUTH_TOKEN", "ADMIN_KEY"))
        sent = {self.key, *others, *values}
        self._secrets = sorted((s for s in sent if len(s) >= SHORTEST_SECRET), key=len)[::-1]

    def hide(self, said: str) -> str:
        """What the service says, without the secrets that it may echo."""
        return without(said, self._secrets)


def host(client: Any) -> str:
    """The address of an SDK's client, without what a path or a query may hold."""
    return f"{client.base_url.scheme}://{client.base_url.netloc.decode()}"


def counted(*counts: Any) -> bool:
    """Whether all are sensible counts of tokens."""
    return all(type(count) is int and 0 <= count <= MAX_TOKENS for count in counts)


def _check_address(url: str, service: str) -> None:
    try:
        parts = urlsplit(url)
        usable = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        usable = False
    if usable and "@" in parts.netloc:
        raise JodaError(
            "the service's address holds a user name or a password, which logs would show; give "
            f"them in {service}_CUSTOM_HEADERS, as Authorization: Basic ..."
        )
    if not usable or not re.fullmatch("[!-~]+", url):
        raise JodaError(
            "the service's address (--base-url) is none; give one such as http://127.0.0.1:8000/v1"
        )
