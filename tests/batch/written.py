"""Recordings that the libraries' own writers made, and point clouds in layouts that real drivers use."""

from pathlib import Path

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from builders_recognition import side_of_hull

KIND = "sensor_msgs/msg/PointCloud2"
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
XYZ = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
START_NS = 1_700_000_000_000_000_000


def packed(points: np.ndarray, ids: np.ndarray | None = None) -> np.ndarray:
    """Points as records x y z, and their ids in a field `track_id`."""
    dtype = XYZ if ids is None else np.dtype([*XYZ.descr, ("track_id", "<u4")])
    records = np.zeros(len(points), dtype)
    for axis, name in enumerate("xyz"):
        records[name] = points[:, axis]
    if ids is not None:
        records["track_id"] = ids
    return records


def cloud(records: np.ndarray, store=ROS2, *, stamp_ns: int = START_NS, height: int = 1, row_padding: int = 0):
    """A PointCloud2 of a structured array; its byte order is that of the array's x."""
    types = store.types
    width, step = len(records) // height, records.dtype.itemsize
    rows = records.reshape(height, width).view(np.uint8).reshape(height, width * step)
    data = np.pad(rows, ((0, 0), (0, row_padding))).reshape(-1)
    stamp = types["builtin_interfaces/msg/Time"](sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
    named = {"stamp": stamp, "frame_id": "lidar"} | ({"seq": 0} if store is ROS1 else {})
    fields = [
        types["sensor_msgs/msg/PointField"](name=name, offset=offset, datatype=DATATYPES[dtype.str[1:]], count=1)
        for name, (dtype, offset) in records.dtype.fields.items()
    ]
    return types[KIND](
        header=types["std_msgs/msg/Header"](**named),
        height=height,
        width=width,
        fields=fields,
        is_bigendian=records.dtype["x"].str[0] == ">",
        point_step=step,
        row_step=width * step + row_padding,
        data=data,
        is_dense=True,
    )


def write_bag(path: Path, clouds, topic: str = "/points", compression: str | None = None) -> Path:
    """A ROS 1 bag of clouds that were made with the store ROS1."""
    writer = Ros1Writer(path)
    if compression:
        writer.set_compression(Ros1Writer.CompressionFormat[compression])
    with writer:
        connection = writer.add_connection(topic, KIND, typestore=ROS1)
        for index, message in enumerate(clouds):
            writer.write(connection, START_NS + index, ROS1.serialize_ros1(message, KIND))
    return path


def write_ros2(folder: Path, clouds, topic: str = "/points", storage: str = "SQLITE3") -> Path:
    """A folder of a ROS 2 bag, of clouds that were made with the store ROS2."""
    with Ros2Writer(folder, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        connection = writer.add_connection(topic, KIND, typestore=ROS2)
        for index, message in enumerate(clouds):
            writer.write(connection, START_NS + index, ROS2.serialize_cdr(message, KIND))
    return folder


def write_mcap(path: Path, clouds, *, ros1: bool = False, topic: str = "/points", chunk: int = 2**20) -> Path:
    """An MCAP of either profile, in chunks of so many bytes; `clouds` may be a generator of any length."""
    store, kind = (ROS1, "sensor_msgs/PointCloud2") if ros1 else (ROS2, KIND)
    definition, _ = store.generate_msgdef(KIND, ros_version=1 if ros1 else 2)
    with path.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=chunk)
        writer.start(profile="ros1" if ros1 else "ros2")
        schema = writer.register_schema(kind, "ros1msg" if ros1 else "ros2msg", definition.encode())
        channel = writer.register_channel(topic, "ros1" if ros1 else "cdr", schema)
        for index, message in enumerate(clouds):
            data = bytes((store.serialize_ros1 if ros1 else store.serialize_cdr)(message, KIND))
            writer.add_message(channel, START_NS + index, data, START_NS + index)
        writer.finish()
    return path


def write_inputs(folder: Path, messages: int = 15, clusters: int = 10) -> Path:
    """A folder of a recording, of a file of clusters of which the fourth has too few points, and of no bag."""
    folder.mkdir()
    rng = np.random.default_rng(1)

    def hull() -> np.ndarray:
        place = (float(rng.uniform(30, 90)), float(rng.uniform(-30, 30)), -3.0)
        return side_of_hull(float(rng.uniform(-3, 3)), place)

    write_mcap(folder / "b.mcap", [cloud(packed(hull())) for _ in range(messages)], chunk=2000)
    hulls = [hull() for _ in range(clusters)]
    hulls[3] = hulls[3][:5]  # too few points
    np.savez(folder / "a.npz", points=np.concatenate(hulls), n=[len(points) for points in hulls])
    (folder / "c.bag").write_bytes(b"no bag")
    return folder
