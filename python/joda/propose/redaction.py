"""What a service says, without the secrets that it was sent: whole, in part, or in disguise.

A service can write a key in ways that nobody looks for (as words, say), so what it says is never
safe altogether; what copies, logs and mistakes make of a key is.
"""

import base64
import html
import json
import re
import unicodedata
from collections.abc import Callable, Iterator
from string import ascii_lowercase
from urllib.parse import quote, unquote

import numpy as np

HIDDEN = "[secret]"
WITHHELD = "[an answer that repeats a secret, not shown]"
TOO_LONG = "[an answer of more than two million characters, not shown]"
LONGEST = 2 * 10**6
"""Characters of an answer; none of use is longer."""
PART = 12
"""Successive characters of a secret that nothing else has by chance."""
PIECE, COVERED = 4, 0.7
"""Length of pieces, and how much of a secret they make up where it was taken apart."""
DEPTH = 3
"""Codes within codes that are undone."""
BASES = (2, 8, 10, 16)
"""In which the numbers of characters are written."""
SEEN = range(33, 127)
"""Numbers of the characters of secrets."""

ESCAPED = re.compile(r"\\(?:u00([2-7][0-9A-Fa-f])|.)", re.DOTALL)
"""An escape of JSON, with the number of the character if it is one of ASCII's that are seen."""
ESCAPE = re.compile(
    r"\\(?:u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|u\{([0-9A-Fa-f]{1,6})\}|x([0-9A-Fa-f]{2})|([0-7]{3})|(.))",
    re.DOTALL,
)
"""An escape of any language: four in base 16, one in base 8, or the character itself."""
NUMBER = re.compile(r"(?<![0-9A-Za-z])(?:0[xXoObB]|[xX])?([0-9A-Fa-f]{2,8})(?![0-9A-Za-z])")


def without(said: str, secrets: list[str]) -> str:
    """What is said, without secrets: plain or as JSON, URLs, HTML and Base64 write them, or parts.

    JSON stays JSON of the same meaning, but for the secrets. Where one is still there in a
    disguise that is looked for, nothing of what was said is told.

    Args:
        said: by a service that was sent them.
        secrets: the longest first.
    """
    if len(said) > LONGEST:
        return TOO_LONG
    said = ESCAPED.sub(_plainly, said)
    for secret in secrets:
        for form in _forms(secret):
            said = said.replace(form, HIDDEN)
        said = _without_parts(said, secret)
    return WITHHELD if any(_disguised(said, secret) for secret in secrets) else said


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
    """Whether a secret can be told from letters and digits alone: escaped, spaced, taken apart, in
    other cases or letters, reversed, in a usual code or a shifted alphabet."""
    code, bare = secret.encode(), _bare(secret)
    if len(bare) < PART or secret.isalpha() or " " in secret:  # words may be anywhere
        return False
    if any(
        one in said for one in (base64.b85encode(code).decode(), base64.a85encode(code).decode())
    ):
        return True
    parts = {one[k : k + PART] for one in (bare, bare[::-1]) for k in range(len(bare) - PART + 1)}
    # of Base64 and Base32 what does not depend on the neighbours, at each place they can begin at
    parts |= {_bare(base64.b64encode(b"-" * k + code).decode()[4:-4]) for k in range(3)}
    parts |= {_bare(base64.b32encode(b"-" * k + code).decode()[8:-8]) for k in range(5)}
    parts |= {code.hex(), *("".join(f"{byte:{base}}" for byte in code) for base in "do")}
    for text in _readings(said):
        pieces = {text[k : k + PIECE] for k in range(len(text))}
        if any(part in text for part in parts) or any(
            _covered(one, pieces) > COVERED for one in _shifted(bare)
        ):
            return True
    return False


def _readings(said: str) -> set[str]:
    """The letters and digits of a text, its escapes and codes undone."""
    texts = {said}
    for _ in range(DEPTH):
        texts |= {undo(text) for text in texts for undo in UNDONE}
    return {_bare(text) for text in texts}


def _unescaped(text: str) -> str:
    return ESCAPE.sub(_meant, text)


def _meant(escape: re.Match[str]) -> str:
    """The character that an escape stands for; nothing for what is no character."""
    *hexadecimal, octal, itself = escape.groups()
    if itself:
        return " " if itself in "nrtbf" else itself
    number = int(octal, 8) if octal else int(next(filter(None, hexadecimal)), 16)
    return chr(number) if number < 0x110000 else ""


def _of_numbers(base: int) -> Callable[[str], str]:
    """What makes characters of the numbers in a text."""

    def characters(text: str) -> str:
        found: list[int] = []
        for one in NUMBER.findall(text):
            try:
                found.append(int(one, base))
            except ValueError:
                continue
        return "".join(chr(number) for number in found if number in SEEN) or text

    return characters


UNDONE: tuple[Callable[[str], str], ...] = (
    unquote,
    html.unescape,
    _unescaped,
    *map(_of_numbers, BASES),
)
"""What undoes a way to write a text."""


def _shifted(bare: str) -> Iterator[str]:
    """A secret's letters and digits, either way, with every shift of the alphabet."""
    for k in range(len(ascii_lowercase)):
        table = str.maketrans(ascii_lowercase, ascii_lowercase[k:] + ascii_lowercase[:k])
        yield from (moved := bare.translate(table), moved[::-1])


def _covered(bare: str, pieces: set[str]) -> float:
    """How much of a secret a text's pieces make up, 0 to 1."""
    there = np.zeros(len(bare), bool)
    for k in range(len(bare) - PIECE + 1):
        if bare[k : k + PIECE] in pieces:
            there[k : k + PIECE] = True
    return float(there.mean())


def _bare(text: str) -> str:
    """Letters and digits alone, small, of whatever width, without accents."""
    return "".join(filter(str.isalnum, unicodedata.normalize("NFKD", text))).lower()


def _plainly(escape: re.Match[str]) -> str:
    """A character that JSON need not escape as it is, any other in its shortest escape."""
    if not escape[1]:
        return "/" if escape[0] == r"\/" else escape[0]
    return json.dumps(chr(int(escape[1], 16)))[1:-1]
