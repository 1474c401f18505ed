import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipshape.errors import FileError
from shipshape.pointfiles import SUFFIXES, read_clusters

LIDAR = Path(__file__).parents[2] / "shared" / "data" / "lidar"
POINTS = np.array([[30, 1, 0.5], [31.25, -2, 1], [32, 0, 2]], np.float32)

PCD_HEADER = """# .PCD v0.7
VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH {width}
HEIGHT {height}
VIEWPOINT 0 0 0 1 0 0 0
POINTS {points}
DATA {data}
"""
PLY_HEADER = """ply
format ascii 1.0
element vertex {count}
property {kind} x
property {kind} y
property {kind} z
end_header
"""


def refusal(path: Path, **limits: int) -> str:
    with pytest.raises(FileError) as caught:
        read_clusters(path, **limits)
    sentence = str(caught.value)
    assert sentence.startswith("expected ")
    assert ", got" in sentence
    assert "\n" not in sentence
    assert len(sentence) < 400
    return sentence


def pcd_header(points: int, data: str, height: int = 1) -> str:
    return PCD_HEADER.format(width=points // height, height=height, points=points, data=data)


def npy_bytes(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


clouds = arrays.arrays(
    np.float32,
    st.tuples(st.integers(1, 20), st.just(3)),
    elements=st.floats(-1000, 1000, width=32),
)


@given(st.lists(clouds, max_size=5))
def test_npz_gives_back_the_clusters(tmp_path_factory, clusters):
    path = tmp_path_factory.mktemp("npz") / "scan.npz"
    total = np.concatenate([np.empty((0, 3), np.float32), *clusters])
    np.savez(path, points=total, n=np.array([len(cluster) for cluster in clusters], np.int32), truth=0)
    read = read_clusters(path)
    assert len(read) == len(clusters)
    for cluster, original in zip(read, clusters, strict=True):
        np.testing.assert_array_equal(cluster, original)


@given(
    cloud=clouds,
    delimiter=st.sampled_from([",", ";", " ", "\t", ", "]),
    names=st.sampled_from([[], ["x", "y", "z"], ["intensity", "z", "X", "y"], ['"Y[m]"', '"x[m]"', '"Z[m]"']]),
)
def test_text_gives_back_the_points(tmp_path_factory, cloud, delimiter, names):
    axes = ["xyz".find(name.strip('"').lower()[0]) for name in names] or [0, 1, 2]  # -1: not a coordinate
    rows = [["7.5" if axis < 0 else repr(float(point[axis])) for axis in axes] for point in cloud]
    path = tmp_path_factory.mktemp("text") / "cloud.csv"
    path.write_text("\n".join(map(delimiter.join, [names] * bool(names) + rows)))
    np.testing.assert_array_equal(read_clusters(path)[0], cloud)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, ">f4"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_of_any_float_is_read_as_float32(tmp_path, dtype, order):
    path = tmp_path / "cloud.npy"
    np.save(path, np.asarray(POINTS, dtype=dtype, order=order))
    (cloud,) = read_clusters(path)
    assert cloud.dtype == np.float32
    assert cloud.flags["C_CONTIGUOUS"]
    np.testing.assert_array_equal(cloud, POINTS)


def test_a_suffix_in_capitals_is_known(tmp_path):
    np.save(tmp_path / "cloud.npy", POINTS)
    (tmp_path / "cloud.npy").rename(tmp_path / "CLOUD.NPY")
    assert len(read_clusters(tmp_path / "CLOUD.NPY")[0]) == 3


def test_comments_blank_lines_and_a_byte_order_mark_are_skipped(tmp_path):
    path = tmp_path / "cloud.xyz"
    path.write_text("\ufeff# made by hand\n\n1 2 3\n\n4 5 6\n", encoding="utf-8")
    np.testing.assert_array_equal(read_clusters(path)[0], [[1, 2, 3], [4, 5, 6]])


def test_no_returns_of_an_organised_pcd_are_dropped_and_other_nan_is_kept(tmp_path):
    path = tmp_path / "scan.pcd"
    rows = "1 2 3\nnan nan nan\n4 5 6\n7 8 9\n"
    path.write_text(pcd_header(4, "ascii", height=2) + rows)
    assert len(read_clusters(path)[0]) == 3
    path.write_text(pcd_header(4, "ascii") + rows)
    assert np.isnan(read_clusters(path)[0]).any()


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("cloud.stl", b"solid", f"a file ending in {' '.join(SUFFIXES)}, got cloud.stl"),
        ("cloud", b"x", "got cloud"),
        *[(f"empty{suffix}", b"", "bytes, got 0 bytes") for suffix in SUFFIXES],
        ("four.npy", npy_bytes(np.zeros((5, 4), np.float32)), "shape (N, 3), got float32 of shape (5, 4)"),
        ("flat.npy", npy_bytes(np.zeros(9, np.float32)), "got float32 of shape (9,)"),
        ("whole.npy", npy_bytes(np.zeros((5, 3), np.int64)), "got int64 of shape (5, 3)"),
        ("record.npy", npy_bytes(np.zeros(2, [("x", "f4"), ("y", "i4")])), "x, y, z, got x float32, y int32"),
        ("object.npy", npy_bytes(np.array([[None] * 3])), "plain array, got pickled objects"),
        ("short.npy", npy_bytes(np.zeros((5, 3)))[:-8], "got a header for 120 bytes with 112 behind it"),
        ("text.npy", b"hello, this is no array", "to be a NumPy array, got: the magic string"),
        ("text.npz", b"hello, this is no archive", "complete .npz file, got: File is not a zip file"),
        ("words.csv", b"hello\nworld\n", "header with the columns x, y, z in words.csv, got hello"),
        ("names.csv", b"x,y,height\n1,2,3\n", "columns x, y, z in names.csv, got x, y, height"),
        (
            "boxes.csv",
            b"frame,x,y,z,length,width,height,yaw\n1,48,36,-2,44,10,4,1.5\n",
            "points in boxes.csv, got a table of boxes, with the columns frame, x, y, z, length",
        ),
        ("two.csv", b"1,2\n3,4\n", "expected at least 3 columns in two.csv, got 2"),
        ("alone.csv", b"x,y,z\n", "got a header alone"),
        ("comment.csv", b"# nothing\n", "got no lines"),
        ("hole.csv", b"1,2,3\n4,,6\n", "a number in every x, y, z column of hole.csv, got: "),
        ("ragged.csv", b"1,2,3\n4,5\n", "a number in every x, y, z column of ragged.csv, got: "),
        ("decimal.csv", b"1,5;2,5;3,5\n", "columns x, y, z in decimal.csv, got 1,5, 2,5, 3,5"),
        ("latin.csv", "größe\n".encode("latin-1"), "to be text in UTF-8, got: "),
        ("noise.pcd", b"\x00\xff" * 100, "complete PCD file, got: "),
        ("words.pcd", b"hello\n" * 100, "ends in a DATA line in words.pcd, got none"),
        ("bare.pcd", b"FIELDS x y z\nDATA ascii\n1 2 3\n", "complete PCD file, got: a damaged header"),
        ("short.pcd", pcd_header(9, "ascii").encode() + b"1 2 3\n", "expected the 9 points that short.pcd"),
        ("cut.pcd", pcd_header(9, "binary").encode() + bytes(24), "expected the 9 points that cut.pcd"),
        ("odd.pcd", pcd_header(9, "binary").encode() + bytes(25), "complete PCD file, got: buffer size"),
        ("lzf.pcd", pcd_header(9, "binary_compressed").encode() + bytes(20), "complete PCD file, got: "),
        ("flat.pcd", pcd_header(1, "ascii").replace("x y z", "x y w").encode() + b"1 2 3\n", "got x float32"),
        ("words.ply", b"hello\n", "complete PLY file, got: "),
        ("short.ply", PLY_HEADER.format(count=9, kind="float").encode() + b"1 2 3\n", "complete PLY file"),
        ("whole.ply", PLY_HEADER.format(count=1, kind="int").encode() + b"1 2 3\n", "got x int32, y int32"),
        (
            "face.ply",
            PLY_HEADER.format(count=1, kind="float").replace("vertex", "face").encode() + b"1 2 3\n",
            "expected an element vertex in face.ply, got face",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) and "." in value[-5:] else "",
)
def test_what_is_no_cluster_is_refused_in_one_sentence(tmp_path, name, content, sentence):
    path = tmp_path / name
    path.write_bytes(content)
    assert sentence in refusal(path)


@pytest.mark.parametrize(
    ("arrays", "sentence"),
    [
        ({"points": POINTS}, "expected the arrays points and n in scan.npz, got points"),
        ({"points": POINTS, "n": np.array([1, 1])}, "sum to the 3 points, got int64 of shape (2,) and sum 2"),
        ({"points": POINTS, "n": np.array([4, -1])}, "sum to the 3 points, got numbers from -1 to 4"),
        ({"points": POINTS, "n": np.array([3, 0])}, "whole numbers above 0 that sum to the 3 points, got numbers"),
        (
            {"points": POINTS, "n": np.array([2**64 - 1, 4], np.uint64)},
            "got numbers from 4 to 18446744073709551615",
        ),
        ({"points": POINTS[:0], "n": np.zeros(300_000, np.uint8)}, "expected at most 100000 clusters in scan.npz"),
        ({"points": POINTS, "n": np.array([1.5, 1.5])}, "got float64 of shape (2,)"),
        ({"points": POINTS, "n": np.array(3)}, "got int64 of shape ()"),
        (
            {"points": POINTS[:, :2], "n": np.array([3])},
            "floats of shape (N, 3), got float32 of shape (3, 2)",
        ),
    ],
)
def test_an_npz_of_other_arrays_is_refused(tmp_path, arrays, sentence):
    np.savez(tmp_path / "scan.npz", **arrays)
    assert sentence in refusal(tmp_path / "scan.npz")


def test_a_damaged_npz_is_refused(tmp_path):
    path = tmp_path / "scan.npz"
    np.savez_compressed(path, points=np.tile(POINTS, (100, 1)), n=np.array([300]))
    whole = path.read_bytes()
    path.write_bytes(whole[:60] + bytes(20) + whole[80:])
    assert "complete .npz file" in refusal(path)


def npy_claiming(rows: int) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f4", "fortran_order": False, "shape": (rows, 3)})
    return stream.getvalue()


def npz_of_empty_clusters(count: int) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, points=np.empty((0, 3), np.float32), n=np.zeros(count, np.int64))
    return stream.getvalue()


