"""LeRobot datasets, versions 2 and 3: a folder with meta/info.json and Parquet files in data/."""

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from joda.errors import JodaError
from joda.files import read_json
from joda.importing.log import Array, Clock, Log, Recording, Role, Signal, Track, listed
from joda.importing.names import told
from joda.importing.units import checked
from joda.profile import describe

STATE, ACTION = "observation.state", "action"
FEATURES: dict[str, Role] = {
    STATE: "position",
    "observation.velocity": "velocity",
    ACTION: "ctrl",
}
"""What the numbers of a feature are where their names do not say otherwise."""
INFO = Path("meta/info.json")
INDEX, FRAME, STAMP = "episode_index", "frame_index", "timestamp"
CALIBRATED = ("rad", "deg", "-100..100")
"""Units of a robot's joints: info.json does not have them."""
MOST = 1e9
"""Numbers of episodes and frames are less."""
GRIPPERS = re.compile("gripper", re.IGNORECASE)
PERCENT = re.compile(r"(so100|so101|koch|moss|lekiwi)(_follower)?|so_follower", re.IGNORECASE)
"""Robots whose gripper LeRobot gives as 0..100 of its range, whatever the other joints are in."""


class Feature(BaseModel):
    """One feature of the dataset, as info.json describes it."""

    dtype: str = ""
    shape: list[int] = Field(default_factory=list)
    names: Any = None
    units: Any = None


class Info(BaseModel):
    """What is used of info.json."""

    codebase_version: str
    fps: float = Field(gt=0, allow_inf_nan=False)
    features: dict[str, Feature]
    robot_type: str | None = None
    total_episodes: int | None = None


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
    info = _info(path / INFO)
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
        feature: _signals(path / INFO, info, feature)
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


def _info(path: Path) -> Info:
    try:
        return Info.model_validate_json(read_json(path))
    except ValidationError as error:
        raise JodaError(f"{path}: {describe(error)}") from None


def _signals(path: Path, info: Info, feature: str) -> tuple[Signal, ...]:
    """The signals of a feature, in the order of its numbers."""
    described = info.features[feature]
    names = _names(path, feature, described)
    units = _units(path, feature, described.units, names)
    out = []
    for name, unit in zip(names, units, strict=True):
        role, of, by_name = told(name)
        role = role or (FEATURES[feature] if of == name or by_name else "")
        if feature == ACTION and role != "position":
            role = "ctrl" if role == "ctrl" else ""  # a velocity's command is no position's
        elif feature == ACTION:
            role = "ctrl"
        why, group = "info.json" if unit else "its name", "joints"
        may: tuple[str, ...] = (unit,) if unit else (by_name,) if by_name else CALIBRATED
        if not (unit or by_name) and GRIPPERS.search(name):
            group = f"{name}"
            may = ("0..100", *CALIBRATED, "0..1")
            if PERCENT.fullmatch(info.robot_type or ""):
                may, why = ("0..100",), f"LeRobot's {info.robot_type}"
        out.append(Signal(f"{feature}/{name}", name, role, of, may, why, group))
    return tuple(out)


def _names(path: Path, feature: str, described: Feature) -> list[str]:
    """A name for each number of a feature; the number's own number where there is none."""
    names, count = described.names, int(np.prod(described.shape)) if described.shape else 0
    if isinstance(names, dict) and names and all(isinstance(n, list) for n in names.values()):
        names = [name for some in names.values() for name in some]  # {"motors": [...]}
    elif isinstance(names, dict):
        names = list(names)
    if names is None and 0 < count <= 10_000:
        return [str(k) for k in range(count)]
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise JodaError(f"{path}: features.{feature}.names must be a list of names.")
    if len(names) != count:
        raise JodaError(
            f"{path}: features.{feature} has {len(names)} names and the shape {described.shape}; "
            "there must be a name for each number."
        )
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise JodaError(f"{path}: features.{feature}.names has '{twice}' twice.")
    return names


