"""The command line: each command is a Python function of the same name."""

import inspect
import io
import os
import re
import sys
from collections.abc import Callable
from typing import Annotated

import typer

from joda import __version__
from joda.cli import interrupt
from joda.cli.act import experiments, simulate, with_usual
from joda.cli.edit import studio
from joda.cli.logs import import_log
from joda.cli.make import attach, compile, demo, export, generate, revise, weigh
from joda.cli.many import distribute, evaluate
from joda.cli.measure import bench, compare, refine
from joda.cli.mend import add, diagnose, improve
from joda.cli.observe import context, plot, render
from joda.cli.reference import doctor, schema, templates
from joda.cli.say import complain, say
from joda.errors import JodaError
from joda.plugin import mujoco_version

__all__ = ["app", "main"]

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _tell_version(asked: bool) -> None:
    if asked:
        say(f"joda {__version__} with MuJoCo {mujoco_version()}")
        raise typer.Exit


@app.callback()
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


def _help(command: Callable[..., None]) -> str:
    """Its docstring; what is indented, the examples, stays in one line, to be copied."""
    return re.sub(r"\n\n(?=    )", "\n\n\b\n", inspect.cleandoc(command.__doc__ or ""))


for command in (
    demo, attach, compile, context, generate, revise, plot, simulate, import_log, compare,
    diagnose, add, improve, refine, render, experiments, studio, export, distribute, evaluate,
    bench, schema, templates, weigh, doctor,
):  # fmt: skip
    name = "import" if command is import_log else None  # Python has that word for itself
    app.command(name, help=_help(command))(command)


def main() -> None:
    """Runs the command line; a user's mistake is one sentence on stderr and exit status 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # what it cannot show is no reason to stop
            stream.reconfigure(errors="backslashreplace")
    interrupt.watch()
    try:
        _check_arguments()
        status = app(with_usual(sys.argv[1:]) or ["--help"], standalone_mode=False)
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
