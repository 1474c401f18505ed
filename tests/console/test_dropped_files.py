"""Each kind of file, dropped on the bench: what the browser sends is what the file holds."""

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect
from plyfile import PlyData, PlyElement
from pypcd4 import PointCloud
from pypcd4.pypcd4 import Encoding

from shipshape.errors import FileError
from shipshape.pointfiles import read_clusters

with np.load(Path(__file__).parents[2] / "examples/contacts.npz") as _contacts:
    POINTS = _contacts["points"][:263]


@pytest.fixture(scope="module")
def bench(opened, address):
    """One page for all files: each replaces the one before."""
    with opened(address) as page:
        page.get_by_role("button", name="RHIB").wait_for()
        yield page


def npy(array):
    return lambda path: np.save(path, array)


def npz(path):
    np.savez_compressed(path, points=POINTS, n=np.array([200, 63], np.int32))


def text(first, separator):
    def write(path):
        lines = [separator.join(f"{number:.9g}" for number in point) for point in POINTS]
        path.write_text("\n".join([*first, *lines]) + "\n", encoding="utf-8")

    return write


def swapped(path):
    """The columns in another order, with one more."""
    lines = ["# intensity, Z, Y, X"] + [f"7,{z:.9g},{y:.9g},{x:.9g}" for x, y, z in POINTS]
    path.write_text("\n".join(lines), encoding="utf-8")


def pcd(encoding):
    return lambda path: PointCloud.from_xyz_points(POINTS).save(path, encoding)


def ply(binary):
    def write(path):
        records = np.array([tuple(point) for point in POINTS], dtype=[(axis, "<f4") for axis in "xyz"])
        PlyData([PlyElement.describe(records, "vertex")], text=not binary).write(path)

    return write


FILES = {
    "float32.npy": npy(POINTS),
    "float64.npy": npy(POINTS.astype(np.float64)),
    "bigendian.npy": npy(POINTS.astype(">f4")),
    "header.csv": text(["x,y,z"], ","),
    "swapped.csv": swapped,
    "bare.xyz": text([], " "),
    "ascii.pcd": pcd(Encoding.ASCII),
    "binary.pcd": pcd(Encoding.BINARY),
    "compressed.pcd": pcd(Encoding.BINARY_COMPRESSED),
    "ascii.ply": ply(False),
    "binary.ply": ply(True),
}


def chosen(page, path):
    """The points that the browser sends when somebody chooses this file."""
    with page.expect_request("**/v1/recognise?*") as sent:
        page.locator("#file").set_input_files(path)
    return np.frombuffer(sent.value.post_data_buffer, "<f4").reshape(-1, 3)


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_sent_point_by_point(bench, tmp_path, name):
    FILES[name](tmp_path / name)
    np.testing.assert_allclose(chosen(bench, tmp_path / name), POINTS, rtol=1e-6)
    expect(bench.locator("#chosen")).to_have_text(f"{name}, {len(POINTS)} points")
    expect(bench.locator("#verdict")).to_contain_text("rhib")


def test_of_a_file_of_many_clusters_one_is_picked(bench, tmp_path):
    npz(tmp_path / "two.npz")
    assert np.array_equal(chosen(bench, tmp_path / "two.npz"), POINTS[:200])
    with bench.expect_request("**/v1/recognise?*") as sent:
        bench.get_by_label("Cluster of the file").select_option(label="2: 63 points")
    assert sent.value.post_data_buffer == POINTS[200:].astype("<f4").tobytes()


WRONG = {
    "cloud.las": (b"LASF", "expected a file that ends in .npy"),
    "empty.npy": (b"", "expected empty.npy to hold 1 to 67108864 bytes, got 0"),
    "text.npy": (b"not a NumPy array at all", "expected text.npy to be a NumPy array"),
    "words.csv": (b"x,y,z\n1,2,three\n", "expected a number in every x, y, z column of words.csv"),
    "boxes.csv": (b"a,b,c\n1,2,3\n", "expected the columns x, y, z in boxes.csv, got a, b, c"),
    "broken.npz": (b"PK\3\4 and no more", "expected broken.npz to be a complete .npz file"),
    "broken.pcd": (b"VERSION .7\nno header", "expected "),
    "broken.ply": (b"ply\nno header", "expected "),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_is_none_is_refused_in_one_sentence(bench, tmp_path, name):
    content, sentence = WRONG[name]
    (tmp_path / name).write_bytes(content)
    bench.locator("#file").set_input_files(tmp_path / name)
    expect(bench.get_by_role("alert").filter(has_text=name)).to_contain_text(sentence)


REAL = Path(__file__).parents[3] / "shared/data/lidar"
READ = {".npy", ".npz", ".csv", ".xyz", ".pcd", ".ply"}  # by the page; the command line reads more
SMALL = sorted(path for path in REAL.rglob("*") if path.suffix in READ and path.stat().st_size < 200_000)


@pytest.mark.skipif(not SMALL, reason="the real scans beside the checkout (../shared/data) are absent")
def test_real_files_are_read_as_the_command_line_reads_them(bench):
    sent = []
    bench.on(
        "request", lambda asked: sent.append(asked.post_data_buffer) if "v1/recognise?" in asked.url else None
    )
    for path in SMALL:
        sent.clear()
        bench.locator("#problem").evaluate("place => place.replaceChildren()")
        bench.locator("#file").set_input_files(path)
        if len(expected := expected_of(path)):
            expect(bench.locator("#chosen")).to_have_text(f"{path.name}, {len(expected)} points")
            np.testing.assert_allclose(
                np.frombuffer(sent[0], "<f4").reshape(-1, 3), expected, rtol=1e-5, atol=1e-6
            )
        else:
            expect(bench.locator("#problem")).to_contain_text(path.name)
            assert sent == []


def expected_of(path):
    """The first cluster of a file as `shipshape classify` reads it; none where it refuses."""
    try:
        return read_clusters(path)[0]
    except FileError:
        return []


def test_a_file_may_be_dropped_anywhere(bench):
    text = "\n".join(" ".join(map(str, point)) for point in POINTS.tolist())
    drop = """text => {
        const held = new DataTransfer();
        held.items.add(new File([text], "dropped.xyz"));
        document.body.dispatchEvent(new DragEvent("drop", {dataTransfer: held, bubbles: true, cancelable: true}));
    }"""
    with bench.expect_request("**/v1/recognise?*") as sent:
        bench.evaluate(drop, text)
    assert sent.value.post_data_buffer == POINTS.astype("<f4").tobytes()