def _units(path: Path, feature: str, units: Any, names: Sequence[str]) -> list[str]:
    """The unit of each name, empty where info.json has none."""
    where = f"{path}: features.{feature}.units"
    if units is None:
        return [""] * len(names)
    if isinstance(units, str):
        units = [units] * len(names)
    if isinstance(units, dict):
        units = [units.get(name, "") for name in names]
    if not isinstance(units, list) or len(units) != len(names):
        raise JodaError(f"{where} must be a unit, or a list of one for each name.")
    if not all(isinstance(unit, str) for unit in units):
        raise JodaError(f"{where} must be texts, such as deg.")
    return [checked(unit, where) if unit else "" for unit in units]


def _recordings(
    files: Sequence[Path],
    signals: dict[str, tuple[Signal, ...]],
    info: Info,
    episodes: Collection[int],
    progress: Callable[[int, int, str], None],
) -> Iterator[Recording]:
    """The episodes of these files, in their order."""
    seen: dict[int, Path] = {}
    for done, file in enumerate(files):
        progress(done, len(files), file.name)
        own = re.fullmatch(r"episode_(\d+)", file.stem)
        if own and episodes and int(own[1]) not in episodes:
            continue
        columns, rows = _columns(file, signals)
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
    bad = np.flatnonzero(~((values >= 0) & (values < MOST)))
    if len(bad):
        raise JodaError(f"{file}, row {bad[0]}: {name} is {values[bad[0]]:g}, no number of one.")


def _columns(file: Path, signals: dict[str, tuple[Signal, ...]]) -> tuple[dict[str, Array], int]:
    """The columns that are used of a Parquet file, and its number of rows."""
    pyarrow, parquet = _pyarrow()
    try:
        with parquet.ParquetFile(file) as opened:
            there = set(opened.schema_arrow.names)
            wanted = [*signals, INDEX, FRAME, STAMP]
            table = opened.read(columns=[name for name in wanted if name in there])
    except (OSError, pyarrow.ArrowException) as error:
        told = str(error).partition("\n")[0].rstrip(".")
        raise JodaError(
            f"{file}: cannot be read as Parquet ({told}); fetch or write it anew."
        ) from None
    for feature in signals:
        if feature not in there:
            raise JodaError(f"{file}: no column '{feature}', which info.json has.")
    columns = {}
    for name in table.column_names:
        count = len(signals[name]) if name in signals else 0
        columns[name] = _numbers(file, name, table[name].combine_chunks(), count)
    return columns, table.num_rows


def _numbers(file: Path, name: str, column: Any, count: int) -> Array:
    """A column as numbers: of shape (n, count), or (n,) where `count` is 0."""
    pyarrow, _ = _pyarrow()
    types, rows = pyarrow.types, len(column)
    if isinstance(column, pyarrow.ChunkedArray):
        column = pyarrow.concat_arrays(column.chunks) if column.num_chunks else column
    kind = column.type
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        flat = column.flatten()
        each = len(flat) // rows if rows else count
        lengths = {len(flat) - each * rows, column.null_count}
        if rows and (lengths != {0} or not _even(column, each)):
            raise JodaError(f"{file}: column '{name}' has lists of several lengths.")
        column, kind, shape = flat, flat.type, (rows, each)
    else:
        shape = (rows, 1)
    if not (types.is_floating(kind) or types.is_integer(kind)):
        raise JodaError(f"{file}: column '{name}' has {kind}, not numbers.")
    if shape[1] != (count or 1):
        raise JodaError(
            f"{file}: column '{name}' has {shape[1]} numbers a row, and by info.json {count or 1}."
        )
    values = np.asarray(column.to_numpy(zero_copy_only=False), np.float64).reshape(shape)
    return values if count else values[:, 0]


def _even(column: Any, each: int) -> bool:
    """Whether all lists of a column have this length."""
    import pyarrow.compute as compute

    return bool(compute.all(compute.equal(compute.list_value_length(column), each)).as_py())


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError:
        raise JodaError('LeRobot datasets need pyarrow; run: pip install ".[import]"') from None
    return pyarrow, parquet
