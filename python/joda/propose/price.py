"""What answers cost: the models' prices, a running tally, and an estimate beforehand."""

import base64
import json
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from joda.errors import JodaError
from joda.propose import Usage

Price = tuple[float, float, float]

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
CACHE_READ, CACHE_WRITE, CACHE_HOUR = 0.1, 1.25, 2.0
"""Multiples of the price: to read from the cache (where JODA_VLM_PRICE is given, which does not
say), to write into it for 5 minutes, and for an hour."""

TOKEN_PIXELS = 28
TOKEN_AREA = 750
CHARACTERS = 3.2
"""Per token of text, rather too few than too many."""


class Tokens(NamedTuple):
    """What an answer took.

    Attributes:
        fresh: input that no cache had to do with.
        output: reasoning included.
        read: input from the cache.
        write, write_hour: input written into it for 5 minutes, and for an hour.
    """

    fresh: int
    output: int
    read: int = 0
    write: int = 0
    write_hour: int = 0


@dataclass
class Tally:
    """What an answer has cost so far, and what the user should know of it."""

    price: Price | None
    usage: Usage = field(default_factory=Usage)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Begins at no dollars where the price is known."""
        self._grow(dollars=0.0 if self.price else None)

    def sent(self) -> None:
        """Counts a request, retries too."""
        self._grow(requests=self.usage.requests + 1)

    def pay(self, spent: Tokens | None, factor: float = 1.0) -> None:
        """Adds an answer's tokens, at `factor` times the price; None: nobody knows how many."""
        if spent is None:
            self.price = None
            self._grow(dollars=None)
            return
        before = self.usage
        if self.price:
            into, out, cached = self.price
            written = spent.write * CACHE_WRITE + spent.write_hour * CACHE_HOUR
            dollars = (spent.fresh + written) * into + spent.output * out + spent.read * cached
            self._grow(dollars=(before.dollars or 0.0) + factor * dollars / 1e6)
        write = spent.write + spent.write_hour
        self._grow(
            input_tokens=before.input_tokens + spent.fresh + spent.read + write,
            output_tokens=before.output_tokens + spent.output,
            cache_read_tokens=before.cache_read_tokens + spent.read,
            cache_write_tokens=before.cache_write_tokens + write,
        )

    def _grow(self, **values: float | None) -> None:
        self.usage = self.usage.model_copy(update=values)


def price(model: str) -> Price | None:
    """A model's price, None if not known; the environment's JODA_VLM_PRICE comes first.

    Raises:
        JodaError: JODA_VLM_PRICE cannot be read.
    """
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


def tokens(asked: Mapping[str, Any]) -> int:
    """An upper estimate of a request's input tokens, without asking the service."""
    texts, images = [json.dumps(asked.get("output_config", {}))], 0
    said = (block for message in asked["messages"] for block in message["content"])
    for block in (*asked["system"], *said):
        if block["type"] == "text":
            texts.append(block["text"])
        else:
            width, height = _size(base64.b64decode(block["source"]["data"]))
            patches = math.ceil(width / TOKEN_PIXELS) * math.ceil(height / TOKEN_PIXELS)
            images += max(patches, math.ceil(width * height / TOKEN_AREA))
    return images + math.ceil(sum(map(len, texts)) / CHARACTERS)


def _size(png: bytes) -> tuple[int, int]:
    """Width and height in pixels, from a PNG's header."""
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")
