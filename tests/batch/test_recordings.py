from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from batch.written import ROS1, ROS2, START_NS, cloud, packed, write_bag, write_mcap, write_ros2
from shipshape.errors import FileError
from shipshape.pointfiles.clusters import ID_NAMES
from shipshape.pointfiles.recordings import read_recording

LIDAR = Path(__file__).parents[3] / "shared" / "data" / "lidar"
needs_lidar = pytest.mark.skipif(
    not LIDAR.is_dir(), reason="the real scans beside the checkout (../shared/data) are absent"
)
POINTS = np.array([[30, 1, 0.5], [31.25, -2, 1], [32, 0, 2], [40, 8, 1]], np.float32)


def read(path: Path, topics=()):
    return list(read_recording(path, topics, ID_NAMES))


def points_of(message) -> np.ndarray:
    (cluster,) = message.clusters
    return cluster.points_level


@pytest.mark.parametrize(
    ("store", "write"),
    [
        (ROS1, lambda folder, clouds: write_bag(folder / "a.bag", clouds)),
        (ROS1, lambda folder, clouds: write_bag(folder / "a.bag", clouds, compression="LZ4")),
        (ROS1, lambda folder, clouds: write_bag(folder / "a.bag", clouds, compression="BZ2")),
        (ROS1, lambda folder, clouds: write_mcap(folder / "a.mcap", clouds, ros1=True)),
        (ROS2, lambda folder, clouds: write_mcap(folder / "a.mcap", clouds)),
        (ROS2, lambda folder, clouds: write_ros2(folder / "a", clouds)),
        (ROS2, lambda folder, clouds: next(write_ros2(folder / "a", clouds).glob("*.db3"))),
        (ROS2, lambda folder, clouds: write_ros2(folder / "a", clouds, storage="MCAP")),
    ],
    ids=["bag", "bag lz4", "bag bz2", "mcap of ROS 1", "mcap of ROS 2", "sqlite3", "bare db3", "folder of mcap"],
)
def test_every_kind_of_recording_gives_back_the_clouds(tmp_path, store, write):
    clouds = [cloud(packed(POINTS + step), store, stamp_ns=START_NS + step) for step in range(3)]
    messages = read(write(tmp_path, clouds))
    assert [message.index for message in messages] == [0, 1, 2]
    assert [message.stamp_ns for message in messages] == [START_NS, START_NS + 1, START_NS + 2]
    assert {(message.topic, message.frame_id, message.error) for message in messages} == {("/points", "lidar", "")}
    for step, message in enumerate(messages):
        np.testing.assert_array_equal(points_of(message), POINTS + step)


@st.composite
def layouts(draw):
    """Records with x, y and z anywhere among other fields, of either byte order, with gaps between."""
    order, size = draw(st.sampled_from("<>")), draw(st.sampled_from(["f4", "f8"]))
    others = draw(st.lists(st.sampled_from(["u1", "u2", "i4", "f4"]), max_size=4))
    fields = [(axis, order + size) for axis in "xyz"]
    fields += [(f"other{index}", order + kind) for index, kind in enumerate(others)]
    fields = draw(st.permutations(fields))
    offsets, end = [], 0
    for _, kind in fields:
        end += draw(st.integers(0, 3))
        offsets.append(end)
        end += np.dtype(kind).itemsize
    names, formats = zip(*fields, strict=True)
    step = end + draw(st.integers(0, 5))
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": step})


@given(dtype=layouts(), height=st.sampled_from([1, 2, 4]), row_padding=st.integers(0, 7), ros1=st.booleans())
def test_a_point_cloud_of_any_layout_is_read(tmp_path_factory, dtype, height, row_padding, ros1):
    records = np.zeros(len(POINTS), dtype)
    for axis, name in enumerate("xyz"):
        records[name] = POINTS[:, axis]
    message = cloud(records, ROS1 if ros1 else ROS2, height=height, row_padding=row_padding)
    path = write_mcap(tmp_path_factory.mktemp("layout") / "a.mcap", [message], ros1=ros1)
    np.testing.assert_array_equal(points_of(read(path)[0]), POINTS)


