"""Clients that are slow, that say nothing, and that are killed: whoever else asks does not notice."""

import random
import resource
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import httpx
import pytest

from faults.live import POINTS, eventually, without_proxies

SLOW, TURNS = 250, 4  # clients of each kind; bytes that each sends, one by one
BODY = POINTS.tobytes()
HEAD = (
    "POST /v1/recognise?contact_id=slow HTTP/1.1\r\nHost: x\r\n"
    f"Content-Type: application/octet-stream\r\nContent-Length: {len(BODY)}\r\n\r\n"
).encode()
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + b"\0\0\0\4\0\0\0\0\0"  # and empty SETTINGS
# HEADERS of stream 1 that are never ended, so that a server waits for the rest of them.
HALF_A_CALL = b"\0\0\1\1\0\0\0\0\1\x83" + b"\0\0\xff\x09\0\0\0\0\1"
KINDS = {
    "headers of REST": (b"", HEAD),
    "a body of REST": (HEAD, BODY),
    "a greeting of gRPC": (b"", PREFACE),
    "a call of gRPC": (PREFACE + HALF_A_CALL, bytes(TURNS)),
}


def test_a_thousand_slow_clients_hold_up_nobody(service):
    with service.survives(), ExitStack() as connections:
        before, clients = service.footprint().rss_mb, []
        for kind, (at_once, slowly) in KINDS.items():
            address = service.grpc_address if "gRPC" in kind else service.rest_address
            for _ in range(SLOW):
                client = connections.enter_context(socket.create_connection(address))
                client.sendall(at_once)
                clients.append((client, slowly))
        for turn in range(TURNS):
            for client, slowly in clients:
                client.sendall(slowly[turn : turn + 1])
            service.answers_good_requests()
        assert service.ready()
        assert service.metric("shipshape_in_flight") == SLOW, "the bodies that are on their way"
        assert service.footprint().rss_mb - before < 0.1 * len(clients)


@contextmanager
def few_files(service, more):
    """The service can open only so many more files and connections, until the end of the block."""
    pid = service.process.pid
    before, most = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    held = service.footprint().descriptors
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (held + more, most))
    try:
        yield
    finally:
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (before, most))


def test_more_clients_than_the_service_may_have_files(service):
    with service.survives(internal=None), few_files(service, more=20):
        with ExitStack() as connections:
            for address in (service.rest_address, service.grpc_address):
                for _ in range(60):
                    connections.enter_context(socket.create_connection(address)).sendall(b"P")
            assert service.ask_grpc().recognition.vessel, "over a connection that was there before"
        eventually(lambda: answers(service))


def answers(service):
    try:
        return service.ask_rest().status_code == 200
    except httpx.TransportError:
        return False


# Asks through every door in turn, without an end; the last request is one of which half is never sent.
ASKING = """
import http.client, itertools, socket, sys, threading
import grpc
from shipshape.v1 import shipshape_pb2 as pb, shipshape_pb2_grpc
rest, rpc, points = sys.argv[1], sys.argv[2], bytes.fromhex(sys.argv[3])
contact = pb.Contact(contact_id="slow", points=points)
stub = shipshape_pb2_grpc.ShipshapeStub(grpc.insecure_channel(rpc))
answered = threading.Barrier(5, action=lambda: print("asking", flush=True))
host, port = rest.split(":")
head = "POST /v1/recognise?contact_id=slow HTTP/1.1\\r\\nHost: x\\r\\nContent-Type: application/octet-stream\\r\\n"
def halves():
    with socket.create_connection((host, int(port))) as client:
        client.sendall(f"{head}Content-Length: {len(points)}\\r\\n\\r\\n".encode() + points[: len(points) // 2])
        yield client
        yield client.recv(1)
def unary():
    while True:
        yield stub.Recognise(pb.RecogniseRequest(contact=contact))
def streamed():
    messages = (pb.RecogniseStreamRequest(sequence=n, contacts=[contact]) for n in itertools.count())
    return stub.RecogniseStream(messages)
def rest_calls():
    connection = http.client.HTTPConnection(host, int(port))
    while True:
        headers = {"Content-Type": "application/octet-stream"}
        connection.request("POST", "/v1/recognise?contact_id=slow", points, headers)
        yield connection.getresponse().read()
def go_on(answers):
    next(answers)
    answered.wait()
    for answer in answers:
        pass
for start in (halves, unary, streamed, rest_calls):
    threading.Thread(target=go_on, args=(start(),)).start()
answered.wait()
"""


@pytest.mark.parametrize("seed", range(2))
def test_clients_that_are_killed_leave_nothing_behind(service, seed):
    addresses = [f"{host}:{port}" for host, port in (service.rest_address, service.grpc_address)]
    command = [sys.executable, "-c", ASKING, *addresses, BODY.hex()]
    with service.survives(), ExitStack() as clients:
        before = service.counts().settled
        for _ in range(2):
            client = clients.enter_context(
                subprocess.Popen(command, stdout=subprocess.PIPE, env=without_proxies(), text=True)
            )
            clients.callback(client.kill)
            assert client.stdout.readline() == "asking\n"
        moment = before + random.Random(seed).randrange(10, 60)
        eventually(lambda: service.counts().settled >= moment)
        clients.close()
        assert client.returncode == -signal.SIGKILL
