"""What one connection may bring, and how many there may be: beyond, the REST door says so and closes."""

import json
import select
import socket
import sys
from contextlib import suppress

import pytest

from serving.fakes import HALF, running, until
from serving.http_calls import LIVE, connected, in_flight, post, read, statuses
from shipshape.serving.rest import protocol


@pytest.mark.parametrize(
    "content",
    [
        b"GET /livez HTTP/1.1\r\nHost: x\r\nX: " + b"x" * 70_000 + b"\r\n\r\n",
        b"GET /livez HTTP/1.1\r\nHost: x\r\n" + b"X: y\r\n" * 20_000 + b"\r\n",
        b"GET /" + b"x" * 70_000 + b" HTTP/1.1\r\nHost: x\r\n\r\n",
    ],
    ids=["one header", "many headers", "path"],
)
def test_headers_over_the_limit_are_431(doors, content):
    with connected(doors) as (client, answers):
        client.sendall(content)
        status, headers, body = read(answers)
        assert (status, json.loads(body)["error"]) == (431, "too_large")
        assert headers["connection"] == "close"


@pytest.mark.parametrize(
    "begin",
    [
        b"GET /livez HTTP/1.1\r\nHost: x\r\nX: ",
        post("Transfer-Encoding: chunked", body=b"0\r\nX: "),
        post("Transfer-Encoding: chunked", body=b"1;x="),
    ],
    ids=["header", "trailer", "chunk extension"],
)
def test_what_never_ends_is_not_kept(doors, begin):
    with connected(doors) as (client, answers):
        client.sendall(begin)
        for _ in range(2**26 // 2**16):  # far more than the buffers between us hold
            client.sendall(b"x" * 2**16)
            if select.select([client], [], [], 0)[0]:
                break
        assert read(answers)[0] == 431


def test_headers_that_do_not_come_and_connections_that_say_nothing_are_closed(monkeypatch):
    monkeypatch.setattr(protocol, "HEAD_S", 0.05)
    monkeypatch.setattr("shipshape.serving.rest.server.KEEP_ALIVE_S", 0.05)
    with running() as doors:
        for begun in (b"", LIVE[:30]):
            with connected(doors) as (client, answers):
                client.sendall(begun)
                assert answers.read() == b""
        with connected(doors) as (client, answers):
            client.sendall(HALF)  # its body has until the deadline of the request
            until(lambda: in_flight(doors) == 1)


LARGE = b"999999"


@pytest.mark.parametrize("rest", [b"x", b"x" * int(LARGE), b"\r\n"], ids=["some", "all", "an empty line"])
def test_a_client_that_says_more_after_its_answer_and_then_nothing_is_sent_away(monkeypatch, rest):
    monkeypatch.setattr(protocol, "REST_S", 0.05)
    monkeypatch.setattr("shipshape.serving.rest.server.KEEP_ALIVE_S", 0.05)
    with running(max_body_bytes=1024) as doors:
        begun = LIVE if rest == b"\r\n" else post(f"Content-Length: {LARGE.decode()}")
        with connected(doors) as (client, answers):
            client.sendall(begun)
            assert read(answers)[0] in (200, 413)
            client.sendall(rest)
            with suppress(ConnectionResetError):  # some of it was not read
                assert answers.read() == b""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux watches who reads")
def test_a_client_that_never_reads_is_sent_away(monkeypatch, caplog):
    monkeypatch.setattr("shipshape.serving.rest.server.READ_S", 0.1)
    with running() as doors, connected(doors) as (client, _):
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.settimeout(0.05)
        until(lambda: _sent_away(client))
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


def _sent_away(client):
    """Ask once more, unless all buffers between us are full already."""
    try:
        client.sendall(b"GET /openapi.json HTTP/1.1\r\nHost: x\r\n\r\n")
    except TimeoutError:
        return False
    except OSError:
        return True
    return False


def test_too_many_connections_are_told_so(monkeypatch):
    monkeypatch.setattr(protocol, "MOST_CONNECTIONS", 3)
    with running() as doors:
        doors.rest.get("/livez")
        with connected(doors) as (first, answers), connected(doors) as (second, others):
            for client, file in ((first, answers), (second, others)):
                client.sendall(LIVE)
                assert read(file)[0] == 200
            with connected(doors) as (_, refused):
                status, _, body = read(refused)
                assert (status, json.loads(body)["error"]) == (429, "overloaded")
        until(lambda: statuses(doors, LIVE.replace(b"Host", b"Connection: close\r\nHost")) == [200])
