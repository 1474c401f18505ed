"""What HTTP/1.1 itself lets clients do, well-meaning or not: raw bytes against the REST door."""

import json
import re
import socket
import time

import pytest

from serving.fakes import HALF, HEAD, cluster, running, until
from serving.http_calls import LIVE, connected, in_flight, post, read, statuses
from shipshape.serving.rest import protocol

POINTS = cluster()
PACKED = POINTS.tobytes()
GOOD = HEAD.format(len(PACKED)).encode() + b"\r\n" + PACKED
SMUGGLED = b"0\r\n\r\n" + LIVE
MALFORMED = {
    "two lengths": post("Content-Length: 3", "Content-Length: 30", body=b"abc" + LIVE),
    "length and chunks": post(f"Content-Length: {len(SMUGGLED)}", "Transfer-Encoding: chunked", body=SMUGGLED),
    "chunks and length": post("Transfer-Encoding: chunked", f"Content-Length: {len(SMUGGLED)}", body=SMUGGLED),
    "chunks that are not last": post("Transfer-Encoding: chunked, identity", body=SMUGGLED),
    "nearly chunks": post("Transfer-Encoding: xchunked", body=SMUGGLED),
    "space before the colon": post("Transfer-Encoding : chunked", body=SMUGGLED),
    "length with a sign": post("Content-Length: +3", body=b"abc" + LIVE),
    "list of lengths": post("Content-Length: 3, 3", body=b"abc" + LIVE),
    "folded header": post("X: a\r\n b", "Content-Length: 0"),
    "null byte": post("X: a\0b", "Content-Length: 0"),
    "line feed alone": post("X: a\nY: b", "Content-Length: 0"),
    "return alone": post("X: a\rY: b", "Content-Length: 0"),
    "chunk size that is none": post("Transfer-Encoding: chunked", body=b"zz\r\nabc\r\n" + SMUGGLED),
    "chunk longer than told": post("Transfer-Encoding: chunked", body=b"1\r\nabc\r\n" + SMUGGLED),
    "no host": b"GET /livez HTTP/1.1\r\n\r\n" + LIVE,
    "two hosts": b"GET /livez HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n" + LIVE,
    "another version": b"GET /livez HTTP/2.0\r\nHost: x\r\n\r\n" + LIVE,
    "preface of HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "no version": b"GET /livez\r\nHost: x\r\n\r\n",
    "tunnel": b"CONNECT /livez HTTP/1.1\r\nHost: x\r\n\r\n" + LIVE,
    "handshake of TLS": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(40),
    "no method": b"FETCH /livez HTTP/1.1\r\nHost: x\r\n\r\n",
    "no path": b"GET http://x HTTP/1.1\r\nHost: x\r\n\r\n",
}


@pytest.mark.parametrize("name", MALFORMED)
def test_what_two_readers_could_read_differently_is_refused_and_nothing_behind_it_is_read(doors, name):
    assert statuses(doors, MALFORMED[name]) == [400]
    assert doors.rest.get("/readyz").status_code == 200


def test_a_refusal_of_the_parser_is_a_problem_like_all_others(doors):
    with connected(doors) as (client, answers):
        client.sendall(MALFORMED["no host"])
        status, headers, body = read(answers)
        problem = json.loads(body)
        assert headers["content-type"] == "application/problem+json"
        assert headers["connection"] == "close"
        assert (status, problem["status"], problem["error"]) == (400, 400, "invalid_input")
        assert problem["detail"] == "expected the header Host once, got it 0 times"
        assert headers["x-request-id"] == problem["request_id"] != ""


def test_what_came_whole_before_is_still_answered(doors):
    assert statuses(doors, GOOD + LIVE + MALFORMED["no host"]) == [200, 200]


def test_what_is_refused_before_its_body_came_does_not_spoil_the_connection(doors):
    with connected(doors) as (client, answers):
        client.sendall(HALF.replace(b"octet-stream", b"csv"))
        assert read(answers)[0] == 415
        client.sendall(bytes(4800 - 3) + LIVE)
        assert read(answers)[0] == 200


def test_one_request_never_gets_two_answers(doors):
    wrong = post("Transfer-Encoding: chunked").replace(b"octet-stream", b"csv")
    with connected(doors) as (client, answers):
        client.sendall(wrong)
        assert read(answers)[0] == 415
        client.sendall(b"zz\r\n" + LIVE)
        assert read(answers) is None


def test_a_body_that_goes_wrong_half_way_leaves_nothing_behind(caplog):
    with running() as doors:
        with connected(doors) as (client, answers):
            client.sendall(post("Transfer-Encoding: chunked", body=b"3\r\nabc\r\n"))
            until(lambda: in_flight(doors) == 1)
            client.sendall(b"zz\r\n")
            assert read(answers)[0] == 400
            until(lambda: in_flight(doors) == 0)
        assert 'method="recognise",outcome="cancelled"} 1.0' in doors.rest.get("/metrics").text
    assert not [record for record in caplog.records if record.levelname in ("ERROR", "CRITICAL")]


