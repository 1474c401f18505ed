"""The same request gets the same answer, or the same class of error in the same words, through both doors."""

import base64
import math
import re

import grpc
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from serving.fakes import PATIENCE, cluster, request, rows
from shipshape.serving.faults import FaultKind
from shipshape.serving.grpc.guard import STATUS as GRPC_STATUS
from shipshape.serving.rest.problems import STATUS as REST_STATUS
from shipshape.types import Reason
from shipshape.v1 import shipshape_pb2 as pb

GOOD = cluster()
INCIDENT = re.compile(r"[0-9a-f]{12}$")


def broken(value, index=7):
    points = GOOD.copy()
    points[index, 1] = value
    return points


def through_grpc(doors, packed, options=None, **fields):
    call = doors.stub.Recognise.future(request(packed, options, **fields), timeout=PATIENCE)
    if call.exception() is None:
        return "ok", call.result().recognition.measured_points
    kind = FaultKind(dict(call.trailing_metadata())["shipshape-error"])
    assert call.code() is GRPC_STATUS[kind]
    return kind, INCIDENT.sub("", call.details())


def through_rest(doors, packed, query=None, **fields):
    query = {**(query or {}), **fields}
    return outcome(
        doors.rest.post(
            "/v1/recognise", params=query, content=packed, headers={"content-type": "application/octet-stream"}
        )
    )


def through_json(doors, body):
    return outcome(doors.rest.post("/v1/recognise", json=body))


def outcome(response):
    body = response.json()
    if response.status_code == 200:
        return "ok", body["measured_points"]
    kind = FaultKind(body["error"])
    assert response.status_code == body["status"] == REST_STATUS[kind]
    return kind, INCIDENT.sub("", body["detail"])


def scanned(doors, packed):
    """Through the scan methods: kind and message of the only contact."""
    by_grpc = doors.stub.RecogniseScan(
        pb.RecogniseScanRequest(contacts=[pb.Contact(points=packed)]), timeout=PATIENCE
    ).results[0]
    text = base64.b64encode(packed).decode()
    by_rest = doors.rest.post("/v1/scan", json={"contacts": [{"points_base64": text}]}).json()["results"][0]
    kind = pb.ErrorKind.Name(by_grpc.error.kind).removeprefix("ERROR_KIND_").lower()
    return (
        (kind, by_grpc.error.message) if by_grpc.HasField("error") else "ok",
        tuple(by_rest["error"].values()) if "error" in by_rest else "ok",
    )


BAD_POINTS = {
    "empty": (np.empty((0, 3), np.float32), FaultKind.UNPROCESSABLE),
    "fewer than the minimum": (GOOD[:9], FaultKind.UNPROCESSABLE),
    "NaN": (broken(math.nan), FaultKind.UNPROCESSABLE),
    "infinite": (broken(-math.inf), FaultKind.UNPROCESSABLE),
    "beyond float32": (broken(3e38) * np.float32(1), FaultKind.UNPROCESSABLE),
    "an extent of 5 km": (GOOD * [1, 250, 1], FaultKind.UNPROCESSABLE),
    "a million points": (np.zeros((1_000_000, 3)), FaultKind.TOO_LARGE),
}


@pytest.mark.parametrize("name", BAD_POINTS)
def test_bad_points(doors, name):
    points, kind = BAD_POINTS[name]
    packed = points.astype("<f4").tobytes()
    by_grpc, by_rest = through_grpc(doors, packed), through_rest(doors, packed)
    assert by_grpc == by_rest
    assert by_grpc[0] is kind
    assert re.fullmatch(r"expected .+, got .+", by_grpc[1])
    assert scanned(doors, packed) == (by_grpc, by_grpc)
    assert through_rest(doors, GOOD.tobytes())[0] == "ok", "the service still works"


@pytest.mark.parametrize("size", [1, 11, 13, 12 * 40 - 1])
def test_wrong_byte_length(doors, size):
    packed = bytes(size)
    by_grpc = through_grpc(doors, packed)
    assert by_grpc == through_rest(doors, packed)
    assert by_grpc[0] is FaultKind.INVALID_INPUT
    assert scanned(doors, packed) == (by_grpc, by_grpc)
    assert f"got {size} bytes" in by_grpc[1]