def test_directions_without_a_return_are_dropped(tmp_path):
    points = np.vstack([POINTS, [[np.nan, 1, 1], [0, 0, 0], [np.inf, 0, 0]], POINTS[:1]]).astype(np.float32)
    path = write_mcap(tmp_path / "a.mcap", [cloud(packed(points), height=2)])
    np.testing.assert_array_equal(points_of(read(path)[0]), np.vstack([POINTS, POINTS[:1]]))


def test_a_field_of_ids_makes_clusters_that_keep_them(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", [cloud(packed(POINTS, np.array([7, 3, 7, 3])))])
    clusters = read(path)[0].clusters
    assert [cluster.contact_id for cluster in clusters] == ["7", "3"]
    np.testing.assert_array_equal(clusters[0].points_level, POINTS[[0, 2]])


def test_a_message_that_makes_no_sense_does_not_end_the_recording(tmp_path):
    flat = cloud(packed(POINTS)[["x", "y"]].copy())
    short = cloud(packed(POINTS))
    short.row_step += 1
    messages = read(write_mcap(tmp_path / "a.mcap", [flat, short, cloud(packed(POINTS))]))
    assert [bool(message.error) for message in messages] == [True, True, False]
    assert messages[0].error == "expected one field each of x, y and z, got x, y"
    assert messages[1].error == "expected height x row_step = 49 bytes of points, got 48"


def test_topics_are_chosen_by_name(tmp_path):
    path = write_bag(tmp_path / "a.bag", [cloud(packed(POINTS), ROS1)], topic="/port")
    assert len(read(path, ["/port"])) == 1
    with pytest.raises(FileError, match=r"expected a topic .+ in a.bag, got /port \(sensor_msgs/"):
        read(path, ["/starboard"])


def test_an_unfinished_mcap_is_read_as_far_as_it_goes(tmp_path):
    rng = np.random.default_rng(0)
    clouds = [cloud(packed(rng.normal(50, 3, (500, 3)).astype(np.float32))) for _ in range(20)]
    whole = write_mcap(tmp_path / "a.mcap", clouds, chunk=10_000).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    found = []
    with pytest.raises(FileError, match=r"expected cut\.mcap to be a complete recording, got: "):
        found.extend(message.index for message in read_recording(tmp_path / "cut.mcap", (), ()))
    assert 5 < len(found) < 15
    for message in read_recording(tmp_path / "a.mcap", (), ()):
        assert message.index < 20


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a.db3"])
@pytest.mark.parametrize("content", [b"", b"hello\n" * 50, bytes(500)], ids=["empty", "words", "zeros"])
def test_what_is_no_recording_is_refused_in_one_sentence(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError) as caught:
        read(tmp_path / name)
    assert str(caught.value).startswith(f"expected {name} to be a complete recording, got: ") or not content
    assert "\n" not in str(caught.value)


@needs_lidar
def test_every_real_recording_is_read_or_refused_in_one_sentence():
    folder = LIDAR / "recordings"
    (bag,) = read(folder / "os1_points_lz4.bag")
    for other in ["os1_points_ros2_db3", "os1_points_ros2_mcap", "os1_points_ros2_mcap/os1_points_ros2_mcap.mcap"]:
        np.testing.assert_array_equal(points_of(read(folder / other)[0]), points_of(bag))
    full = read(LIDAR / "pointcloudset" / "ouster_os1_ros1.mcap")
    assert [len(points_of(message)) for message in full] == [45716, 45809]
    with pytest.raises(FileError, match=r"expected a topic of .+ got /os_node0/imu_packets \(ouster_ros"):
        read(LIDAR / "ouster" / "512x10_raw.bag")
