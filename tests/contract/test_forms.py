"""Every form of a body gets the answer of the packed form, byte for byte, and its error of the same class."""

import base64
import io
import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from serving.fakes import cluster, rows
from shipshape.serving.faults import FaultKind
from shipshape.serving.rest.problems import STATUS

GOOD = cluster()
TIMES = re.compile(rb'"stage_ms":\{[^}]*\}')
JSON, PACKED, NPY = "application/json", "application/octet-stream", "application/x-npy"
POINTCLOUD2 = "application/vnd.shipshape.pointcloud2"
CLOUD = {"fields": "intensity:0:4,z:2:8,y:10:8,x:18:8", "point_step": 29, "is_bigendian": "true"}


def post(doors, media_type, content, path="/v1/recognise", **query):
    return doors.rest.post(path, params=query, content=content, headers={"content-type": media_type})


def npy(points):
    stream = io.BytesIO()
    np.save(stream, points)
    return stream.getvalue()


def cloud(points):
    """The data and query of a cloud in the layout `CLOUD`, which pads each point by 3 bytes."""
    kind = np.dtype({"names": ["z", "y", "x"], "formats": [">f8"] * 3, "offsets": [2, 10, 18], "itemsize": 29})
    records = np.zeros(len(points), kind)
    for axis, column in zip("xyz", points.T, strict=True):
        records[axis] = column
    return records.tobytes(), {**CLOUD, "width": len(points)}


def through_every_form(doors, points, **query):
    """The responses to the same points, the packed form's first."""
    packed = points.astype("<f4").tobytes()
    data, layout = cloud(points)
    text = base64.b64encode(packed).decode()
    return [
        post(doors, PACKED, packed, **query),
        post(doors, NPY, npy(points), **query),
        post(doors, NPY, npy(np.asfortranarray(points.astype(">f8"))), **query),
        post(doors, POINTCLOUD2, data, **query, **layout),
        post(doors, JSON, json.dumps({"points": rows(points), **query}).encode()),
        post(doors, JSON, json.dumps({"points_base64": text, **query}).encode()),
    ]


def said(response):
    """What of a response must be the same whatever the form: of a problem all but its id."""
    if response.status_code == 200:
        return TIMES.sub(b"", response.content)
    problem = response.json()
    del problem["request_id"]
    return response.status_code, problem


def test_every_form_gets_the_same_bytes(doors):
    query = {"contact_id": "c7", "sensor_height_m": 3.5, "include_restored": True, "preset": "paper"}
    answers = [said(response) for response in through_every_form(doors, GOOD, **query)]
    assert answers == [answers[0]] * len(answers)
    assert b'"contact_id":"c7"' in answers[0]
    restored = json.loads(answers[0].replace(b",,", b","))["restored"]["points"]
    assert np.array_equal(np.float32(restored)[:40], GOOD)


@given(st.integers(10, 60), st.integers(0, 2**32 - 1))
def test_every_form_gets_the_same_bytes_for_any_points(doors, count, seed):
    answers = [
        said(response) for response in through_every_form(doors, cluster(count, seed), include_restored=True)
    ]
    assert answers == [answers[0]] * len(answers)


def broken(value):
    points = GOOD.copy()
    points[7, 1] = value
    return points


@pytest.mark.parametrize(
    ("points", "kind"),
    [
        (GOOD[:0], FaultKind.UNPROCESSABLE),
        (GOOD[:9], FaultKind.UNPROCESSABLE),
        (broken(math.inf), FaultKind.UNPROCESSABLE),
        (GOOD * np.float32([1, 250, 1]), FaultKind.UNPROCESSABLE),
        (np.zeros((65537, 3), np.float32), FaultKind.TOO_LARGE),
    ],
    ids=["none", "few", "infinite", "wide", "many"],
)
def test_every_form_gets_the_same_error(doors, points, kind):
    answers = through_every_form(doors, points)
    assert [said(answer) for answer in answers] == [said(answers[0])] * len(answers)
    assert answers[0].status_code == STATUS[kind]


@pytest.mark.parametrize("fields", [{"bundle": "other"}, {"contact_id": "x" * 257}, {"sensor_height_m": -1.0}])
def test_every_form_gets_the_same_error_beside_the_points(doors, fields):
    answers = [said(response) for response in through_every_form(doors, GOOD, **fields)]
    assert answers == [answers[0]] * len(answers)
    assert answers[0][0] in (400, 422)


