"""The command line: each command is a Python function of the same name."""

import sys

import typer

from joda.cli.make import attach, compile, demo, generate, revise
from joda.cli.measure import bench, compare, refine
from joda.cli.mend import add, diagnose, improve
from joda.cli.observe import context, plot, render
from joda.cli.reference import schema, templates
from joda.errors import JodaError
from joda.plugin import load

__all__ = ["app", "main"]

app = typer.Typer(
    help="Joint dynamics for articulated objects in MuJoCo: latches, detents, friction, damping.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

for command in (
    demo, attach, compile, context, generate, revise, plot, compare, diagnose, add, improve,
    refine, render, bench, schema, templates,
):  # fmt: skip
    app.command()(command)


def main() -> None:
    """Runs the command line; a user's mistake is one sentence on stderr and exit status 2."""
    try:
        load()
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except JodaError as error:
        status = _fail(str(error))
    except (typer.Abort, KeyboardInterrupt):
        status = _fail("interrupted.", 130)
    except typer.TyperException as error:
        status = _fail(error.format_message().rstrip(".") + ". Try --help.")
    sys.exit(status if isinstance(status, int) else 0)


def _fail(message: str, status: int = 2) -> int:
    print(f"joda: {message}", file=sys.stderr)
    return status
