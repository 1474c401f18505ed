"""Files that name their clusters, and the formats of the extra: LAS, LAZ, Parquet."""

from pathlib import Path

import laspy
import numpy as np
import plyfile
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from batch.written import packed
from shipshape.errors import FileError
from shipshape.pointfiles import read_clusters, read_named_clusters

LIDAR = Path(__file__).parents[3] / "shared" / "data" / "lidar"
POINTS = np.array([[30, 1, 0.5], [31.25, -2, 1], [32, 0, 2], [40, 8, 1], [41, 8, 1]], np.float32)
IDS = np.array([7, 3, 7, 3, 12])


def named(path: Path) -> dict[str, np.ndarray]:
    clusters = read_named_clusters(path)
    assert all(cluster.apart for cluster in clusters)
    return {cluster.contact_id: cluster.points_level for cluster in clusters}


def write_csv(path: Path) -> None:
    rows = [f"{x},{y},{z},{track}" for (x, y, z), track in zip(POINTS, IDS, strict=True)]
    path.write_text("\n".join(["x,y,z,Track_ID", *rows]))


def write_npz(path: Path) -> None:
    order = np.argsort([{7: 0, 3: 1, 12: 2}[track] for track in IDS], kind="stable")
    np.savez(path, points=POINTS[order], n=[2, 2, 1], contact_id=["7", "3", "12"])


def write_npy(path: Path) -> None:
    np.save(path, packed(POINTS, IDS))


def write_pcd(path: Path) -> None:
    rows = [f"{x} {y} {z} {track}" for (x, y, z), track in zip(POINTS, IDS, strict=True)]
    header = "FIELDS x y z track_id\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 5\nHEIGHT 1\n"
    header = f"VERSION 0.7\n{header}VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 5\nDATA ascii\n"
    path.write_text(header + "\n".join(rows) + "\n")


def write_ply(path: Path) -> None:
    plyfile.PlyData([plyfile.PlyElement.describe(packed(POINTS, IDS), "vertex")]).write(str(path))


def write_las(path: Path) -> None:
    header = laspy.LasHeader(point_format=3, version="1.4")
    header.scales = np.full(3, 0.001)
    header.add_extra_dim(laspy.ExtraBytesParams(name="track_id", type=np.int32))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = POINTS.T.astype(np.float64)
    cloud.track_id = IDS
    cloud.write(path)


def write_points(path: Path) -> None:
    x, y, z = POINTS.T
    pq.write_table(pa.table({"x": x, "y": y, "z": z, "track_id": IDS}), path)


def write_lists(path: Path) -> None:
    chosen = [[0, 2], [1, 3], [4]]
    columns = {axis: [POINTS[rows, index].tolist() for rows in chosen] for index, axis in enumerate("xyz")}
    pq.write_table(pa.table({**columns, "contact": ["7", "3", "12"]}), path)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.csv", write_csv),
        ("a.npz", write_npz),
        ("a.npy", write_npy),
        ("a.pcd", write_pcd),
        ("a.ply", write_ply),
        ("a.las", write_las),
        ("a.laz", write_las),
        ("a.parquet", write_points),
        ("lists.parquet", write_lists),
    ],
)
def test_a_file_that_names_its_clusters_is_split_by_the_names(tmp_path, name, write):
    write(tmp_path / name)
    clusters = named(tmp_path / name)
    assert list(clusters) == ["7", "3", "12"]
    for track, points in clusters.items():
        np.testing.assert_allclose(points, POINTS[int(track) == IDS], atol=1e-3)


def test_points_that_belong_to_no_cluster_are_dropped(tmp_path):
    (tmp_path / "a.csv").write_text("x,y,z,cluster\n1,2,3,-1\n4,5,6,0\n7,8,9,0\n")
    assert {name: len(points) for name, points in named(tmp_path / "a.csv").items()} == {"0": 2}


def test_a_column_of_another_name_can_be_asked_for(tmp_path):
    (tmp_path / "a.csv").write_text("x,y,z,label\n1,2,3,buoy\n4,5,6,tug\n")
    assert len(read_clusters(tmp_path / "a.csv")) == 1
    found = read_named_clusters(tmp_path / "a.csv", id_names=["label"])
    assert [cluster.contact_id for cluster in found] == ["buoy", "tug"]


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.las", b"LASF", "expected a.las to be a complete LAS file, got: "),
        ("a.laz", b"hello" * 100, "expected a.laz to be a complete LAS file, got: "),
        ("a.parquet", b"PAR1 no PAR1", "expected a.parquet to be a complete Parquet file, got: "),
    ],
)
def test_what_is_no_cluster_is_refused_in_one_sentence(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError) as caught:
        read_named_clusters(tmp_path / name)
    assert str(caught.value).startswith(sentence)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("columns", "sentence"),
    [
        ({"x": [1.0], "y": [1.0]}, "expected the columns x, y, z in a.parquet, got x, y"),
        ({"x": [1], "y": [1], "z": [1]}, "expected floats in x, y and z of a.parquet, got int64"),
        ({"x": [[1.0]], "y": [[1.0]], "z": [[1.0, 2.0]]}, "expected as many y and z as x in row 0 of a.parquet"),
    ],
)
def test_a_parquet_file_of_other_columns_is_refused(tmp_path, columns, sentence):
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    with pytest.raises(FileError, match=f"^{sentence}"):
        read_named_clusters(tmp_path / "a.parquet")


def test_a_small_file_of_very_many_points_is_refused_before_it_is_unpacked(tmp_path):
    column = np.zeros(2_000_000)
    pq.write_table(pa.table({"x": column, "y": column, "z": column}), tmp_path / "a.parquet", use_dictionary=False)
    assert (tmp_path / "a.parquet").stat().st_size < 2**22
    with pytest.raises(FileError, match=r"expected a\.parquet to unpack to at most 4194304 bytes, got 48\d+"):
        read_named_clusters(tmp_path / "a.parquet", max_bytes=2**22)


@pytest.mark.skipif(not LIDAR.is_dir(), reason="the real scans beside the checkout (../shared/data) are absent")
def test_laz_unpacks_to_what_las_holds():
    las, laz = (read_clusters(LIDAR / "laspy" / f"simple.{suffix}")[0] for suffix in ("las", "laz"))
    assert len(las) == 1065
    np.testing.assert_array_equal(las, laz)


@pytest.mark.parametrize("lists", [False, True])
def test_a_small_parquet_of_very_many_points_is_refused_before_it_is_unpacked(tmp_path, lists):
    column = pa.array(np.zeros(2**20, np.float32))
    column = pa.ListArray.from_arrays([0, len(column)], column) if lists else column
    pq.write_table(pa.table(dict.fromkeys("xyz", column)), tmp_path / "flat.parquet")
    assert (tmp_path / "flat.parquet").stat().st_size < 100_000
    with pytest.raises(FileError, match="to unpack to at most 1048576 bytes, got 12582912"):
        read_clusters(tmp_path / "flat.parquet", max_bytes=2**20)
