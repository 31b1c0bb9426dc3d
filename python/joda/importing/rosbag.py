"""Bags of ROS 2 (folders, .db3, MCAP) and ROS 1, read without ROS."""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.importing.log import Array, Clock, Log, Recording, Role, Signal, Track, listed
from joda.importing.units import MODEL

JOINTS, CONTROLLER = "sensor_msgs/msg/JointState", "control_msgs/msg/JointTrajectoryControllerState"
FIELDS: dict[str, tuple[tuple[str, str, Role], ...]] = {
    JOINTS: (
        ("position", "position", "position"),
        ("velocity", "velocity", "velocity"),
        ("effort", "effort", ""),
    ),
    CONTROLLER: (
        ("feedback.positions", "feedback", "position"),
        ("actual.positions", "actual", "position"),
        ("feedback.velocities", "feedback_velocity", "velocity"),
        ("actual.velocities", "actual_velocity", "velocity"),
        ("reference.positions", "reference", "ctrl"),
        ("desired.positions", "desired", "ctrl"),
        ("output.positions", "output", ""),
    ),
}
"""Of each message: the place of its numbers, how they are called here, and what they are."""
OLDER = {"actual": "feedback", "actual_velocity": "feedback_velocity", "desired": "reference"}
"""Names of the same in older messages; some have both."""
POINT = "trajectory_msgs/JointTrajectoryPoint"
MULTI = "trajectory_msgs/MultiDOFJointTrajectoryPoint"
PLACES = ("reference", "feedback", "error", "output", "desired", "actual")
HUMBLE = "std_msgs/Header header\nstring[] joint_names\n" + "".join(
    [f"{POINT} {name}\n" for name in PLACES]
    + ["string[] multi_dof_joint_names\n"]
    + [f"{MULTI} multi_dof_{name}\n" for name in PLACES]
)
FIRST = "std_msgs/Header header\nstring[] joint_names\n" + "".join(
    f"{POINT} {name}\n" for name in ("desired", "actual", "error")
)
"""The controller's message in bags that do not have its definition, as those of Humble."""


@dataclass
class Stream:
    """What one topic tells of the same joints, message by message."""

    times: list[int] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)
    values: dict[str, list[Array]] = field(default_factory=dict)
    unstamped: bool = False


def read_bag(path: Path, topics: Collection[str], progress: Callable[[int, int, str], None]) -> Log:
    """Reads the joints of a bag.

    Args:
        path: a folder with metadata.yaml, or a file: .mcap, .db3, or .bag of ROS 1.
        topics: to read; none means all with a message that is read.
        progress: told how many messages are read, of how many, and of which topic.

    Raises:
        JodaError: it is no bag or damaged, rosbags is not installed, or none of its messages is
            read.
    """
    with _library_errors(path), _opened(path) as (bag, deserialize):
        read = [one for one in bag.connections if one.msgtype in FIELDS]
        there = {one.topic: one.msgtype for one in bag.connections}
        if unknown := next((one for one in topics if one not in there), None):
            raise JodaError(f"{path}: no topic '{unknown}'; it has {listed(sorted(there))}.")
        chosen = [one for one in read if not topics or one.topic in topics]
        if not chosen:
            kinds = listed(f"{topic} ({kind})" for topic, kind in sorted(there.items()))
            raise JodaError(f"{path}: no messages of {JOINTS} or {CONTROLLER}; it has {kinds}.")
        streams: dict[tuple[str, tuple[str, ...]], Stream] = {}
        total, counts = sum(one.msgcount or 0 for one in chosen), dict.fromkeys(there, 0)
        for done, (connection, stamp, raw) in enumerate(bag.messages(chosen)):
            if done % 500 == 0:
                progress(done, max(total, done), connection.topic)
            message = deserialize(raw, connection.msgtype)
            place = f"{path}, {connection.topic}, message {counts[connection.topic]}"
            _take(streams, connection, stamp, message, counts[connection.topic], place)
            counts[connection.topic] += 1
        progress(total, total, "")
    return _log(path, streams, len({topic for topic, _ in streams}) > 1)


