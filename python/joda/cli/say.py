"""What the command line prints; nothing else in it writes to a terminal, but for progress."""

import sys
from typing import Any

from joda.plain import one_line, plain


def say(what: Any) -> None:
    """Prints a text, or what can be one, at once: nothing in it acts on the terminal."""
    print(plain(str(what)), flush=True)


def complain(sentence: str) -> None:
    """Prints what is wrong, in one line on stderr."""
    print(f"joda: {one_line(sentence)}", file=sys.stderr)
