"""Text of unknown origin, made safe to show: on a terminal, in a page, a picture or a sentence.

A name in somebody else's file may hold what a terminal obeys (colours, links, the cursor), what
turns text around, or a megabyte. Nothing of that is obeyed here: it is shown as JSON writes it, so
that what is shown of JSON is the same JSON.
"""

import json
import re

UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters but for tab and line feed
    "\xad\u061c\u180e\u200b\u200e\u200f\u202a-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"  # formats
    "\u2028\u2029\ufffe\uffff\ud800-\udfff\U000e0000-\U000e007f]"
)
"""What is not seen but acts; U+200C and U+200D are left, because scripts need them."""

LONGEST = 2000
"""Most characters of a sentence; names of files and of what there is leave room for little more."""
END = 700
"""How many of them are its end, where the remedy is."""


def plain(text: str) -> str:
    """The text with what is not seen but acts as JSON escapes it, such as `\\u001b`.

    Line feeds and tabs stay.
    """
    return UNSEEN.sub(lambda match: json.dumps(match[0])[1:-1], text)


def line(text: str) -> str:
    """The same in one line: line feeds and tabs, which a name may hold, are escaped too."""
    return plain(text).replace("\n", "\\n").replace("\t", "\\t")


def one_line(text: str) -> str:
    """A sentence in one line of bounded length; what is left out is from the middle."""
    said = plain(text).replace("\n", " ").replace("\t", " ")
    if len(said) > LONGEST:
        said = f"{said[: LONGEST - END - 3]}...{said[-END:]}"
    return said
