"""How a stream of RecogniseStream ends: by its caller, by what cannot be read, by want of room, by the service."""

import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import grpc
import pytest

from serving.fakes import PATIENCE, running, until
from serving.stream_calls import (
    OK,
    PACKED,
    POINTS,
    Call,
    errors,
    idle,
    message,
    no_sender_waits_for_ever,
    readers,
)
from shipshape.serving.grpc import server, streams
from shipshape.serving.grpc.streams import STREAMS
from shipshape.v1 import shipshape_pb2 as pb

EXHAUSTED, UNAVAILABLE = grpc.StatusCode.RESOURCE_EXHAUSTED, grpc.StatusCode.UNAVAILABLE

__all__ = ["no_sender_waits_for_ever"]


class ThreadThatCannotStart(threading.Thread):
    """Of readers alone: what else starts threads goes on."""

    def start(self):
        if self.name == "grpc-reader":
            raise RuntimeError("can't start new thread")
        super().start()


def test_work_of_a_caller_that_left_is_dropped():
    with running() as doors:
        call = Call(doors, message(1, "hold"), *(message(index, "left", "left") for index in range(2, 9)))
        until(lambda: doors.service.executor.queue_depth == 14)
        call.responses.cancel()
        until(lambda: doors.service.executor.queue_depth == 0)
        doors.pipeline.release.set()
        until(lambda: idle(doors) and not readers())
        assert "left" not in doors.pipeline.computed
        assert doors.service.executor.counts().cancelled == 15
        text = doors.rest.get("/metrics").text
        assert 'method="recognise_stream",outcome="cancelled"} 8.0' in text


KILLED = """
import itertools, sys, grpc
from shipshape.v1 import shipshape_pb2 as pb, shipshape_pb2_grpc
contact = pb.Contact(contact_id="hold", points=bytes.fromhex(sys.argv[2]))
messages = (pb.RecogniseStreamRequest(sequence=index, contacts=[contact]) for index in itertools.count())
stub = shipshape_pb2_grpc.ShipshapeStub(grpc.insecure_channel(sys.argv[1]))
list(stub.RecogniseStream(messages))
"""


def test_a_client_that_is_killed_leaves_nothing_behind():
    with running() as doors:
        address = f"127.0.0.1:{doors.addresses.grpc_port}"
        with subprocess.Popen([sys.executable, "-c", KILLED, address, PACKED.hex()]) as client:
            until(lambda: doors.service.executor.queue_depth == 255)
            client.send_signal(signal.SIGKILL)
        until(lambda: doors.service.executor.queue_depth == 0)
        doors.pipeline.release.set()
        until(lambda: idle(doors) and not readers())
        assert doors.ask_grpc(POINTS)[0].recognition.vessel == "tug"


def test_a_client_that_falls_silent_gives_its_place_back(monkeypatch):
    monkeypatch.setattr(server, "KEEPALIVE_MS", 100)
    monkeypatch.setattr(server, "KEEPALIVE_TIMEOUT_MS", 100)
    with running() as doors:
        address = f"127.0.0.1:{doors.addresses.grpc_port}"
        with subprocess.Popen([sys.executable, "-c", KILLED, address, PACKED.hex()]) as client:
            try:
                until(lambda: doors.service.executor.queue_depth == 255)
                client.send_signal(signal.SIGSTOP)  # its connection stays, and nobody answers behind it
                until(lambda: not doors.service.executor.queue_depth)
                doors.pipeline.release.set()
                until(lambda: idle(doors) and not readers())
            finally:
                client.kill()


@pytest.mark.parametrize(
    ("raw", "kind", "words"),
    [
        (b"\xff\xff\xff", "invalid_input", "expected a message of shipshape.v1, got 3 bytes"),
        (bytes(3000), "too_large", "expected at most 2048 bytes a request, got 3000"),
    ],
    ids=["no message", "too large"],
)
def test_what_cannot_be_read_ends_the_stream_after_the_answers(raw, kind, words):
    with running(max_body_bytes=2048) as doors:
        method = doors.channel.stream_stream("/shipshape.v1.Shipshape/RecogniseStream")
        good = message(1, "hold").SerializeToString()
        responses = method(iter([good, raw, good]), timeout=PATIENCE, metadata=(("x-request-id", "voyage-7"),))
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        doors.pipeline.release.set()
        assert pb.RecogniseStreamResponse.FromString(next(responses)).sequence == 1
        with pytest.raises(grpc.RpcError) as caught:
            next(responses)
        assert caught.value.code() is grpc.StatusCode.INVALID_ARGUMENT
        assert caught.value.details().startswith(words)
        trailing = dict(caught.value.trailing_metadata())
        assert (trailing["shipshape-error"], trailing["x-request-id"]) == (kind, "voyage-7")
        until(lambda: idle(doors) and not readers())


def test_streams_are_bounded_and_leave_the_others_their_threads():
    with running(queue_limit=2, max_contacts=2) as doors:
        calls = [Call(doors, message(1, "a")) for _ in range(STREAMS)]
        assert all(call.next().sequence == 1 for call in calls)
        refused = Call(doors)
        assert refused.rest() == ([], EXHAUSTED)
        assert refused.responses.details() == f"expected at most {STREAMS} streams at a time, got one more"
        assert doors.stub.GetModelInfo(pb.GetModelInfoRequest()).limits.max_streams == STREAMS
        assert doors.ask_grpc(POINTS)[0].recognition.vessel == "tug"
        calls[0].responses.cancel()
        until(lambda: Call(doors).close().rest()[1] is OK)
        for call in calls[1:]:
            assert call.close().rest() == ([], OK)
        until(lambda: not readers())


def test_streams_without_a_thread_take_no_place(monkeypatch):
    with running() as doors:
        monkeypatch.setattr(streams.threading, "Thread", ThreadThatCannotStart)
        for _ in range(STREAMS + 1):
            refused = Call(doors)
            assert refused.rest() == ([], EXHAUSTED)
            assert refused.responses.details() == "expected a thread for another stream, got none: come back later"
        monkeypatch.undo()
        assert Call(doors, message(1, "a")).next().sequence == 1


def test_a_stop_answers_what_was_read_then_is_unavailable():
    with running(drain_s=10 * PATIENCE) as doors, ThreadPoolExecutor(1) as pool:
        silent, busy = Call(doors), Call(doors, message(1, "hold"), message(2, "queued"))
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        until(lambda: doors.service.executor.queue_depth == 1)
        stopping = pool.submit(doors.service.stop)
        assert silent.rest() == ([], UNAVAILABLE)
        doors.pipeline.release.set()
        answers, code = busy.rest()
        assert (errors(answers), code) == ({1: "UNSPECIFIED", 2: "UNSPECIFIED"}, UNAVAILABLE)
        assert busy.responses.details() == "expected a running service, got one that is stopping"
        stopping.result(PATIENCE)
        until(lambda: not readers())


def test_a_service_that_starts_is_unavailable():
    with running(opened=False) as doors:
        assert Call(doors, message(1, "a")).rest() == ([], UNAVAILABLE)
