"""A deadline that has already passed: refused through every door, and nothing of it is computed."""

import grpc

from faults.live import PACKED, PATIENCE, POINTS
from oip.wire import by_grpc_raw, by_json
from shipshape.v1 import shipshape_pb2 as pb

INPUTS = {"points": POINTS, "contact_id": [b"past"]}
MICROSECOND = {"timeout": 1}
NOW = {"Shipshape-Timeout-Ms": "0.000001"}
CONTACT = pb.Contact(contact_id="past", points=POINTS.tobytes())


def test_it_is_refused_and_never_computed(service):
    with service.survives():
        for path, query in (("/v1/recognise", {"contact_id": "past"}), ("/v1/scan", {"counts": len(POINTS)})):
            answer = service.rest.post(path, params=query, content=CONTACT.points, headers=PACKED | NOW)
            assert (answer.status_code, answer.json()["error"]) == (504, "deadline_exceeded")
        for infer, status in ((by_json, 504), (by_grpc_raw, grpc.StatusCode.DEADLINE_EXCEEDED)):
            reply = infer(service, INPUTS, parameters=MICROSECOND)
            assert (reply.status, reply.kind) == (status, "deadline_exceeded")
        messages = [pb.RecogniseStreamRequest(sequence=n, contacts=[CONTACT], timeout_ms=1e-6) for n in range(3)]
        answers = list(service.stub.RecogniseStream(iter(messages), timeout=PATIENCE))
        assert [answer.error.kind for answer in answers] == [pb.ERROR_KIND_DEADLINE_EXCEEDED] * 3
    assert "past" not in service.release.with_name("journal").read_text()
