"""Whatever form points come in, they are the points that the packed form gives; anything else is one sentence."""

import io
import re
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.lib import format as npy

from shipshape.errors import InvalidInput, TooLarge
from shipshape.serving.encoding import Limits, pack, points_from_bytes
from shipshape.serving.encoding_counts import contacts_from_bytes, parse_counts
from shipshape.serving.encoding_npy import points_from_npy
from shipshape.serving.encoding_pointcloud2 import (
    DATATYPES,
    Layout,
    PointField,
    parse_fields,
    points_from_pointcloud2,
)

LIMITS = Limits(max_points=100)
SENTENCE = r"(?s)expected .+, got .+"
POINTS = arrays(np.float64, st.tuples(st.integers(0, 40), st.just(3)), elements=st.floats(-1e6, 1e6))
ORDERS = st.sampled_from("<>")


def same(found, points):
    """As the packed form gives them, byte for byte."""
    with np.errstate(over="ignore", invalid="ignore"):
        packed = pack(points.astype(np.float32))
    expected = points_from_bytes(packed, LIMITS)
    return (
        found.dtype == expected.dtype and found.tobytes() == expected.tobytes() and found.shape == expected.shape
    )


def saved(array, version=None):
    stream = io.BytesIO()
    npy.write_array(stream, array, version=version, allow_pickle=False)
    return stream.getvalue()


def headed(header, data=b"", major=1):
    text = header.encode("latin1")
    size = len(text).to_bytes(2 if major == 1 else 4, "little")
    return b"\x93NUMPY" + bytes([major, 0]) + size + text + data


@pytest.mark.filterwarnings("ignore:Stored array in format 3.0")
@given(
    POINTS, st.sampled_from(["f2", "f4", "f8"]), ORDERS, st.booleans(), st.sampled_from([(1, 0), (2, 0), (3, 0)])
)
def test_npy_of_any_float_and_order(points, kind, order, fortran, version):
    with np.errstate(over="ignore"):
        array = points.astype(order + kind, order="F" if fortran else "C")
    assert same(points_from_npy(saved(array, version), LIMITS), array)


@given(POINTS, st.permutations(["x", "y", "z", "ring", "größe"]), ORDERS)
def test_npy_records_of_any_order(points, names, order):
    kinds = {"x": "f8", "y": "f4", "z": "f8", "ring": "u2", "größe": "f4"}
    records = np.zeros(len(points), [(name, order + kinds[name]) for name in names])
    for axis, column in zip("xyz", points.T, strict=True):
        records[axis] = column
    array = np.column_stack([records["x"], records["y"], records["z"]])
    assert same(points_from_npy(saved(records, (3, 0)), LIMITS), array)


HEADER = "{{'descr': {}, 'fortran_order': False, 'shape': {}, }}\n"
BAD_NPY = {
    "nothing": b"",
    "no magic": b"points",
    "magic alone": b"\x93NUMPY",
    "version 9": b"\x93NUMPY\x09\x00\x00\x00",
    "a cut header": saved(np.zeros((4, 3)))[:60],
    "a header too long": headed(HEADER.format("'<f4'", "(1, 3)") + " " * 5000, bytes(12)),
    "a header that claims gigabytes": b"\x93NUMPY\x02\x00\xff\xff\xff\xff",
    "no dictionary": headed("[1, 2]\n"),
    "code": headed("__import__('os').abort()\n"),
    "very deep": headed("(" * 2000 + "\n"),
    "very long a sum": headed("-" * 4000 + "1\n"),
    "no shape": headed("{'descr': '<f4', 'fortran_order': False}\n"),
    "an unknown kind": headed(HEADER.format("'<q77'", "(1, 3)"), bytes(12)),
    "objects": headed(HEADER.format("'|O'", "(1, 3)"), bytes(24)),
    "objects in records": headed(HEADER.format("[('x', '|O'), ('y', '<f4'), ('z', '<f4')]", "(1,)"), bytes(16)),
    "whole numbers": saved(np.zeros((4, 3), np.int32)),
    "true and false": saved(np.zeros((4, 3), bool)),
    "complex numbers": saved(np.zeros((4, 3), complex)),
    "long doubles": saved(np.zeros((4, 3), np.longdouble)),
    "one axis": saved(np.zeros(12)),
    "three axes": saved(np.zeros((4, 3, 1))),
    "no axes": saved(np.zeros(())),
    "two columns": saved(np.zeros((4, 2))),
    "records of two axes": saved(np.zeros((4, 1), [("x", "f4"), ("y", "f4"), ("z", "f4")])),
    "records without z": saved(np.zeros(4, [("x", "f4"), ("y", "f4")])),
    "a row for x": saved(np.zeros(4, [("x", "f4", 2), ("y", "f4"), ("z", "f4")])),
    "fewer than none": headed(HEADER.format("'<f4'", "(-1, 3)"), b""),
    "more than there are": headed(HEADER.format("'<f4'", "(2, 3)"), bytes(12)),
    "fewer than there are": headed(HEADER.format("'<f4'", "(1, 3)"), bytes(13)),
    "records of a gigabyte": headed(
        HEADER.format("[('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('w', '|V1000000000')]", "(90,)"), bytes(12)
    ),
}