BAD_QUERIES = {
    "no fields": {"fields": None},
    "no width": {"width": None},
    "a negative width": {"width": -1},
    "a huge width": {"width": 2**32},
    "a width beyond all": {"width": "9" * 5000},
    "half a point": {"point_step": 14.5},
    "fields over one another": {"fields": "x:0:7,y:2:7,z:8:7"},
    "a step too short": {"point_step": 20},
    "rows that are not there": {"height": 2},
    "rows longer than they are": {"row_step": 29 * 40 + 1},
    "an unknown member": {"header": "x"},
    "an unknown truth": {"is_dense": "perhaps"},
}


@pytest.mark.parametrize("name", BAD_QUERIES)
def test_malformed_queries_of_a_cloud(doors, name):
    data, layout = cloud(GOOD)
    query = {key: value for key, value in {**layout, **BAD_QUERIES[name]}.items() if value is not None}
    response = post(doors, POINTCLOUD2, data, **query)
    assert response.status_code == 400
    assert re.fullmatch(r"(?s)expected .+, got .+", response.json()["detail"])


@pytest.mark.parametrize("size", [0, 1, -1])
def test_bodies_that_are_cut_or_too_long(doors, size):
    data, layout = cloud(GOOD)
    for media_type, content, query in ((NPY, npy(GOOD), {}), (POINTCLOUD2, data, layout)):
        response = post(doors, media_type, (content + b"x")[:size] if size < 1 else content + b"x", **query)
        assert (response.status_code == 200) is (size == -1)
        assert response.status_code in (200, 400)


def test_a_layout_is_for_clouds_alone(doors):
    data, layout = cloud(GOOD)
    assert post(doors, PACKED, data, **layout).status_code == 400
    assert post(doors, NPY, npy(GOOD), **layout).status_code == 400


def scanned(doors, contacts, **query):
    """The same scan in JSON and in packed points."""
    fields = {key: value for key, value in query.items() if key in ("sensor_height_m", "own_true_heading_deg")}
    options = {key: value for key, value in query.items() if key not in fields}
    body = {"contacts": [{"points": rows(points), **fields} for points in contacts], **options}
    packed = b"".join(points.astype("<f4").tobytes() for points in contacts)
    counts = ",".join(str(len(points)) for points in contacts)
    return doors.rest.post("/v1/scan", json=body), post(doors, PACKED, packed, "/v1/scan", counts=counts, **query)


def test_a_packed_scan_gets_the_bytes_of_one_in_json(doors):
    contacts = [
        cluster(40),
        cluster(5),
        cluster(300, seed=1),
        np.zeros((65537, 3), np.float32),
        cluster(12, seed=2),
    ]
    by_json, packed = scanned(
        doors, contacts, sensor_height_m=3.0, own_true_heading_deg=20.0, include_restored=True
    )
    assert said(packed) == said(by_json)
    kinds = [result.get("error", {}).get("error") for result in packed.json()["results"]]
    assert kinds == [None, "unprocessable", None, "too_large", None]
    assert packed.headers["Server-Timing"].startswith("prior;dur=")


@pytest.mark.parametrize("count", [257, 1000])
def test_a_packed_scan_of_too_many(doors, count):
    by_json, packed = scanned(doors, [GOOD[:1]] * count)
    assert said(packed) == said(by_json)
    assert packed.status_code == 413


@pytest.mark.parametrize(
    ("query", "size"), [({}, 480), ({"counts": ""}, 0), ({"counts": "40,1"}, 480), ({"counts": "40,x"}, 480)]
)
def test_malformed_packed_scans(doors, query, size):
    response = post(doors, PACKED, bytes(size), "/v1/scan", **query)
    assert response.status_code == 400
    assert re.fullmatch(r"expected .+, got .+", response.json()["detail"])


@given(raw=st.binary(max_size=300), media_type=st.sampled_from([NPY, POINTCLOUD2]))
def test_no_bytes_are_an_internal_error(doors, raw, media_type):
    query = {**CLOUD, "width": len(raw) // 29} if media_type == POINTCLOUD2 else {}
    assert post(doors, media_type, raw, **query).status_code in (200, 400, 422)
    magic = b"\x93NUMPY\x01\x00" + raw
    assert post(doors, NPY, magic).status_code in (200, 400, 422)
