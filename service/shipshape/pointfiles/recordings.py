"""Recordings of ROS -> their PointCloud2 messages, one in memory at a time; needs the extra shipshape[batch].

.bag             ROS 1, chunks in lz4 or bz2 too
.db3             ROS 2, sqlite3; or its folder with metadata.yaml, split and compressed ones too
.mcap            either profile, ROS 1 or ROS 2; one that was never finished is read as far as it goes
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float32
from mcap.reader import NonSeekingReader
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.typesys import Stores, get_typestore

from shipshape.errors import FileError, InvalidInput
from shipshape.pointcloud2 import Layout, PointField, column, xyz_columns
from shipshape.pointfiles.clusters import Cluster, id_name, split_by_id
from shipshape.pointfiles.columns import cause, listed

POINT_CLOUDS = ("sensor_msgs/msg/PointCloud2", "sensor_msgs/PointCloud2")
METADATA = "metadata.yaml"  # makes a folder a recording of ROS 2
_RECORD_BYTES = 2**30  # of one record or chunk; a damaged length must not take all memory


@dataclass(frozen=True, slots=True)
class Message:
    """One message of a recording, or of a file the one that it is."""

    index: int  # counted from 0 over the messages that are read
    clusters: list[Cluster]
    share: float = 1.0  # of the input that was read when this one came
    topic: str = ""
    frame_id: str = ""
    stamp_ns: int | None = None  # of the message's header: since 1970 UTC
    error: str = ""  # why there are no clusters


class _Raw(NamedTuple):
    topic: str
    ros1: bool
    data: bytes
    share: float


def is_recording(path: Path) -> bool:
    """Whether `read_recording` is the one to read it."""
    return path.suffix.lower() in SUFFIXES or (path.is_dir() and (path / METADATA).is_file())


def read_recording(path: Path, topics: Collection[str], id_names: Collection[str]) -> Iterator[Message]:
    """The PointCloud2 messages of a recording in its order; a message that makes no sense carries the reason.

    Points that are not finite, or exactly at the origin, are directions without a return and are dropped.

    Args:
        path: The recording.
        topics: Those to read; none: all of PointCloud2.
        id_names: Names that a field of ids may have, the first that is there counts.

    Raises:
        FileError: No such topic, or damaged; what came before stays good.
    """
    try:
        for index, raw in enumerate(SUFFIXES.get(path.suffix.lower(), _read_ros2)(path, topics)):
            yield _message(index, raw, id_names)
    except FileError:
        raise
    except Exception as error:  # a damaged file makes the libraries fail in ways of every kind
        raise FileError(f"expected {path.name} to be a complete recording, got: {cause(error)}") from error


def _read_ros1(path: Path, topics: Collection[str]) -> Iterator[_Raw]:
    with Ros1Reader(path) as reader:
        yield from _read_indexed(reader, path, topics, ros1=True)


def _read_ros2(path: Path, topics: Collection[str]) -> Iterator[_Raw]:
    with Ros2Reader(path) as reader:
        yield from _read_indexed(reader, path, topics, ros1=False)


def _read_indexed(reader: Any, path: Path, topics: Collection[str], *, ros1: bool) -> Iterator[_Raw]:
    kinds = {connection.topic: connection.msgtype for connection in reader.connections}
    wanted = _wanted(kinds, topics)
    _check_found(wanted, kinds, path.name)
    connections = [connection for connection in reader.connections if connection.topic in wanted]
    total = sum(connection.msgcount for connection in connections)
    for count, (connection, _, data) in enumerate(reader.messages(connections), 1):
        yield _Raw(connection.topic, ros1, data, min(1.0, count / max(total, 1)))


def _read_mcap(path: Path, topics: Collection[str]) -> Iterator[_Raw]:
    kinds: dict[str, str] = {}
    size = path.stat().st_size
    with path.open("rb") as stream:
        reader = NonSeekingReader(stream, validate_crcs=True, record_size_limit=_RECORD_BYTES)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            kind = kinds.setdefault(channel.topic, "" if schema is None else schema.name)
            if channel.topic in _wanted({channel.topic: kind}, topics):
                yield _Raw(channel.topic, channel.message_encoding == "ros1", message.data, stream.tell() / size)
    _check_found(_wanted(kinds, topics), kinds, path.name)


SUFFIXES: Mapping[str, Callable[[Path, Collection[str]], Iterator[_Raw]]] = {
    ".bag": _read_ros1,
    ".db3": _read_ros2,
    ".mcap": _read_mcap,
}


def _wanted(kinds: Mapping[str, str], topics: Collection[str]) -> set[str]:
    return {topic for topic, kind in kinds.items() if kind in POINT_CLOUDS and (not topics or topic in topics)}


def _check_found(wanted: set[str], kinds: Mapping[str, str], what: str) -> None:
    if not wanted:
        there = listed([f"{topic} ({kind})" for topic, kind in kinds.items()], most=4, longest=80)
        raise FileError(f"expected a topic of {POINT_CLOUDS[0]} to read in {what}, got {there}")


def _message(index: int, raw: _Raw, id_names: Collection[str]) -> Message:
    try:
        store = _store(raw.ros1)
        message: Any = (store.deserialize_ros1 if raw.ros1 else store.deserialize_cdr)(raw.data, POINT_CLOUDS[0])
    except Exception as error:  # bytes of any kind
        return Message(index, [], raw.share, raw.topic, error=f"expected a PointCloud2, got: {cause(error)}")
    header = message.header
    about = (raw.share, raw.topic, header.frame_id, header.stamp.sec * 10**9 + header.stamp.nanosec)
    try:
        return Message(index, _clusters(message, id_names), *about)
    except (InvalidInput, FileError, KeyError) as error:
        sentence = f"expected datatypes of 1 to 8, got {error}" if isinstance(error, KeyError) else str(error)
        return Message(index, [], *about, error=sentence)


@cache
def _store(ros1: bool) -> Any:
    """The definition of the message itself has not changed since; ROS 1 has one number more in its header."""
    return get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)


def _clusters(message: Any, id_names: Collection[str]) -> list[Cluster]:
    layout = Layout(
        fields=[PointField(field.name, field.offset, field.datatype, field.count) for field in message.fields],
        width=message.width,
        height=message.height,
        point_step=message.point_step,
        row_step=message.row_step,
        is_bigendian=bool(message.is_bigendian),
    )
    points = _as_float32(xyz_columns(message.data, layout))
    there = np.isfinite(points).all(axis=1) & points.any(axis=1)
    fields = {field.name: field for field in layout.fields}
    named = id_name(fields, id_names)
    ids = None if named is None else column(message.data, layout, fields[named])[there]
    return split_by_id(points[there], ids, "the message")


def _as_float32(columns: list[np.ndarray]) -> Float32[np.ndarray, "n 3"]:
    with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinite, and is dropped
        return np.column_stack(columns).astype(np.float32)
