"""What the command line prints; nothing else in it writes to a terminal, but for progress."""

import sys
from typing import Any

from joda.plain import line, one_line


def say(*lines: Any) -> None:
    """Prints texts, or what can be one, a line each: nothing in them acts on the terminal."""
    for what in lines:
        print(line(str(what)), flush=True)


def complain(sentence: str) -> None:
    """Prints what is wrong, in one line on stderr."""
    print(f"joda: {one_line(sentence)}", file=sys.stderr)
