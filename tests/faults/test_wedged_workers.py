"""Workers stuck in a stage: the service says so, deadlines hold meanwhile, and it comes back by itself."""

import threading
from contextlib import contextmanager, suppress

import grpc
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub

from faults.live import PATIENCE, POINTS, WORKERS, eventually
from serving.fakes import request
from shipshape.v1 import shipshape_pb2 as pb

SERVING, NOT_SERVING = health_pb2.HealthCheckResponse.SERVING, health_pb2.HealthCheckResponse.NOT_SERVING
SOON_S = 1.0
# Where a stuck worker can be set free it gives its answer; where it is a process, it may be ended instead.
ENDS = (grpc.StatusCode.OK, grpc.StatusCode.UNAVAILABLE)


@contextmanager
def stuck(service, workers):
    """So many workers are stuck until the end of the block; it begins when the service says so."""
    told = []
    watch = HealthStub(service.channel).Watch(health_pb2.HealthCheckRequest())
    threading.Thread(target=_note, args=(watch, told), daemon=True).start()
    eventually(lambda: told[-1:] == [SERVING])
    told.clear()
    wedge = request(POINTS, contact_id="wedge")
    calls = [service.stub.Recognise.future(wedge, timeout=PATIENCE) for _ in range(workers)]
    eventually(lambda: NOT_SERVING in told or not service.ready())
    try:
        yield
        service.release.touch()
        for call in calls:
            call.exception(PATIENCE)
            assert call.code() in ENDS
        eventually(service.ready)
    finally:
        service.release.touch()
        watch.cancel()
    service.release.unlink()


def _note(watch, told):
    with suppress(grpc.RpcError):  # it is cancelled in the end
        told.extend(answer.status for answer in watch)


def test_deadlines_hold_while_all_workers_are_stuck_and_what_waits_is_answered_after(service):
    contact = pb.Contact(contact_id="late", points=POINTS.tobytes())
    message = pb.RecogniseStreamRequest(sequence=1, contacts=[contact], timeout_ms=SOON_S * 1e3)
    with service.survives(internal=None):
        with stuck(service, WORKERS):
            waiting = service.stub.Recognise.future(request(POINTS, contact_id="waiting"), timeout=PATIENCE)
            unary = service.stub.Recognise.future(pb.RecogniseRequest(contact=contact), timeout=SOON_S)
            streamed = service.stub.RecogniseStream(iter([message]), timeout=PATIENCE)
            answer = service.ask_rest(headers={"Shipshape-Timeout-Ms": str(SOON_S * 1e3)}, contact_id="late")
            assert (answer.status_code, answer.json()["error"]) == (504, "deadline_exceeded")
            assert isinstance(unary.exception(PATIENCE), grpc.RpcError)
            assert unary.code() is grpc.StatusCode.DEADLINE_EXCEEDED
            assert [late.error.kind for late in streamed] == [pb.ERROR_KIND_DEADLINE_EXCEEDED]
        assert waiting.result().recognition.contact_id == "waiting"


def test_the_other_worker_goes_on_while_one_is_stuck(service):
    with service.survives(internal=None), stuck(service, 1):
        assert service.health.get("/livez").status_code == 200
        for _ in range(20):
            assert service.ask_rest().status_code == 200
