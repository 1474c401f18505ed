"""Large JSON is parsed in another process: the same answers, nobody waits, and its death costs one request."""

import json
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from contract.test_forms import said
from serving.fakes import cluster, rows, running, until
from shipshape.serving.rest import json_process, requests
from shipshape.serving.rest.bodies import LARGE_JSON_BYTES

POINTS = cluster(20_000)
JSON = {"content-type": "application/json"}
PACKED = {"content-type": "application/octet-stream"}
LARGE = json.dumps({"points": rows(POINTS)}).encode()
SMALL = json.dumps({"points": rows(POINTS[:40])}).encode()
START_S = 120.0  # of a process, on a machine that has much else to do


@contextmanager
def patient():
    """A service that gives its process the time to start."""
    with running(default_timeout_ms=START_S * 1e3) as doors:
        doors.rest.timeout = START_S
        yield doors


@pytest.fixture(scope="module")
def large():
    """One service whose process has been started."""
    with patient() as doors:
        assert post(doors, LARGE).status_code == 200
        yield doors


def post(doors, content, path="/v1/recognise", **headers):
    return doors.rest.post(path, content=content, headers=JSON | headers)


def child():
    """The ids of all processes of this one that parse JSON."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(") ")[2].split()[1])
            command = (status.parent / "cmdline").read_bytes()
        except OSError:  # it has ended
            continue
        if parent == os.getpid() and b"json_child" in command:
            found.append(int(status.parent.name))
    return found


def test_it_gets_the_bytes_of_the_packed_form(large):
    packed = large.rest.post("/v1/recognise", content=POINTS.tobytes(), headers=PACKED)
    assert len(LARGE) > LARGE_JSON_BYTES
    assert said(post(large, LARGE)) == said(packed)


def test_a_large_scan_gets_the_bytes_of_the_packed_form(large):
    contacts = [POINTS[:9000], POINTS[:5], POINTS[9000:]]
    body = json.dumps({"contacts": [{"points": rows(points)} for points in contacts]}).encode()
    counts = ",".join(str(len(points)) for points in contacts)
    packed = np.concatenate(contacts).tobytes()
    by_bytes = large.rest.post("/v1/scan", params={"counts": counts}, content=packed, headers=PACKED)
    assert said(post(large, body, "/v1/scan")) == said(by_bytes)


def test_it_is_parsed_elsewhere(large, monkeypatch):
    monkeypatch.setattr(requests, "from_json", lambda *_, **__: 1 / 0)
    assert post(large, LARGE).status_code == 200
    assert post(large, SMALL).status_code == 500, "a small one is parsed here"


@pytest.mark.parametrize(
    ("body", "path"),
    [
        (LARGE[:-1], "/v1/recognise"),
        (b'{"colour": 1, ' + LARGE[1:], "/v1/recognise"),
        (LARGE.replace(b"[", b"[true, ", 40).replace(b"[true, [", b"[[", 1), "/v1/recognise"),
        (b"[" * 300_000, "/v1/recognise"),
        (b"\xff" * 300_000, "/v1/recognise"),
        (json.dumps({"points": [[1, 2, 3]] * 65537}).encode(), "/v1/recognise"),
        (json.dumps({"contacts": [{}] * 300_000}).encode(), "/v1/scan"),
        (b'{"contacts": [' + LARGE + b"], " + b'"bundle": 7}', "/v1/scan"),
    ],
    ids=[
        "cut",
        "unknown",
        "four columns",
        "deep",
        "no text",
        "too many points",
        "too many contacts",
        "wrong type",
    ],
)
def test_it_gets_the_error_of_a_small_one(large, monkeypatch, body, path):
    elsewhere = said(post(large, body, path))
    monkeypatch.setattr("shipshape.serving.rest.bodies.LARGE_JSON_BYTES", 2**40)
    assert said(post(large, body, path)) == elsewhere
    assert elsewhere[0] in (400, 413)


def test_contacts_of_a_large_scan_that_is_refused_are_counted(large):
    def counted():
        text = large.rest.get("/metrics").text
        return float(text.partition('shipshape_contacts_total{door="rest",outcome="too_large"} ')[2].split()[0])

    body = json.dumps({"contacts": [{}] * 100_000}).encode()
    assert post(large, body, "/v1/scan").status_code == 413
    before = counted()
    assert post(large, body, "/v1/scan").status_code == 413
    assert counted() == before + 100_000


def test_there_is_one_process_and_none_before_it_is_needed():
    before = child()
    with patient() as doors, ThreadPoolExecutor(4) as pool:
        assert post(doors, SMALL).status_code == 200
        assert child() == before
        codes = list(pool.map(lambda _: post(doors, LARGE).status_code, range(8)))
        assert codes == [200] * 8
        assert len(child()) == len(before) + 1
    assert child() == before, "it ends with the service"


@pytest.fixture
def pid(large):
    """Of the process that serves `large`, which has been stopped and does nothing."""
    assert post(large, LARGE).status_code == 200
    (found,) = child()
    os.kill(found, signal.SIGSTOP)
    return found


@pytest.fixture
def pool():
    with ThreadPoolExecutor(2) as pool:
        yield pool


def test_nobody_else_waits_for_it(large, pid, pool):
    waiting = pool.submit(post, large, LARGE)
    until(lambda: 'shipshape_in_flight{door="rest"} 1.0' in large.rest.get("/metrics").text)
    assert post(large, SMALL).status_code == 200
    assert large.rest.get("/livez").status_code == 200
    assert not waiting.done()
    os.kill(pid, signal.SIGCONT)
    assert waiting.result(START_S).status_code == 200


def test_its_death_costs_the_request_that_it_died_over(large, pid, pool):
    waiting = pool.submit(post, large, LARGE)
    until(lambda: 'shipshape_in_flight{door="rest"} 1.0' in large.rest.get("/metrics").text)
    os.kill(pid, signal.SIGKILL)
    answer = waiting.result(START_S)
    if answer.status_code != 200:  # else it was killed before the body was on its way, and was replaced
        assert (answer.status_code, answer.json()["error"]) == (503, "not_ready")
        assert answer.json()["detail"].startswith("expected a process that parses JSON, got one that died")
    assert post(large, LARGE).status_code == 200


def test_its_death_between_bodies_costs_nothing(large, pid):
    os.kill(pid, signal.SIGKILL)
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    assert post(large, LARGE).status_code == 200


def test_one_that_does_nothing_is_replaced(large, pid, monkeypatch):
    monkeypatch.setattr(json_process, "PARSE_S", 0.2)
    assert post(large, LARGE).status_code == 503
    monkeypatch.undo()
    assert not Path(f"/proc/{pid}").exists()
    assert post(large, LARGE).status_code == 200


def test_the_deadline_holds_though_it_does_nothing(large, pid):
    timeout = {"Shipshape-Timeout-Ms": "100"}
    for _ in range(2):  # the second waits behind the first
        answer = post(large, LARGE, **timeout)
        assert (answer.status_code, answer.json()["error"]) == (504, "deadline_exceeded")
    os.kill(pid, signal.SIGCONT)
    assert post(large, LARGE).status_code == 200


def test_signals_that_mean_the_service_do_not_end_it(large, pid):
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGCONT):
        os.kill(pid, number)
    assert post(large, LARGE).status_code == 200
    assert child() == [pid]


def test_it_ends_when_the_service_is_gone():
    orphan = json_process._Child()
    orphan._within(START_S, orphan._pipe.recv)
    orphan._pipe.close()
    assert orphan._process.wait(START_S) == 0