def test_unknown_bundle(doors):
    by_grpc = through_grpc(doors, GOOD, pb.Options(bundle="other"))
    assert by_grpc == through_rest(doors, GOOD.tobytes(), bundle="other")
    assert by_grpc == through_json(doors, {"points": rows(GOOD), "bundle": "other"})
    assert by_grpc[0] is FaultKind.INVALID_INPUT


@pytest.mark.parametrize("field", ["image_method", "preset"])
def test_unknown_method(doors, field):
    by_grpc = through_grpc(doors, GOOD, pb.Options(**{field: 99}))
    by_rest = through_json(doors, {"points": rows(GOOD), field: "upside_down"})
    assert by_grpc[0] is by_rest[0] is FaultKind.INVALID_INPUT
    for answer in (by_grpc, by_rest):
        assert field in answer[1]
        assert "full_top" in answer[1] or "paper" in answer[1], "it says what would have been right"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sensor_height_m", 0.0),
        ("sensor_height_m", -3.0),
        ("sensor_height_m", math.inf),
        ("sensor_height_m", 500.0),
        ("own_true_heading_deg", math.nan),
        ("contact_id", "x" * 257),
    ],
)
def test_bad_fields(doors, field, value):
    by_grpc = through_grpc(doors, GOOD, **{field: value})
    assert by_grpc == through_rest(doors, GOOD.tobytes(), **{field: value})
    assert by_grpc[0] is (FaultKind.INVALID_INPUT if field == "contact_id" else FaultKind.UNPROCESSABLE)


def test_internal_errors(doors):
    by_grpc = through_grpc(doors, GOOD, contact_id="crash")
    assert by_grpc == through_rest(doors, GOOD.tobytes(), contact_id="crash")
    assert by_grpc[0] is FaultKind.INTERNAL


@pytest.mark.parametrize(("count", "kind"), [(0, FaultKind.INVALID_INPUT), (257, FaultKind.TOO_LARGE)])
def test_number_of_contacts_in_a_scan(doors, count, kind):
    with pytest.raises(grpc.RpcError) as caught:
        doors.stub.RecogniseScan(pb.RecogniseScanRequest(contacts=[pb.Contact()] * count), timeout=PATIENCE)
    assert outcome(doors.rest.post("/v1/scan", json={"contacts": [{}] * count})) == (kind, caught.value.details())
    assert dict(caught.value.trailing_metadata())["shipshape-error"] == kind


def test_more_bytes_than_the_limit(doors):
    packed = bytes(16 * 2**20 + 12)
    by_grpc, by_rest = through_grpc(doors, packed), through_rest(doors, packed)
    assert by_grpc[0] is by_rest[0] is FaultKind.TOO_LARGE
    assert by_grpc[1].startswith("expected at most 16777216 bytes a request, got ")


def test_more_bytes_than_grpc_itself_reads(doors):
    """No shipshape-error tells it from a full queue: the comments of the contract say so."""
    limit = doors.stub.GetModelInfo(pb.GetModelInfoRequest(), timeout=PATIENCE).limits.max_body_bytes
    call = doors.stub.Recognise.future(request(bytes(limit + 4 * 2**20)), timeout=PATIENCE)
    assert call.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
    assert "shipshape-error" not in dict(call.trailing_metadata())


