"""Bags of ROS 2 (folders, .db3, MCAP) and ROS 1, read without ROS."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.importing.log import Array, Clock, Log, Recording, Role, Signal, Track, listed
from joda.importing.ros_messages import CONTROLLER, JOINTS, library_errors, opened
from joda.importing.units import MODEL

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
    with library_errors(path), opened(path) as (bag, deserialize):
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