def test_a_small_npz_of_very_many_clusters_is_refused_before_it_is_unpacked(tmp_path):
    (tmp_path / "scan.npz").write_bytes(npz_of_empty_clusters(300_000))
    assert (tmp_path / "scan.npz").stat().st_size < 5_000
    assert "at most 100000 clusters in scan.npz, got an n of 2400128 bytes" in refusal(tmp_path / "scan.npz")


def npz_claiming(rows: int) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("points.npy", npy_claiming(rows))
        archive.writestr("n.npy", npy_bytes(np.array([rows])))
    return stream.getvalue()


def zip_bomb(rows: int) -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, points=np.zeros((rows // 10**6, 3), np.float32), n=np.array([0]))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("claim.npy", npy_claiming),
        ("claim.npz", npz_claiming),
        ("bomb.npz", zip_bomb),
        ("claim.pcd", lambda rows: pcd_header(rows, "binary").encode()),
        (
            "lzf.pcd",
            lambda rows: pcd_header(9, "binary_compressed").encode() + b"\x01\x00\x00\x00\xff\xff\xff\xff",
        ),
        ("claim.ply", lambda rows: PLY_HEADER.format(count=rows, kind="float").encode()),
    ],
)
def test_a_promise_of_a_trillion_points_takes_no_memory(tmp_path, name, make: Callable[[int], bytes]):
    path = tmp_path / name
    path.write_bytes(make(10**12))
    refusal(path, max_bytes=2**20)


