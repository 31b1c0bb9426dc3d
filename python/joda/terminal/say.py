"""What the command line prints; nothing else in it writes to a terminal, but for progress."""

import json
import os
import shlex
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from joda.plain import line, one_line


def say(*lines: Any) -> None:
    """Prints texts, or what can be one, a line each: nothing in them acts on the terminal."""
    for what in lines:
        print(line(str(what)), flush=True)


def complain(sentence: str) -> None:
    """Prints what is wrong, in one line on stderr."""
    print(f"joda: {one_line(sentence)}", file=sys.stderr)


def print_json(value: Any) -> None:
    """The value as indented JSON."""
    say(*json.dumps(value, indent=2, ensure_ascii=False).split("\n"))


def with_text_paths(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same for JSON, which has no paths."""
    return {key: str(v) if isinstance(v, Path) else v for key, v in values.items()}


def say_changes(changes: Sequence[str]) -> None:
    """A line per change, or that there is none."""
    for change in changes or ("Nothing changed.",):
        say(change)


def say_files(folder: Path, names: Iterable[str]) -> None:
    """The files of a folder that are worth naming."""
    say("Files:")
    for name in names:
        say(f"  {folder / name}")


def say_viewer(scene: Path) -> None:
    """How to look at a scene."""
    command = shlex.join([_python(), "-m", "mujoco.viewer", f"--mjcf={scene}"])
    say(f"See it move: {command}")


def _python() -> str:
    """How one types this Python: "python" where that is the one, as within an environment."""
    found, own = shutil.which("python"), sys.executable
    if found and os.path.dirname(found) == os.path.dirname(own) and os.path.samefile(found, own):
        return "python"
    return own