BAD_JSON = {
    "not JSON": (b"points", "expected JSON, got 6 bytes"),
    "not an object": (b"[1, 2]", "expected the body to be a valid dictionary"),
    "cut off": (b'{"points": [[1, 2', "expected JSON"),
    "no points": (b"{}", "expected one of points and points_base64, got neither"),
    "two forms": (b'{"points": [], "points_base64": ""}', "got points and points_base64"),
    "two columns": (b'{"points": [[1, 2]]}', "expected three numbers in points[0], got a list of 2"),
    "four columns": (b'{"points": [[1, 2, 3], [1, 2, 3, 4]]}', "points[1], got a list of 4"),
    "flat": (b'{"points": [1, 2, 3]}', "points[0], got a number"),
    "text": (b'{"points": [["1", "2", "3"]]}', "expected only numbers"),
    "true among numbers": (b'{"points": [[1, 2, true]]}', "expected only numbers"),
    "all true": (b'{"points": [[true, true, true]]}', "expected only numbers"),
    "true for a number": (
        b'{"points": [], "sensor_height_m": true}',
        "sensor_height_m to be a valid number, got True",
    ),
    "text for a number": (
        b'{"points": [], "sensor_height_m": "3"}',
        "sensor_height_m to be a valid number, got '3'",
    ),
    "a number for true": (b'{"points": [], "include_png": 1}', "include_png to be a valid boolean, got 1"),
    "null": (b'{"points": [[1, 2, null]]}', "expected only numbers"),
    "lists in rows": (b'{"points": [[1, 2, [3]]]}', "expected only numbers"),
    "points as text": (b'{"points": "x"}', "a list of [x, y, z], got a string"),
    "not base64": (b'{"points_base64": "%%%"}', "expected base64"),
    "unknown field": (b'{"points": [], "colour": 1}', "expected only known fields, got 'colour'"),
    "wrong type": (b'{"points": [], "contact_id": 7}', "expected contact_id to be a valid string, got 7"),
}


@pytest.mark.parametrize("name", BAD_JSON)
def test_malformed_json(doors, name):
    body, message = BAD_JSON[name]
    response = doors.rest.post("/v1/recognise", content=body, headers={"content-type": "application/json"})
    kind, detail = outcome(response)
    assert kind is FaultKind.INVALID_INPUT
    assert message in detail


@pytest.mark.parametrize(
    "literal", [b"NaN", b"Infinity", b"-Infinity", b"1e400", b"1e39", b"1" * 39 + b"0", b"-" + b"9" * 400]
)
def test_not_finite_in_json(doors, literal):
    body = b'{"points": [' + b"[1, 2, 3], " * 12 + b"[1, " + literal + b", 3]]}"
    response = doors.rest.post("/v1/recognise", content=body, headers={"content-type": "application/json"})
    kind, detail = outcome(response)
    assert kind is FaultKind.UNPROCESSABLE
    assert detail == "expected finite coordinates, got 1 points with NaN or infinity"


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    packed=st.one_of(
        st.binary(max_size=600), st.binary(min_size=120, max_size=600).map(lambda b: b[: -(len(b) % 12)])
    )
)
def test_any_bytes_meet_the_same_fate(doors, packed):
    by_grpc = through_grpc(doors, packed)
    assert by_grpc == through_rest(doors, packed)
    assert by_grpc[0] != FaultKind.INTERNAL


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(raw=st.binary(max_size=300))
def test_no_bytes_are_an_internal_error(doors, raw):
    for media_type in ("application/json", "application/octet-stream"):
        response = doors.rest.post("/v1/recognise", content=raw, headers={"content-type": media_type})
        assert response.status_code in (200, 400, 422)
    call = doors.channel.unary_unary("/shipshape.v1.Shipshape/Recognise").future(raw, timeout=PATIENCE)
    assert call.code() in (grpc.StatusCode.OK, grpc.StatusCode.INVALID_ARGUMENT)


def test_both_doors_give_the_same_reasons(doors):
    by_grpc = doors.stub.Recognise(request(GOOD), timeout=PATIENCE).recognition.reasons
    by_rest = doors.rest.post("/v1/recognise", json={"points": rows(GOOD)}).json()["reasons"]
    assert [pb.Reason.Name(number).removeprefix("REASON_").lower() for number in by_grpc] == by_rest
    assert by_rest == ["few_points", "end_on"]


def test_every_reason_has_a_number():
    names = {name.removeprefix("REASON_").lower() for name in pb.Reason.keys()}  # noqa: SIM118  an enum, no dict
    assert names == {*Reason, "unspecified"}


def test_every_kind_has_a_status_in_both_tables():
    assert set(GRPC_STATUS) == set(REST_STATUS) == set(FaultKind)
    names = {name.removeprefix("ERROR_KIND_").lower() for name in pb.ErrorKind.keys()}  # noqa: SIM118  an enum, no dict
    assert names == {*FaultKind, "unspecified"}