@pytest.mark.parametrize("name", BAD_NPY)
def test_malformed_npy(name):
    with pytest.raises(InvalidInput, match=SENTENCE) as caught:
        points_from_npy(BAD_NPY[name], LIMITS)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("count", [101, 2**62, 10**300])
def test_npy_of_too_many_points(count):
    with pytest.raises(TooLarge):
        points_from_npy(headed(HEADER.format("'<f4'", f"({count}, 3)"), bytes(12)), LIMITS)


@given(st.data())
def test_a_damaged_npy_is_points_or_a_sentence(data):
    whole = bytearray(saved(np.zeros((4, 3), np.float32)))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(whole)))
    assert points_or_sentence(lambda: points_from_npy(bytes(whole[:cut]), LIMITS))


def points_or_sentence(decode):
    """Whether it gives points, or one sentence and no large allocation."""
    tracemalloc.start()
    try:
        points = decode()
        return points.dtype == np.float32 and points.shape[1:] == (3,) and len(points) <= LIMITS.max_points
    except InvalidInput as error:
        return re.fullmatch(SENTENCE, str(error)) is not None and tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()


@st.composite
def clouds(draw):
    """Points, and the members of a layout of them of any order, padding, stride and byte order."""
    points = draw(POINTS)
    names = draw(st.permutations(["x", "y", "z", "ring", "rgb"]))
    fields, offset = [], 0
    for name in names:
        offset += draw(st.integers(0, 5))
        datatype = draw(st.sampled_from([7, 8]) if name in "xyz" else st.sampled_from(list(DATATYPES)))
        fields.append(PointField(name, offset, datatype, 1 if name in "xyz" else draw(st.integers(1, 3))))
        offset = fields[-1].end
    step = offset + draw(st.integers(0, 7))
    height = draw(st.sampled_from([n for n in range(1, len(points) + 1) if len(points) % n == 0] or [1]))
    width = len(points) // height
    row = width * step + draw(st.integers(0, 9)) * (len(points) > 0)
    return points, (
        draw(st.permutations(fields)),
        width,
        height,
        step,
        row,
        draw(st.booleans()),
        draw(st.booleans()),
    )


def written(points, layout):
    """The data as a driver would write it: what lies between the fields is rubbish."""
    data = bytearray(b"\xff" * (layout.height * layout.row_step))
    order = ">" if layout.is_bigendian else "<"
    for index, point in enumerate(points):
        start = index // layout.width * layout.row_step + index % layout.width * layout.point_step
        for field in layout.fields:
            if field.name in "xyz":
                value = np.array(point["xyz".index(field.name)], order + DATATYPES[field.datatype]).tobytes()
                data[start + field.offset : start + field.offset + len(value)] = value
    return bytes(data)


@given(clouds())
def test_pointcloud2_of_any_layout(cloud):
    points, layout = cloud[0], Layout(*cloud[1])
    narrow = [next(field for field in layout.fields if field.name == axis).datatype == 7 for axis in "xyz"]
    points[:, narrow] = points[:, narrow].astype(np.float32)
    assert same(points_from_pointcloud2(written(points, layout), layout, LIMITS), points)


XYZ = parse_fields("x:0:7,y:4:7,z:8:7:1")


def test_points_that_are_none_are_dropped_from_a_cloud_that_is_not_dense():
    points = np.arange(24, dtype="<f4").reshape(8, 3)
    points[[1, 4, 6], [0, 2, 1]] = np.nan, np.inf, -np.inf
    full = Layout(XYZ, 4, 2, 12, 48)
    assert same(points_from_pointcloud2(points.tobytes(), full, LIMITS), points)
    holed = Layout(XYZ, 4, 2, 12, 48, is_dense=False)
    assert same(points_from_pointcloud2(points.tobytes(), holed, LIMITS), points[[0, 2, 3, 5, 7]])


def test_what_is_dropped_does_not_count_towards_the_limit():
    points = np.full((300, 3), np.nan, "<f4")
    points[:100] = 1
    layout = Layout(XYZ, 300, 1, 12, 3600, is_dense=False)
    assert len(points_from_pointcloud2(points.tobytes(), layout, LIMITS)) == 100
    with pytest.raises(TooLarge):
        points_from_pointcloud2(points.tobytes(), Layout(XYZ, 300, 1, 12, 3600), LIMITS)


