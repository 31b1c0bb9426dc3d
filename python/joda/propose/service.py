"""The services that are asked: keys and addresses, and what is never told of them."""

import base64
import html
import json
import os
import re
from typing import Any
from urllib.parse import quote, unquote, urlsplit

import numpy as np

from joda.errors import JodaError

HIDDEN = "[secret]"
PART = 12
"""Successive characters of a secret that nothing else has by chance."""
SHORTEST_SECRET = 6
"""Letters; less is no secret but a word."""
MOST_TOKENS = 10**9
"""Of an answer."""
UNTOLD = "[an answer that repeats a secret, not shown]"
BYTE = re.compile(r"\\x([0-9A-Fa-f]{2})")
ESCAPED = re.compile(r"\\(?:u00([2-7][0-9A-Fa-f])|.)", re.DOTALL)
"""An escape of JSON, with the number of the character if it is one of ASCII's that are seen."""


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
        """What the service says, without the secrets that it may echo: whole or in part, plain or
        as JSON, URLs, HTML and Base64 write them.

        JSON stays JSON of the same meaning, but for the secrets. Where one is still there in
        another disguise, nothing of what was said is told.
        """
        said = ESCAPED.sub(_plainly, said)
        for secret in self._secrets:
            for form in _forms(secret):
                said = said.replace(form, HIDDEN)
            said = _without_parts(said, secret)
        return UNTOLD if any(_disguised(said, secret) for secret in self._secrets) else said


def _forms(secret: str) -> set[str]:
    """How a secret may be written."""
    coded = {base64.b64encode(f"{front}{secret}".encode()).decode() for front in ("", "Bearer ")}
    plain = {secret, json.dumps(secret)[1:-1], quote(secret, safe=""), html.escape(secret)}
    return plain | {form.rstrip("=") for form in coded}


def _without_parts(said: str, secret: str) -> str:
    """The same without parts of a secret, as of one that was cut off or broken into lines."""
    if json.dumps(secret)[1:-1] != secret:  # parts of escapes are none
        return said
    there = np.zeros(len(said), bool)
    for k in range(len(secret) - PART + 1):
        for found in re.finditer(re.escape(secret[k : k + PART]), said):
            there[slice(*found.span())] = True
    edges = np.flatnonzero(np.diff(there, prepend=False, append=False))
    for begin, end in zip(edges[::2][::-1], edges[1::2][::-1], strict=True):
        said = said[:begin] + HIDDEN + said[end:]
    return said


def _disguised(said: str, secret: str) -> bool:
    """Whether a secret can be told from letters and digits alone: spaced, upper-case, reversed, or
    in a usual code."""
    code = secret.encode()
    if len(_bare(secret)) < PART or secret.isalpha() or " " in secret:  # words may be anywhere
        return False
    texts = {_bare(text) for text in (said, unquote(said), html.unescape(said), _of_bytes(said))}
    spelled = [_bare(secret), _bare(secret)[::-1]]
    parts = {one[k : k + PART] for one in spelled for k in range(len(one) - PART + 1)}
    # of Base64 and Base32 what does not depend on the neighbours, at each place they can begin at
    parts |= {_bare(base64.b64encode(b"-" * k + code).decode()[4:-4]) for k in range(3)}
    parts |= {_bare(base64.b32encode(b"-" * k + code).decode()[8:-8]) for k in range(5)}
    parts |= {code.hex(), *("".join(f"{byte:{base}}" for byte in code) for base in "do")}
    coded = {base64.b85encode(code).decode(), base64.a85encode(code).decode()}
    return any(part in text for text in texts for part in parts) or any(c in said for c in coded)


def _bare(text: str) -> str:
    """Letters and digits alone, small."""
    return "".join(filter(str.isalnum, text)).lower()


def _of_bytes(text: str) -> str:
    """With escapes such as \\x73 as the characters they are."""
    return BYTE.sub(lambda found: chr(int(found[1], 16)), text)


def _plainly(escape: re.Match[str]) -> str:
    """A character that JSON need not escape as it is, any other in its shortest escape."""
    if not escape[1]:
        return "/" if escape[0] == r"\/" else escape[0]
    return json.dumps(chr(int(escape[1], 16)))[1:-1]


def host(client: Any) -> str:
    """The address of an SDK's client, without what a path or a query may hold."""
    return f"{client.base_url.scheme}://{client.base_url.netloc.decode()}"


def counted(*counts: Any) -> bool:
    """Whether all are sensible counts of tokens."""
    return all(type(count) is int and 0 <= count <= MOST_TOKENS for count in counts)


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