def _take(
    streams: dict[tuple[str, tuple[str, ...]], Stream],
    connection: Any,
    stamp: int,
    message: Any,
    number: int,
    place: str,
) -> None:
    """Adds one message to the stream of its topic and joints."""
    joints = tuple(message.name if connection.msgtype == JOINTS else message.joint_names)
    if not joints:
        return
    if len(set(joints)) != len(joints):
        raise JodaError(f"{place}: has a joint twice among {listed(joints)}.")
    stream = streams.setdefault((connection.topic, joints), Stream())
    time = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    stream.unstamped = stream.unstamped or not time
    found: dict[str, Array] = {}
    for address, name, _ in FIELDS[connection.msgtype]:
        values: Any = message
        for part in address.split("."):
            values = getattr(values, part, None)
        if values is None or not len(values):
            continue
        if len(values) != len(joints):
            raise JodaError(
                f"{place}: {address} has {len(values)} numbers for {len(joints)} joints."
            )
        found.setdefault(OLDER.get(name, name), np.array(values, np.float64))
    time = time or stamp
    again = bool(stream.times) and stream.times[-1] == time
    if again and all(np.array_equal(stream.values[n][-1], v) for n, v in found.items()):
        return  # published twice
    for name, values in found.items():
        own = stream.values.setdefault(name, [])
        own += [np.full(len(joints), np.nan)] * (len(stream.times) - len(own))
        own.append(values)
    for name in stream.values.keys() - found.keys():
        stream.values[name].append(np.full(len(joints), np.nan))
    stream.times.append(time)
    stream.numbers.append(number)


def _log(path: Path, streams: dict[tuple[str, tuple[str, ...]], Stream], several: bool) -> Log:
    """The streams as one recording with times from one origin."""
    if not any(stream.times for stream in streams.values()):
        raise JodaError(f"{path}: its messages name no joints.")
    origin = min(min(stream.times) for stream in streams.values() if stream.times)
    roles: dict[str, Role] = {
        OLDER.get(name, name): role for some in FIELDS.values() for _, name, role in some
    }
    signals, tracks, notes = [], {}, []
    for (topic, joints), stream in streams.items():
        if stream.unstamped:
            notes.append(
                f"{path}, {topic}: the messages have no stamps, so the recorder's times are taken, "
                "which have the network's delay."
            )
        clock = _clock(f"{path}, {topic}", stream, origin)
        for name, rows in stream.values.items():
            values = np.array(rows)
            for k, joint in enumerate(joints):
                if np.isnan(values[:, k]).all():
                    continue  # as drivers fill what they do not know
                short = f"{joint}.{name}"
                whole = f"{topic}:{short}"
                if whole in tracks:
                    raise JodaError(
                        f"{path}, {topic}: '{joint}' comes with other joints beside it from "
                        "message to message; record one publisher's topic."
                    )
                units = (MODEL,) if roles[name] in ("position", "velocity", "ctrl") else ()
                signals.append(
                    Signal(whole, short, roles[name], joint, units, "ROS has rad and m", topic)
                )
                tracks[whole] = Track(clock, values[:, k])
    name = path.stem if path.is_file() else path.resolve().name
    return Log(path, "ROS bag", tuple(signals), (Recording(name, tracks),), tuple(notes))


def _clock(place: str, stream: Stream, origin: int) -> Clock:
    time: NDArray[np.float64] = np.array([t - origin for t in stream.times], np.float64) * 1e-9
    return Clock(time, place, "message", np.array(stream.numbers, np.intp))


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Callable[[bytes, str], Any]]]:
    """The opened bag, and what makes messages of its bytes."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    stores = []
    for text in (HUMBLE, FIRST):
        store = get_typestore(Stores.ROS2_HUMBLE)
        if CONTROLLER not in store.fielddefs:
            store.register(get_types_from_msg(text, CONTROLLER))
        stores.append(store)
    with AnyReader([path], default_typestore=stores[0]) as bag:
        told = any(one.msgdef.data for one in bag.connections if one.msgtype == CONTROLLER)

        def deserialize(raw: bytes, kind: str) -> Any:
            if kind != CONTROLLER or told or not bag.is2:
                return bag.deserialize(raw, kind)
            try:
                return stores[0].deserialize_cdr(raw, kind)
            except Exception:  # the message has another form
                return stores[1].deserialize_cdr(raw, kind)

        yield bag, deserialize


@contextmanager
def _library_errors(path: Path) -> Iterator[None]:
    """What rosbags and the libraries below it raise of a damaged bag, which may be anything."""
    try:
        yield
    except JodaError:
        raise
    except ImportError:
        raise JodaError('ROS bags need rosbags; run: pip install ".[import]"') from None
    except Exception as error:
        told = str(error).partition("\n")[0].rstrip(".") or type(error).__name__
        raise JodaError(
            f"{path}: cannot be read as a ROS bag ({told}); record or convert it anew."
        ) from None
