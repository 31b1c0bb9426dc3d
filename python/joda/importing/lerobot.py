"""LeRobot datasets, versions 2 and 3: a folder with meta/info.json and Parquet files in data/."""

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.importing.lerobot_info import FEATURES, INFO, STATE, Info, read_info, signals_of
from joda.importing.log import Array, Clock, Log, Recording, Signal, Track, listed
from joda.importing.parquet import read_columns

INDEX, FRAME, STAMP = "episode_index", "frame_index", "timestamp"
MAX_NUMBER = 1e9
"""Numbers of episodes and frames are less."""


def read_lerobot(
    path: Path, episodes: Collection[int], progress: Callable[[int, int, str], None]
) -> Log:
    """Reads a dataset.

    Args:
        path: its folder.
        episodes: numbers of those to read; none means all.
        progress: told how many files are read, of how many, and which is next.

    Raises:
        JodaError: it is no such dataset, a file is damaged, or an episode is not there.
    """
    info = read_info(path / INFO)
    version = re.match(r"v?([23])\.", info.codebase_version)
    if not version:
        raise JodaError(
            f"{path / INFO}: codebase_version is '{info.codebase_version}'; versions 2 and 3 are "
            "read, so convert the dataset with LeRobot."
        )
    if STATE not in info.features:
        raise JodaError(
            f"{path / INFO}: features has no '{STATE}', which has the positions; it has "
            f"{listed(info.features)}."
        )
    signals = {
        feature: signals_of(path / INFO, info, feature)
        for feature in FEATURES
        if feature in info.features
    }
    parts = "data/chunk-*/episode_*.parquet" if version[1] == "2" else "data/chunk-*/*.parquet"
    files = sorted(path.glob(parts))
    if not files:
        raise JodaError(f"{path}: no file {parts}; is the dataset whole?")
    recordings = list(_recordings(files, signals, info, episodes, progress))
    found = {int(one.name.rpartition("_")[2]) for one in recordings}
    if lacking := set(episodes) - found:
        raise JodaError(f"{path}: no episode {min(lacking)}.")
    if not recordings:
        raise JodaError(f"{path}: its files have no frames.")
    notes = []
    if not episodes and info.total_episodes not in (None, len(found)):
        notes.append(
            f"{path / INFO}: total_episodes is {info.total_episodes}, and {len(found)} are there."
        )
    flat = tuple(signal for some in signals.values() for signal in some)
    name = f"LeRobot {info.codebase_version}"
    return Log(path, name, flat, tuple(recordings), tuple(notes))


def _recordings(
    files: Sequence[Path],
    signals: dict[str, tuple[Signal, ...]],
    info: Info,
    episodes: Collection[int],
    progress: Callable[[int, int, str], None],
) -> Iterator[Recording]:
    """The episodes of these files, in their order."""
    counts = {feature: len(some) for feature, some in signals.items()}
    seen: dict[int, Path] = {}
    for done, file in enumerate(files):
        progress(done, len(files), file.name)
        own = re.fullmatch(r"episode_(\d+)", file.stem)
        if own and episodes and int(own[1]) not in episodes:
            continue
        columns, rows = read_columns(file, counts, (INDEX, FRAME, STAMP))
        if INDEX not in columns and not own:
            raise JodaError(f"{file}: no column '{INDEX}'.")
        index = columns[INDEX] if INDEX in columns else np.full(rows, float(own[1]) if own else 0.0)
        _check_counts(file, INDEX, index)
        for number in dict.fromkeys(index.astype(int).tolist()):
            if episodes and number not in episodes:
                continue
            if number in seen:
                raise JodaError(f"{file}: episode {number} is in {seen[number]} too.")
            seen[number] = file
            yield _episode(file, number, np.flatnonzero(index == number), columns, signals, info)
    progress(len(files), len(files), "")


def _episode(
    file: Path,
    number: int,
    rows: NDArray[np.intp],
    columns: dict[str, Array],
    signals: dict[str, tuple[Signal, ...]],
    info: Info,
) -> Recording:
    """One episode: its rows of the file's columns."""
    frames = columns[FRAME][rows] if FRAME in columns else np.arange(len(rows), dtype=float)
    time = columns[STAMP][rows] if STAMP in columns else frames / info.fps
    _check_counts(file, FRAME, frames)
    clock = Clock(time, f"{file}, episode {number}", "frame", frames.astype(np.intp))
    tracks = {
        signal.name: Track(clock, columns[feature][rows, k])
        for feature, some in signals.items()
        for k, signal in enumerate(some)
    }
    return Recording(f"episode_{number:06d}", tracks)


def _check_counts(file: Path, name: str, values: Array) -> None:
    """Raises JodaError for what is no number of an episode or a frame."""
    bad = np.flatnonzero(~((values >= 0) & (values < MAX_NUMBER)))
    if len(bad):
        raise JodaError(f"{file}, row {bad[0]}: {name} is {values[bad[0]]:g}, no number of one.")
