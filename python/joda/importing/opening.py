"""Which format a log has, and reading it so."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from joda.errors import JodaError
from joda.importing.csv_file import read_csv
from joda.importing.lerobot import read_lerobot
from joda.importing.lerobot_info import INFO
from joda.importing.log import Log
from joda.importing.rosbag import read_bag

BAGS = (".mcap", ".db3", ".bag")
METADATA = "metadata.yaml"


def open_log(
    path: Path,
    wanted: Sequence[str],
    time: str,
    units: Mapping[str, str],
    episodes: Collection[int],
    topics: Collection[str],
    progress: Callable[[int, int, str], None],
) -> Log:
    """Reads a log: a LeRobot dataset, a ROS bag, or else a CSV.

    Args:
        path: file or folder.
        wanted, time, units: see `joda.importing.csv_file.read_csv`.
        episodes: see `joda.importing.lerobot.read_lerobot`.
        topics: see `joda.importing.rosbag.read_bag`.
        progress: told how far it is, of how far, and at what.

    Raises:
        JodaError: it is none of them or damaged, or an option belongs to another format.
    """
    if not path.exists():
        raise JodaError(f"{path}: no such file or folder.")
    dataset = path.is_dir() and (path / INFO).exists()
    bag = path.suffix.lower() in BAGS or (path.is_dir() and (path / METADATA).exists())
    if path.is_dir() and not dataset and not bag:
        raise JodaError(
            f"{path}: neither a LeRobot dataset, which has {INFO}, nor a ROS bag, which has "
            f"{METADATA}; give the folder that has it, or a file."
        )
    for given, option, fits, what in (
        (episodes, "--episode", dataset, "LeRobot datasets"),
        (topics, "--topic", bag and not dataset, "ROS bags"),
        (time, "--column time", not dataset and not bag, "CSV files"),
    ):
        if given and not fits:
            raise JodaError(f"{path}: {option} is of {what}; leave it out.")
    if dataset:
        return read_lerobot(path, episodes, progress)
    if bag:
        return read_bag(path, topics, progress)
    return read_csv(path, wanted, time, units)