def test_http_1_0_needs_no_host_and_is_closed_when_answered(doors):
    assert statuses(doors, b"GET /livez HTTP/1.0\r\n\r\n") == [200]


@pytest.mark.parametrize("upgrade", ["h2c", "websocket", "TLS/1.2"])
@pytest.mark.parametrize("pieces", [1, 2])
def test_a_wish_for_another_protocol_is_passed_over(doors, upgrade, pieces):
    wish = post(f"Content-Length: {len(PACKED)}", "Connection: Upgrade, HTTP2-Settings", f"Upgrade: {upgrade}")
    with connected(doors) as (client, answers):
        if pieces == 1:
            client.sendall(wish + PACKED + LIVE)
        else:
            client.sendall(wish)
            client.sendall(PACKED)
            client.sendall(LIVE)
        (first, _, body), (second, _, _) = read(answers), read(answers)
        assert (first, second) == (200, 200)
        assert json.loads(body)["vessel"] == "tug"


def test_the_body_behind_such_a_wish_is_never_a_request_of_its_own(doors):
    wish = post(f"Content-Length: {len(LIVE)}", "Connection: Upgrade, close", "Upgrade: h2c")
    with connected(doors) as (client, answers):
        client.sendall(wish)
        client.sendall(LIVE)
        assert read(answers)[0] == 400, "12 bytes a point"
        assert read(answers) is None


def test_trailers_are_no_headers(tmp_path):
    tokens = tmp_path / "tokens"
    tokens.touch(mode=0o600)
    tokens.write_text("")
    chunked = post("Transfer-Encoding: chunked", body=b"0\r\nAuthorization: Bearer x\r\nAuthorization: y\r\n\r\n")
    with running(tokens_file=tokens) as doors, connected(doors) as (client, answers):
        client.sendall(chunked)
        status, _, body = read(answers)
        assert status == 401
        assert json.loads(body)["detail"].endswith("got none")


def test_requests_that_come_at_once_are_answered_in_their_order(doors):
    ask = [
        post(f"Content-Length: {len(PACKED)}", body=PACKED, path=f"/v1/recognise?contact_id={i}")
        for i in range(20)
    ]
    with connected(doors) as (client, answers):
        client.sendall(b"".join(ask))
        assert [json.loads(read(answers)[2])["contact_id"] for _ in ask] == [str(i) for i in range(20)]


def test_requests_that_come_at_once_are_bounded(monkeypatch):
    monkeypatch.setattr(protocol, "MOST_PIPELINED", 5)
    with running() as doors:
        assert statuses(doors, LIVE * 50) == [200] * 6
        assert doors.rest.get("/readyz").status_code == 200


def test_a_body_in_chunks_and_in_single_bytes(doors):
    chunks = b"".join(b"%x;name=value\r\n%b\r\n" % (48, PACKED[at : at + 48]) for at in range(0, len(PACKED), 48))
    content = post("Transfer-Encoding: chunked", body=chunks + b"0\r\nX-Sum: 7\r\n\r\n") + LIVE
    with connected(doors) as (client, answers):
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for byte in content:
            client.sendall(bytes([byte]))
        assert [read(answers)[0], read(answers)[0]] == [200, 200]


def test_expect_100_continue_is_told_to_go_on_but_not_who_is_refused_anyway(doors):
    with connected(doors) as (client, answers):
        client.sendall(post(f"Content-Length: {len(PACKED)}", "Expect: 100-continue"))
        assert answers.readline() == b"HTTP/1.1 100 Continue\r\n"
        assert answers.readline() == b"\r\n"
        client.sendall(PACKED)
        assert read(answers)[0] == 200
        client.sendall(post(f"Content-Length: {10**9}", "Expect: 100-continue"))
        assert read(answers)[0] == 413


def test_an_answer_leaves_in_one_piece(doors):
    with connected(doors) as (client, _):
        client.sendall(GOOD)
        head, _, body = client.recv(2**20).partition(b"\r\n\r\n")
        assert len(body) == int(re.search(rb"content-length: (\d+)", head)[1])


def test_a_head_without_a_body_leaves_too(doors):
    with connected(doors) as (client, answers):
        client.sendall(b"HEAD /livez HTTP/1.1\r\nHost: x\r\n\r\n")
        assert answers.readline().startswith(b"HTTP/1.1 405 ")
        while answers.readline() != b"\r\n":
            pass
        client.sendall(LIVE)
        assert read(answers)[0] == 200


def test_the_deadline_counts_from_the_first_byte():
    with running() as doors, connected(doors) as (client, answers):
        client.sendall(GOOD[:10])
        assert doors.rest.get("/livez").status_code == 200  # by now the door has seen it
        time.sleep(0.1)  # at least, which is all that matters
        client.sendall(GOOD[10:].replace(b"Host: x\r\n", b"Host: x\r\nShipshape-Timeout-Ms: 100\r\n"))
        status, _, body = read(answers)
        assert (status, json.loads(body)["error"]) == (504, "deadline_exceeded")
        assert json.loads(body)["detail"].endswith("got a request that is already late")
