"""What callers that are slow, idle or greedy can take from the others: nothing."""

import socket
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress

import grpc
import httpx
import pytest
from grpc_reflection.v1alpha import reflection_pb2
from grpc_reflection.v1alpha.reflection_pb2_grpc import ServerReflectionStub

from serving.fakes import HALF, HEAD, PATIENCE, cluster, refuses, request, running, until
from shipshape.serving.core import Core
from shipshape.serving.grpc.reflection import PLACES, BoundedReflection
from shipshape.serving.grpc.server import SPARE_THREADS
from shipshape.serving.rest.bodies import LARGEST_AT_ONCE

POINTS = cluster()
PACKED = POINTS.tobytes()
SMALL = {"queue_limit": 2, "max_contacts": 2}


@contextmanager
def raw(doors, content):
    """A connection to the REST door on which `content` was sent and nothing follows."""
    with socket.create_connection(("127.0.0.1", doors.addresses.rest_port), timeout=PATIENCE) as client:
        client.sendall(content)
        yield client


def status(client):
    return int(client.recv(65536).split()[1])


def in_flight(doors):
    text = doors.rest.get("/metrics").text
    return float(text.partition('shipshape_in_flight{door="rest"} ')[2].split()[0])


def idle_streams(doors, count):
    """Reflection streams that ask once and then stay; of each, whether it was answered."""
    for _ in range(count):
        end = time.monotonic() + PATIENCE

        def ask_and_stay(end=end):
            yield reflection_pb2.ServerReflectionRequest(list_services="")
            while time.monotonic() < end and not doors.pipeline.release.wait(0.05):
                pass

        stream = ServerReflectionStub(doors.channel).ServerReflectionInfo(ask_and_stay(), timeout=PATIENCE)
        doors.kept.append(stream)
        try:
            next(stream)
            yield True
        except grpc.RpcError as error:
            yield error.code() is not grpc.StatusCode.RESOURCE_EXHAUSTED


def test_idle_reflection_streams_leave_threads_to_the_others():
    with running(**SMALL) as doors:
        answered = list(idle_streams(doors, SMALL["queue_limit"] + 1 + SPARE_THREADS + 2))
        assert answered.count(True) == PLACES
        assert doors.ask_grpc(POINTS, timeout=2)[0].recognition.vessel == "tug"
        for stream in doors.kept:
            stream.cancel()
        until(lambda: all(idle_streams(doors, 1)))


def test_a_reflection_stream_ends_in_time(monkeypatch):
    monkeypatch.setattr(BoundedReflection.__init__, "__kwdefaults__", {"longest_s": 0.2})
    with running() as doors:
        assert list(idle_streams(doors, 1)) == [True]
        with pytest.raises(grpc.RpcError) as caught:
            next(doors.kept[0])
        assert caught.value.code() is grpc.StatusCode.CANCELLED


def test_the_deadline_covers_a_body_that_does_not_arrive():
    with (
        running() as doors,
        raw(doors, HEAD.format(4800).encode() + b"Shipshape-Timeout-Ms: 50\r\n\r\nabc") as client,
    ):
        assert status(client) == 504


def test_what_the_headers_tell_is_said_before_the_body_is_there():
    with running(opened=False) as doors, raw(doors, HALF) as client:
        assert status(client) == 503
    with running() as doors, raw(doors, HALF.replace(b"octet-stream", b"csv")) as client:
        assert status(client) == 415


def test_all_bodies_together_are_bounded():
    size = 2048
    most = LARGEST_AT_ONCE * size
    with running(max_body_bytes=size) as doors, ExitStack() as others:
        for _ in range(LARGEST_AT_ONCE):
            others.enter_context(raw(doors, HEAD.format(size).encode() + b"\r\n" + bytes(size - 1)))
        until(lambda: doors.ask_rest(POINTS[:10]).status_code == 429)
        refused = doors.ask_rest(POINTS[:10])
        assert refused.json()["detail"] == f"expected at most {most} bytes of requests at a time, got more"
        others.close()
        until(lambda: doors.ask_rest(POINTS[:10]).status_code == 200)


def test_headers_are_bounded():
    with running() as doors, httpx.Client(trust_env=False, timeout=PATIENCE) as client:
        url = f"http://127.0.0.1:{doors.addresses.rest_port}/livez"
        assert client.get(url, headers={"X-Long": "x" * 30_000}).status_code == 200
        with suppress(httpx.TransportError):  # the door may close before all was sent
            assert client.get(url, headers={"X-Long": "x" * 300_000}).status_code == 431
        assert client.get(url).status_code == 200


@pytest.mark.parametrize(("given", "expected"), [(None, 10), (5, 5), (5000, 3600), (3 * 3600, 3600)])
def test_the_longest_deadline_over_grpc(monkeypatch, given, expected):
    seen = []
    deadline_in = Core.deadline_in
    monkeypatch.setattr(Core, "deadline_in", lambda core, s: seen.append(s) or deadline_in(core, s))
    with running() as doors:
        doors.stub.Recognise(request(POINTS), timeout=given)
    assert seen == [pytest.approx(expected, abs=1)]


def test_a_stop_still_answers_a_request_whose_body_is_arriving():
    with running() as doors, ThreadPoolExecutor(1) as pool:
        with raw(doors, HEAD.format(len(PACKED)).encode() + b"\r\n" + PACKED[:100]) as client:
            until(lambda: in_flight(doors) == 1)
            stopping = pool.submit(doors.service.stop)
            until(lambda: refuses(doors))
            client.sendall(PACKED[100:])
            assert status(client) == 200
        stopping.result(PATIENCE)
