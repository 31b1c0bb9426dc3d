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

MAX_MODELS = 2
"""So many models are kept, those asked for last: large ones take a hundred megabytes."""


@dataclass(frozen=True)
class ModelCache:
    """Where models are kept that are asked for again.

    Attributes:
        below: the file, or the folder of the files, that are kept.
        name: no other cache's, in any process.
        models: by path, those asked for last at the end.
    """

    below: Path
    name: str = field(default_factory=lambda: uuid4().hex)
    models: dict[Path, Loaded] = field(default_factory=dict)


_cache: ContextVar[ModelCache | None] = ContextVar("cache", default=None)


@contextmanager
def loading_once(below: Path) -> Iterator[None]:
    """Within, a model is loaded once, though its files change; who changes it copies it before.

    Args:
        below: the file, or the folder of the files, that this is for.
    """
    token = _cache.set(ModelCache(below.resolve()))
    try:
        yield
    finally:
        _cache.reset(token)


def cache_name() -> str | None:
    """What tells another process that models are still the same; None where they may change."""
    cache = _cache.get()
    return cache.name if cache else None


def cached(path: Path, load: Callable[[Path], Loaded]) -> Loaded:
    """A file's model: of the cache if it is there, else loaded, and kept if that is wanted."""
    cache, place = _cache.get(), path.resolve()
    if cache is None or not place.is_relative_to(cache.below):
        return load(path)
    found = cache.models.pop(place, None) or load(path)
    cache.models[place] = found
    for oldest in list(cache.models)[:-MAX_MODELS]:
        del cache.models[oldest]
    return found