BAD_FIELDS = "|x|x:0|x:0:7:1:1|:0:7|x:-1:7|x:0:9|x:0:0|x:0:7:0|x:0.5:7|x:²:7|x:99999999999:7|x:0:7,|x:0:7;y:4:7"


@pytest.mark.parametrize("text", BAD_FIELDS.split("|"))
def test_malformed_fields(text):
    with pytest.raises(InvalidInput, match=SENTENCE):
        parse_fields(text)


BAD_LAYOUTS = {
    "no z": Layout(XYZ[:2], 1, 1, 12, 12),
    "two x": Layout([*XYZ, PointField("x", 12, 7)], 1, 1, 16, 16),
    "x a whole number": Layout([PointField("x", 0, 5), *XYZ[1:]], 1, 1, 12, 12),
    "x a row": Layout([PointField("x", 12, 7, 2), *XYZ[1:]], 1, 1, 20, 20),
    "x over y": Layout([PointField("x", 2, 7), *XYZ[1:]], 1, 1, 12, 12),
    "another over z": Layout([*XYZ, PointField("rgb", 11, 7)], 1, 1, 16, 16),
    "a field beyond the point": Layout(XYZ, 1, 1, 11, 12),
    "another field beyond the point": Layout([*XYZ, PointField("rgb", 4294967295, 8, 4294967295)], 1, 1, 16, 16),
    "no step": Layout(XYZ, 1, 1, 0, 12),
    "rows over one another": Layout(XYZ, 2, 2, 12, 12),
    "rows shorter than said": Layout(XYZ, 1, 2, 12, 20),
    "rows longer than said": Layout(XYZ, 1, 2, 12, 12),
    "many rows of nothing": Layout(XYZ, 0, 4294967295, 12, 1),
    "more than memory": Layout(XYZ, 4294967295, 4294967295, 4294967295, 2**64),
}


@pytest.mark.parametrize("name", BAD_LAYOUTS)
def test_malformed_layouts(name):
    layout = BAD_LAYOUTS[name]
    with pytest.raises(InvalidInput, match=SENTENCE) as caught:
        points_from_pointcloud2(
            bytes(layout.height * layout.row_step if layout.height < 2 else 21), layout, LIMITS
        )
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(("width", "height", "row_step"), [(0, 0, 0), (0, 5, 0), (4, 0, 48), (0, 2**32 - 1, 0)])
def test_a_cloud_of_no_points(width, height, row_step):
    assert points_from_pointcloud2(b"", Layout(XYZ, width, height, 12, row_step), LIMITS).shape == (0, 3)


SIZES = st.one_of(st.integers(0, 30), st.sampled_from([2**31, 2**32 - 1]))


@given(
    data=st.binary(max_size=400),
    fields=st.lists(
        st.builds(PointField, st.sampled_from(["x", "y", "z", "w"]), SIZES, st.sampled_from([*DATATYPES]), SIZES),
        max_size=6,
    ),
    sizes=st.tuples(SIZES, SIZES, SIZES, SIZES, st.booleans(), st.booleans()),
)
def test_any_layout_is_points_or_a_sentence(data, fields, sizes):
    for described in (fields, XYZ):
        assert points_or_sentence(lambda: points_from_pointcloud2(data, Layout(described, *sizes), LIMITS))  # noqa: B023


@given(st.lists(POINTS, min_size=1, max_size=6))
def test_many_contacts_in_one_body(contacts):
    packed = [pack(points.astype(np.float32)) for points in contacts]
    counts = parse_counts(",".join(str(len(points)) for points in contacts))
    found = contacts_from_bytes(b"".join(packed), counts, LIMITS)
    assert all(same(one, points) for one, points in zip(found, contacts, strict=True))


def test_a_contact_of_too_many_points_does_not_spoil_the_others():
    first, second, third = contacts_from_bytes(bytes(12 * 122), [10, 101, 11], LIMITS)
    assert (len(first), type(second), len(third)) == (10, TooLarge, 11)


@pytest.mark.parametrize("text", ["", "1,", "-1", "1.0", "ten", "1, 2", "٣", "1" * 11])
def test_malformed_counts(text):
    with pytest.raises(InvalidInput, match=SENTENCE):
        parse_counts(text)


@pytest.mark.parametrize("counts", [[], [1], [1, 2], [9999999999] * 3])
def test_counts_that_are_not_the_bodys(counts):
    with pytest.raises(InvalidInput, match=SENTENCE):
        contacts_from_bytes(bytes(24), counts, LIMITS)