def test_text_has_a_lower_limit_since_it_grows_in_memory(tmp_path):
    with (tmp_path / "cloud.csv").open("wb") as stream:
        stream.truncate(65 * 2**20)
    assert "expected at most 67108864 bytes of text in cloud.csv, got 68157440" in refusal(tmp_path / "cloud.csv")


def test_a_file_over_the_limit_a_folder_and_a_missing_file_are_refused(tmp_path):
    np.save(tmp_path / "cloud.npy", POINTS)
    (tmp_path / "folder.npy").mkdir()
    assert "1 to 100 bytes, got 164 bytes" in refusal(tmp_path / "cloud.npy", max_bytes=100)
    assert "got something that is no file" in refusal(tmp_path / "folder.npy")
    assert "got: No such file" in refusal(tmp_path / "gone.npy")


@pytest.mark.skipif(not LIDAR.is_dir(), reason="the real scans beside the checkout (../shared/data) are absent")
def test_every_real_file_is_read_or_refused_in_one_sentence():
    refused = {"ascii_empty.pcd", "ascii_invalid_header.pcd", "diamond.npz", "trout_ship_boxes.csv"}
    paths = [path for path in LIDAR.rglob("*") if path.suffix in SUFFIXES]
    assert len(paths) > 25
    for path in paths:
        if path.name in refused:
            refusal(path)
        else:
            assert [cloud.shape[1] for cloud in read_clusters(path)] == [3], path


@pytest.mark.skipif(not LIDAR.is_dir(), reason="the real scans beside the checkout (../shared/data) are absent")
def test_one_shape_written_by_other_tools_is_the_same_in_every_format():
    expected = np.genfromtxt(LIDAR / "pointcloudset" / "diamond.csv", delimiter=",", skip_header=1)[:, :3]
    for name in ["pointcloudset/diamond.xyz", "pyntcloud/diamond.npy", "pyntcloud/diamond_ascii.ply"]:
        np.testing.assert_allclose(read_clusters(LIDAR / name)[0], expected, err_msg=name)
    ascii_, binary, packed = (
        read_clusters(LIDAR / "pypcd4" / f"{kind}.pcd")[0] for kind in ["ascii", "binary", "binary_compressed"]
    )
    np.testing.assert_array_equal(binary, packed)
    np.testing.assert_allclose(ascii_, binary, rtol=1e-4)
