"""What is being done, on stderr while it is done; silent where stderr is no terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from joda.plain import one_line


@contextmanager
def spinner(task: str) -> Iterator[Callable[[str], None]]:
    """A spinner; yields what tells it the present stage."""
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda what: None
        return
    with console.status(task) as status:
        yield lambda what: status.update(Text(one_line(f"{task}: {what}")))


@contextmanager
def progress_bar() -> Iterator[Callable[[int, int, str], None]]:
    """A bar; yields what tells it how many are done, of how many, and what is next."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}", markup=False),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task("")
        yield lambda done, total, what: bar.update(
            task, completed=done, total=total, description=one_line(what)
        )


@contextmanager
def loss_bar() -> Iterator[Callable[[str, int, int, float], None]]:
    """A bar of iterations; yields what tells it stage, iteration, of how many, and RMS misfit."""
    with progress_bar() as bar:
        yield lambda stage, number, total, rms: bar(number, total, f"{stage}, RMS {rms:.3g}")
