"""What names say: the concepts of `words.toml` in them, in whatever language or convention."""

import re
import tomllib
import unicodedata
from collections.abc import Iterable
from functools import cache, lru_cache
from importlib.resources import files
from typing import Literal

Group = Literal["part", "object"]
Concepts = frozenset[str]

_BREAK = re.compile(r"(?<=[a-z])(?=[A-Z])|[\W\d_]+")
_LONG, _MIDDLING = 5, 4
"""Letters from which a word counts anywhere in a name, and at its beginning or end."""


@cache
def _vocabulary() -> dict[Group, dict[str, tuple[str, ...]]]:
    text = (files("joda.propose") / "words.toml").read_text("utf-8")
    return {
        group: {concept: tuple(words) for concept, words in concepts.items()}  # type: ignore[misc]
        for group, concepts in tomllib.loads(text).items()
    }


@cache
def _meanings(group: Group) -> dict[str, str]:
    """The concept that each word speaks of; no two share one."""
    return {word: concept for concept, words in _vocabulary()[group].items() for word in words}


@cache
def _sayings() -> dict[Group, dict[str, re.Pattern[str]]]:
    """What a sentence calls each concept: a pattern for all its words at once."""
    return {
        group: {
            concept: re.compile(rf"(?<!to )\b(?:{'|'.join(map(re.escape, words))})s?\b")
            for concept, words in known.items()
        }
        for group, known in _vocabulary().items()
    }


def concepts(texts: Iterable[str], group: Group) -> Concepts:
    """The concepts that names speak of, such as "door" in "Kuehlschranktuer".

    Within a word the longest counts: a "Kuehlschrank" is no "Schrank", a "dishwasher" no "washer".

    Args:
        texts: names of joints, bodies, geoms, files.
        group: of parts or of objects.
    """
    names = [text for text in texts if text]
    words = {word for name in names for word in _words(name)}
    letters = "".join(names)
    meant = _meanings(group)
    told = [one for one in meant if not one.isascii() and one in letters]
    return frozenset(meant[one] for one in told).union(
        *(_concepts_of(word, group) for word in words)
    )


def said(description: str, group: Group) -> Concepts:
    """The concepts that a sentence names as things: what latches, or is to latch, is no latch."""
    text = description.lower()
    return frozenset(
        concept for concept, saying in _sayings()[group].items() if saying.search(text)
    )


@lru_cache(maxsize=10_000)  # a scene's names are asked for with each of its joints
def _concepts_of(word: str, group: Group) -> Concepts:
    meant = _meanings(group)
    parts = [one for one in meant if _tells(one, word)]
    longest = [one for one in parts if not any(one != other and one in other for other in parts)]
    return frozenset(meant[one] for one in longest)


def _words(name: str) -> list[str]:
    plain = unicodedata.normalize("NFKD", name.replace("ß", "ss"))
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    return [word.lower() for word in _BREAK.split(plain) if word]


def _tells(known: str, word: str) -> bool:
    if len(known) >= _LONG:
        return known in word
    if len(known) == _MIDDLING:
        return word.startswith(known) or word.endswith(known)
    return word in (known, f"{known}s")
