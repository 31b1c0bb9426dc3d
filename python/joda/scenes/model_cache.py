"""Models that are loaded once for many joints: a large scene's compilation takes longer than the
rest of what is done for one of its joints."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from uuid import uuid4

import mujoco

Loaded = tuple[mujoco.MjSpec, mujoco.MjModel]

KEPT = 2
"""So many models are kept, those asked for last: large ones take a hundred megabytes."""


@dataclass(frozen=True)
class Shelf:
    """Where models are kept that are asked for again.

    Attributes:
        below: the file, or the folder of the files, that are kept.
        name: no other shelf's, in any process.
        models: by path, those asked for last at the end.
    """

    below: Path
    name: str = field(default_factory=lambda: uuid4().hex)
    models: dict[Path, Loaded] = field(default_factory=dict)


_shelf: ContextVar[Shelf | None] = ContextVar("shelf", default=None)


@contextmanager
def loading_once(below: Path) -> Iterator[None]:
    """Within, a model is loaded once, though its files change; who changes it copies it before.

    Args:
        below: the file, or the folder of the files, that this is for.
    """
    token = _shelf.set(Shelf(below.resolve()))
    try:
        yield
    finally:
        _shelf.reset(token)


def shelf_name() -> str | None:
    """What tells another process that models are still the same; None where they may change."""
    shelf = _shelf.get()
    return shelf.name if shelf else None


def kept(path: Path, load: Callable[[Path], Loaded]) -> Loaded:
    """A file's model: of the shelf if it is there, else loaded, and kept if that is wanted."""
    shelf, place = _shelf.get(), path.resolve()
    if shelf is None or not place.is_relative_to(shelf.below):
        return load(path)
    found = shelf.models.pop(place, None) or load(path)
    shelf.models[place] = found
    for oldest in list(shelf.models)[:-KEPT]:
        del shelf.models[oldest]
    return found
