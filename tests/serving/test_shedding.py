"""What is refused before its body is read, and what is not."""

import socket
import threading

import pytest

from serving.fakes import HEAD, PATIENCE, cluster, running, until
from shipshape.errors import DeadlineExceeded, Overloaded
from shipshape.executor import Executor, Lane, Task

POINTS = cluster()
PACKED = {"content-type": "application/octet-stream"}
ASK = {"content": POINTS.tobytes(), "headers": PACKED}


def ask_behind_a_held_worker(doors, count):
    """Threads that ask: one whose contact keeps the worker, and `count` whose contacts wait behind it."""
    threads = [
        threading.Thread(target=doors.rest.post, args=(f"/v1/recognise?contact_id={name}",), kwargs=ASK)
        for name in ("hold", *range(count))
    ]
    threads[0].start()
    assert doors.pipeline.entered.acquire(timeout=PATIENCE)
    for thread in threads[1:]:
        thread.start()
    until(lambda: doors.service.executor.queue_depth == count)
    return threads


class Held:
    """An executor whose only worker is busy until `release`, on a clock of its own."""

    def __init__(self, limit):
        self.now, self.release = 1000.0, threading.Event()
        self.executor = Executor(1, limit, clock=lambda: self.now)
        self.rung = type("Rung", (), {"name": "only", "stages": (self,)})()
        self.name = "stage"
        self.fill(Lane.COLLISION, 1)
        until(lambda: self.executor.queue_depth == 0)

    def run(self, _):
        assert self.release.wait(PATIENCE)

    def fill(self, lane, count):
        for _ in range(count):
            self.executor.submit(Task([self.rung], None, lambda work, ended: None, self.now + 1e6, lane))


@pytest.fixture
def held():
    made = Held(8)
    yield made
    made.release.set()
    made.executor.stop(PATIENCE)


def test_an_empty_queue_lets_everybody_pass(held):
    for lane in Lane:
        held.executor.check(lane, held.now + 1e-6)


def test_who_is_late_is_told_so_before_anything_else(held):
    held.fill(Lane.COLLISION, 8)
    with pytest.raises(DeadlineExceeded):
        held.executor.check(Lane.COLLISION, held.now)


def test_each_lane_is_refused_when_its_share_of_the_queue_is_full(held):
    for depth in range(9):
        for lane, places in ((Lane.COLLISION, 8), (Lane.TRACKING, 7), (Lane.BATCH, 4)):
            if depth < places:
                held.executor.check(lane, held.now + 1e5)
                continue
            with pytest.raises(Overloaded, match=r"^expected at most 0 more in the queue of 8, got 1$") as caught:
                held.executor.check(lane, held.now + 1e5)
            assert caught.value.retry_after_s >= 0
        if depth < 8:
            held.fill(Lane.COLLISION, 1)


def test_who_has_no_time_behind_what_waits_is_told_how_long_that_is(held, monkeypatch):
    held.fill(Lane.TRACKING, 1)
    monkeypatch.setattr(held.executor, "wait", lambda lane: 3.0)
    held.executor.check(Lane.TRACKING, held.now + 5.0)
    with pytest.raises(Overloaded) as caught:
        held.executor.check(Lane.TRACKING, held.now + 1.0)
    assert str(caught.value) == "expected 4500 ms for an answer behind all that waits, got 1000 ms"
    assert caught.value.retry_after_s == pytest.approx(3.5)


def test_a_full_queue_refuses_before_the_body_is_there_and_counts_the_contacts():
    with running(queue_limit=2, max_contacts=2) as doors:
        threads = ask_behind_a_held_worker(doors, 2)
        with socket.create_connection(("127.0.0.1", doors.addresses.rest_port), timeout=PATIENCE) as client:
            client.sendall(HEAD.format(4800).encode() + b"\r\nabc")
            assert client.recv(100).startswith(b"HTTP/1.1 429 ")
        scan = doors.rest.post("/v1/scan?counts=20,20", content=POINTS.tobytes(), headers=PACKED)
        assert (scan.status_code, scan.json()["error"]) == (429, "overloaded")
        assert int(scan.headers["Retry-After"]) >= 1
        text = doors.rest.get("/metrics").text
        assert 'shipshape_contacts_total{door="rest",outcome="overloaded"} 3.0' in text
        doors.pipeline.release.set()
        for thread in threads:
            thread.join(PATIENCE)


def test_a_lane_that_only_the_body_tells_is_not_refused_for_another():
    """The place that is kept for collision is theirs, in JSON too."""
    with running(queue_limit=8, max_contacts=8) as doors:
        threads = ask_behind_a_held_worker(doors, 7)
        assert doors.rest.post("/v1/recognise", **ASK).status_code == 429
        assert doors.ask_rest(POINTS).status_code == 429
        urgent = threading.Thread(
            target=lambda: doors.kept.append(doors.ask_rest(POINTS, lane="collision").status_code)
        )
        urgent.start()
        until(lambda: doors.service.executor.queue_depth == 8)
        doors.pipeline.release.set()
        for thread in (*threads, urgent):
            thread.join(PATIENCE)
        assert doors.kept == [200]
