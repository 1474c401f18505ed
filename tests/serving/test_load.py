"""Overload, deadlines, callers that leave, and draining: through both doors."""

import socket
from concurrent.futures import ThreadPoolExecutor

import grpc
import httpx
import pytest
from grpc_health.v1 import health_pb2
from grpc_health.v1.health_pb2_grpc import HealthStub

from serving.fakes import HALF, PATIENCE, cluster, refuses, request, rows, running, until
from shipshape.v1 import shipshape_pb2 as pb

POINTS = cluster()
SMALL = {"queue_limit": 2, "max_contacts": 2}


@pytest.fixture
def pool():
    with ThreadPoolExecutor(8) as pool:
        yield pool


def hold(doors):
    """Occupy the only worker; the future of the answer that comes once `release` is set."""
    call = doors.stub.Recognise.future(request(POINTS, contact_id="hold"), timeout=PATIENCE)
    assert doors.pipeline.entered.acquire(timeout=PATIENCE)
    doors.kept.append(call)  # gRPC cancels a call that nobody holds
    return call


def fill(doors):
    """Fill the queue behind the held worker."""
    contacts = [pb.Contact(points=POINTS.tobytes())] * 2
    call = doors.stub.RecogniseScan.future(pb.RecogniseScanRequest(contacts=contacts), timeout=PATIENCE)
    until(lambda: doors.service.executor.queue_depth == 2)
    return call


def test_a_full_queue_refuses_at_once_and_serves_again_later():
    with running(**SMALL) as doors:
        held, queued = hold(doors), fill(doors)
        response = doors.ask_rest(POINTS)
        assert response.status_code == 429
        assert response.json()["detail"] == "expected at most 0 more in the queue of 2, got 1"
        with pytest.raises(grpc.RpcError) as caught:
            doors.ask_grpc(POINTS)
        assert caught.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        scan = doors.rest.post("/v1/scan", json={"contacts": [{"points": rows(POINTS)}] * 2})
        assert scan.status_code == 429
        assert doors.rest.get("/livez").status_code == 200
        doors.pipeline.release.set()
        assert held.result().recognition.vessel == "tug"
        assert len(queued.result().results) == 2
        assert doors.ask_rest(POINTS).status_code == 200


def test_the_callers_deadline_holds_though_the_worker_is_busy():
    with running() as doors:
        hold(doors)
        response = doors.ask_rest(POINTS, contact_id="late", headers={"Shipshape-Timeout-Ms": "50"})
        assert (response.status_code, response.json()["error"]) == (504, "deadline_exceeded")
        with pytest.raises(grpc.RpcError) as caught:
            doors.ask_grpc(POINTS, timeout=0.05, contact_id="late")
        assert caught.value.code() is grpc.StatusCode.DEADLINE_EXCEEDED
        until(lambda: doors.service.executor.queue_depth == 0)
        doors.pipeline.release.set()
        doors.ask_grpc(POINTS, contact_id="next")
        assert "late" not in doors.pipeline.computed


def test_without_a_deadline_the_default_holds():
    with running(default_timeout_ms=50) as doors:
        hold(doors)
        assert doors.ask_rest(POINTS).status_code == 504
        with pytest.raises(grpc.RpcError) as caught:
            doors.ask_grpc(POINTS, timeout=None)
        assert caught.value.code() is grpc.StatusCode.DEADLINE_EXCEEDED


def test_a_late_scan_as_a_whole_is_late():
    with running() as doors:
        hold(doors)
        scan = doors.rest.post(
            "/v1/scan",
            json={"contacts": [{"points": rows(POINTS)}, {"points": []}]},
            headers={"Shipshape-Timeout-Ms": "50"},
        )
        assert scan.status_code == 504


def test_a_scan_keeps_the_answers_that_came_in_time(pool):
    with running() as doors:
        held = [{"contact_id": "hold", "points": rows(POINTS)}]
        contacts = [{"contact_id": "quick", "points": rows(POINTS)}, *held]
        headers = {"Shipshape-Timeout-Ms": "1000"}
        scan = doors.rest.post("/v1/scan", json={"contacts": contacts}, headers=headers)
        assert scan.status_code == 200
        quick, late = scan.json()["results"]
        assert quick["recognition"]["vessel"] == "tug"
        assert late["error"]["error"] == "deadline_exceeded"


