"""Memory that runs out: the request that needs too much is told so, and all others are answered."""

import resource
from contextlib import contextmanager

import grpc
import psutil
import pytest

from faults.live import MAX_CONTACTS, PACKED, PATIENCE, POINTS, live
from oip.wire import by_grpc_raw, by_json
from serving.fakes import cluster
from shipshape.v1 import shipshape_pb2 as pb

TOO_LITTLE = "expected memory for the answer, got too little: send less at a time"
LARGE = cluster(20_000)  # so many of them fill the largest body
SPARE_MB = 60  # less than the answer takes


@contextmanager
def short_of_memory(service, spare_mb):
    """The process behind the doors can allocate only so much more, until the end of the block."""
    pid = service.process.pid
    _, most = resource.prlimit(pid, resource.RLIMIT_AS)
    held = psutil.Process(pid).memory_info().vms
    resource.prlimit(pid, resource.RLIMIT_AS, (held + spare_mb * 2**20, most))
    try:
        yield
    finally:
        if service.process.poll() is None:
            resource.prlimit(pid, resource.RLIMIT_AS, (most, most))


def test_a_stage_that_cannot_allocate_is_told_over_each_door(service):
    with service.survives(internal=4):
        answer = service.ask_rest(contact_id="memory")
        assert (answer.status_code, answer.json()["detail"]) == (429, TOO_LITTLE)
        with pytest.raises(grpc.RpcError) as caught:
            service.ask_grpc(contact_id="memory")
        assert (caught.value.code(), caught.value.details()) == (grpc.StatusCode.RESOURCE_EXHAUSTED, TOO_LITTLE)
        inputs = {"points": POINTS, "contact_id": [b"memory"]}
        for infer, status in ((by_json, 429), (by_grpc_raw, grpc.StatusCode.RESOURCE_EXHAUSTED)):
            reply = infer(service, inputs)
            assert (reply.status, reply.error) == (status, TOO_LITTLE)


def test_it_costs_its_scan_nothing(service):
    with service.survives(internal=8):
        contacts = [pb.Contact(contact_id=name, points=POINTS.tobytes()) for name in ("memory", "other")] * 4
        scan = pb.RecogniseScanRequest(contacts=contacts)
        results = service.stub.RecogniseScan(scan, timeout=PATIENCE).results
        assert [result.error.kind for result in results] == [pb.ERROR_KIND_OVERLOADED, 0] * 4
        messages = [pb.RecogniseStreamRequest(sequence=n, contacts=contacts[:2]) for n in range(4)]
        for answer in service.stub.RecogniseStream(iter(messages), timeout=PATIENCE):
            assert [result.error.message for result in answer.results] == [TOO_LITTLE, ""]


def test_the_largest_scan_without_the_memory_for_its_answer(tmp_path):
    wishes = dict.fromkeys(("include_restored", "include_images", "include_png"), "true")
    query = {"counts": ",".join([str(len(LARGE))] * MAX_CONTACTS), **wishes}
    with live(tmp_path, warm=False) as service:
        with short_of_memory(service, SPARE_MB):
            answer = service.rest.post(
                "/v1/scan", params=query, content=LARGE.tobytes() * MAX_CONTACTS, headers=PACKED
            )
        assert (answer.status_code, answer.json()["error"]) == (413, "too_large")
        assert answer.json()["detail"].startswith(
            "expected a scan whose answer takes at most 64 MiB in JSON, got one"
        )
        service.answers_good_requests()
