"""The command line: its options, which command is meant, and how mistakes end."""

import ast
import inspect
import io
import os
import re
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer

from joda import COMMANDS, __version__
from joda.errors import JodaError
from joda.plugin import load, mujoco_version
from joda.terminal import interrupt
from joda.terminal.options import with_usual
from joda.terminal.say import complain, say

__all__ = ["app", "main"]


def app(chosen: str | None = None) -> typer.Typer:
    """The command line.

    Args:
        chosen: name of the command that is meant. It alone is loaded, and the others are names;
            without it none is, and each has what `joda --help` says of it.
    """
    own = typer.Typer(
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    own.callback()(_options)
    for name in COMMANDS:
        if name == chosen:
            command = _loaded(name)
            text = inspect.cleandoc(command.__doc__ or "")
        else:
            command, text = _nothing, "" if chosen else _docstring(name)
        # the examples, which are indented, stay in one line each, to be copied
        own.command(name, help=re.sub(r"\n\n(?=    )", "\n\n\b\n", text))(command)
    return own


def _module(name: str) -> str:
    """Where the command is."""
    return f"joda.commands.{'import_log' if name == 'import' else name}"


def _loaded(name: str) -> Callable[..., None]:
    """The command; the plugin is loaded before it."""
    if name != "doctor":  # which says what is wrong with the plugin
        load()
    command: Callable[..., None] = import_module(_module(name)).command
    return command


def _nothing() -> None:
    """In the place of a command that is not meant."""


def _docstring(name: str) -> str:
    """What the command does, from its file, which is not loaded."""
    spec = find_spec(_module(name))
    assert spec and spec.origin
    tree = ast.parse(Path(spec.origin).read_text("utf-8"))
    own = next(f for f in tree.body if isinstance(f, ast.FunctionDef) and f.name == "command")
    return ast.get_docstring(own) or ""


def _tell_version(asked: bool) -> None:
    if asked:
        say(f"joda {__version__} with MuJoCo {mujoco_version()}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_tell_version, is_eager=True, help="Say which joda this is."
        ),
    ] = False,
) -> None:
    """Joint dynamics for articulated objects in MuJoCo: latches, detents, friction, damping.

    Begin with

        joda demo -o out

    Each command's --help has an example; they run in the order of the README.
    """


def main() -> None:
    """Runs the command line; a user's mistake is one sentence on stderr and exit status 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # what it cannot show is no reason to stop
            stream.reconfigure(errors="backslashreplace")
    interrupt.watch()
    try:
        _check_arguments()
        status = _run(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # who reads what is printed has enough
        _silence()
        status = 1  # as typer ends where it notices first
    except (Exception, KeyboardInterrupt) as error:
        if not interrupt.seen():
            status = _explain(error)
    if interrupt.seen():
        status = _fail("interrupted.", interrupt.STATUS)
    sys.exit(status if isinstance(status, int) else 0)


def _run(arguments: list[str]) -> Any:
    """Runs what the command line's words ask for; returns the exit status, or None."""
    chosen = next((word for word in arguments[:1] if word in COMMANDS), None)
    return app(chosen)(with_usual(arguments) or ["--help"], standalone_mode=False)


def _check_arguments() -> None:
    """Raises JodaError for what is no text, such as a file's name in an old encoding."""
    for argument in sys.argv[1:]:
        try:
            argument.encode()
        except UnicodeEncodeError:
            raise JodaError(
                f"'{argument}' is not UTF-8; rename the file, or type the words anew."
            ) from None


def _explain(error: BaseException) -> int:
    """Says what the user's mistake is, and returns the exit status; raises what is none."""
    if isinstance(error, JodaError):
        return _fail(str(error))
    if isinstance(error, typer.TyperException):
        told = error.format_message().replace("Value error, ", "")  # as pydantic begins its own
        return _fail(told.rstrip(".") + ". Try --help.")
    if isinstance(error, OSError):
        where = error.filename or "what is printed"
        _silence()
        return _fail(f"{where}: cannot be written or read ({error.strerror}).")
    raise error


def _fail(message: str, status: int = 2) -> int:
    complain(message)
    return status


def _silence() -> None:
    """Nothing more is printed, not even when Python ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
