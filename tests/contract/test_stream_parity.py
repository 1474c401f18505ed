"""A message of a stream meets the fate of the same scan: the same bytes, or the same error in the same words."""

import json
import re
from contextlib import suppress

import grpc
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from serving.fakes import PATIENCE, cluster, running
from shipshape.client.failures import error_of_contact
from shipshape.serving.faults import Fault, FaultKind
from shipshape.serving.grpc import convert
from shipshape.serving.rest import answers
from shipshape.serving.rest.schemas import ContactError
from shipshape.v1 import shipshape_pb2 as pb

PACKED = cluster().tobytes()
INCIDENT = re.compile(r"[0-9a-f]{12}$")
POINTS = st.one_of(
    st.binary(max_size=200),
    st.integers(0, 40).map(lambda count: PACKED[: 12 * count]),
    st.binary(min_size=120, max_size=480).map(lambda packed: packed[: len(packed) // 12 * 12]),
)
CONTACTS = st.builds(
    pb.Contact,
    contact_id=st.sampled_from(["", "c7", "crash", "x" * 257]),
    points=POINTS,
    sensor_height_m=st.none() | st.sampled_from([3.0, -1.0, float("nan")]),
    own_true_heading_deg=st.none() | st.sampled_from([20.0, float("inf")]),
)
OPTIONS = st.builds(
    pb.Options,
    preset=st.sampled_from([0, 1, 2]),
    image_method=st.sampled_from([0, 1, 4]),
    include_restored=st.booleans(),
    include_png=st.booleans(),
)


def fates(results):
    """What of each contact's outcome must be the same: all but times and the ids of incidents."""
    found = []
    for result in results:
        result.recognition.ClearField("stages")
        result.error.message = INCIDENT.sub("", result.error.message)
        found.append(result.SerializeToString(deterministic=True))
    return found


def scanned(doors, contacts, options):
    scan = pb.RecogniseScanRequest(contacts=contacts, options=options)
    call = doors.stub.RecogniseScan.future(scan, timeout=PATIENCE)
    if call.exception() is None:
        return fates(call.result().results)
    return dict(call.trailing_metadata())["shipshape-error"], call.details()


def streamed(doors, messages):
    """Of each message, in the order in which they were sent."""
    requests = [
        pb.RecogniseStreamRequest(sequence=index, contacts=contacts, options=options)
        for index, (contacts, options) in enumerate(messages)
    ]
    answers = sorted(doors.stub.RecogniseStream(iter(requests), timeout=PATIENCE), key=lambda each: each.sequence)
    return [
        (pb.ErrorKind.Name(answer.error.kind).removeprefix("ERROR_KIND_").lower(), answer.error.message)
        if answer.HasField("error")
        else fates(answer.results)
        for answer in answers
    ]


@settings(max_examples=50)
@given(st.lists(st.tuples(st.lists(CONTACTS, min_size=1, max_size=3), OPTIONS), min_size=1, max_size=4))
def test_any_message_meets_the_fate_of_its_scan(doors, messages):
    assert streamed(doors, messages) == [scanned(doors, *each) for each in messages]


@pytest.mark.parametrize(
    ("count", "options", "kind"),
    [
        (0, pb.Options(), FaultKind.INVALID_INPUT),
        (257, pb.Options(), FaultKind.TOO_LARGE),
        (1, pb.Options(bundle="other"), FaultKind.INVALID_INPUT),
        (1, pb.Options(preset=99), FaultKind.INVALID_INPUT),
        (1, pb.Options(image_method=99), FaultKind.INVALID_INPUT),
    ],
)
def test_what_is_wrong_with_a_scan_is_wrong_with_a_message(doors, count, options, kind):
    message = [pb.Contact(points=PACKED)] * count, options
    assert streamed(doors, [message]) == [scanned(doors, *message)]
    assert streamed(doors, [message])[0][0] == kind


def test_a_message_that_is_refused_says_when_to_come_back_as_its_scan_does():
    with running(max_contacts=1, client_contacts_per_s=0.01, client_burst=1) as doors:
        message = pb.RecogniseStreamRequest(contacts=[pb.Contact(points=PACKED)])
        first, second = doors.stub.RecogniseStream(iter([message] * 2), timeout=PATIENCE)
        refused = first if first.HasField("error") else second
        scan = doors.stub.RecogniseScan.future(pb.RecogniseScanRequest(contacts=message.contacts))
        assert scan.exception() is not None
        told = int(dict(scan.trailing_metadata())["grpc-retry-pushback-ms"])
        assert 0 < told <= refused.error.retry_after_ms <= 100_000
        assert error_of_contact(refused.error).retry_after_s == refused.error.retry_after_ms / 1e3


def test_a_contact_that_is_refused_says_when_to_come_back_in_json_too():
    fault = Fault(FaultKind.OVERLOADED, "expected room, got none", retry_after_s=0.0121)
    (result,) = json.loads(answers.joined(["c7"], [fault]))["results"]
    assert result["error"] == {"error": "overloaded", "detail": "expected room, got none", "retry_after_ms": 13}
    assert result["error"]["retry_after_ms"] == convert.from_fault(fault).retry_after_ms
    ContactError.model_validate(result["error"], strict=True)


@settings(max_examples=50)
@given(st.lists(st.binary(max_size=60), max_size=5))
def test_no_bytes_are_an_internal_error(doors, raws):
    method = doors.channel.stream_stream("/shipshape.v1.Shipshape/RecogniseStream")
    call = method(iter(raws), timeout=PATIENCE)
    with suppress(grpc.RpcError):
        for raw in call:
            assert pb.RecogniseStreamResponse.FromString(raw).error.kind != pb.ERROR_KIND_INTERNAL
    assert call.code() in (grpc.StatusCode.OK, grpc.StatusCode.INVALID_ARGUMENT)
    assert re.fullmatch(r"expected .+, got .+|", call.details())