def test_work_of_a_grpc_caller_that_left_is_dropped():
    with running() as doors:
        hold(doors)
        leaving = doors.stub.Recognise.future(request(POINTS, contact_id="left"), timeout=PATIENCE)
        until(lambda: doors.service.executor.queue_depth == 1)
        leaving.cancel()
        until(lambda: doors.service.executor.queue_depth == 0)
        doors.pipeline.release.set()
        doors.ask_grpc(POINTS, contact_id="next")
        assert "left" not in doors.pipeline.computed
        assert doors.service.executor.counts().cancelled == 1


def test_work_of_a_rest_caller_that_left_is_dropped():
    with running() as doors:
        hold(doors)
        packed = POINTS.tobytes()
        head = (
            "POST /v1/recognise?contact_id=left HTTP/1.1\r\nHost: x\r\n"
            f"Content-Type: application/octet-stream\r\nContent-Length: {len(packed)}\r\n\r\n"
        )
        with socket.create_connection(("127.0.0.1", doors.addresses.rest_port)) as client:
            client.sendall(head.encode() + packed)
            until(lambda: doors.service.executor.queue_depth == 1)
        until(lambda: doors.service.executor.queue_depth == 0)
        doors.pipeline.release.set()
        doors.ask_grpc(POINTS, contact_id="next")
        assert "left" not in doors.pipeline.computed


def test_stopping_refuses_new_requests_and_ends_those_under_way(pool):
    with running() as doors:
        held = hold(doors)
        waiting = pool.submit(doors.ask_rest, POINTS)
        until(lambda: doors.service.executor.queue_depth == 1)
        stopping = pool.submit(doors.service.stop)
        until(lambda: refuses(doors))
        doors.pipeline.release.set()
        assert held.result().recognition.vessel == "tug"
        assert waiting.result().status_code == 200
        stopping.result()
        with pytest.raises(httpx.TransportError):
            doors.rest.get("/livez")


def test_a_watcher_of_health_does_not_hold_up_the_stop(pool):
    with running(drain_s=10 * PATIENCE) as doors:
        watch = HealthStub(doors.channel).Watch(health_pb2.HealthCheckRequest())
        assert next(watch).status == health_pb2.HealthCheckResponse.SERVING
        stopping = pool.submit(doors.service.stop)
        assert next(watch).status == health_pb2.HealthCheckResponse.NOT_SERVING
        stopping.result(PATIENCE)


def test_a_caller_that_leaves_half_way_is_no_internal_error(caplog):
    with running() as doors:
        with socket.create_connection(("127.0.0.1", doors.addresses.rest_port)) as client:
            client.sendall(HALF)
            until(lambda: 'shipshape_in_flight{door="rest"} 1.0' in doors.rest.get("/metrics").text)
        cancelled = 'method="recognise",outcome="cancelled"} 1.0'
        until(lambda: cancelled in doors.rest.get("/metrics").text)
    assert "internal error" not in caplog.text


def test_thousands_of_mixed_requests_leave_nothing_behind(pool):
    with running(workers=2, queue_limit=256) as doors:
        good = request(POINTS)
        bad = request(POINTS[:3])

        def ask(index):
            try:
                if index % 4 == 3:
                    return doors.ask_rest(POINTS[: 3 if index % 8 == 3 else 40]).status_code
                doors.stub.Recognise(bad if index % 4 == 1 else good, timeout=PATIENCE)
            except grpc.RpcError as error:
                return error.code().name
            return "OK"

        outcomes = list(pool.map(ask, range(1200)))
        assert outcomes.count("OK") == 600
        assert outcomes.count("INVALID_ARGUMENT") == 300
        assert outcomes.count(200) == outcomes.count(422) == 150
        counts = doors.service.executor.counts()
        assert counts.completed == 750
        assert counts.pending == doors.service.executor.queue_depth == doors.service.executor.running == 0
