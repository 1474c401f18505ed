"""The clock of the machine is set while requests are under way: only ages that callers tell follow it."""

import math
import os
import time
from concurrent.futures import ThreadPoolExecutor
from email.utils import parsedate_to_datetime
from pathlib import Path

import grpc
import pytest

from faults.live import PATIENCE, POINTS, QUEUE_LIMIT, WORKERS, eventually, live
from serving.fakes import request

LIBRARIES = sorted(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"))
pytestmark = pytest.mark.skipif(not LIBRARIES, reason="libfaketime is not installed")
STEPS = [3600, -3600, 0]  # seconds by which the clock is ahead, one after the other
SOON_S = 0.3
# Or refused at once, after the costs that were learned from the stuck stages of the other tests.
LATE = (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.RESOURCE_EXHAUSTED)


@pytest.fixture(scope="module")
def clocked(tmp_path_factory):
    """A service, and how to set its clock; its monotonic clocks go on as they do on a real machine."""
    folder = tmp_path_factory.mktemp("clock")

    (folder / "clock").write_text("+0")
    more = {
        "LD_PRELOAD": str(LIBRARIES[0]),
        "FAKETIME_TIMESTAMP_FILE": str(folder / "clock"),
        "FAKETIME_CACHE_DURATION": "1",  # seconds; to read the file for each look at a clock is slow
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
    }
    with live(folder, more=more) as service:

        def set_clock(ahead_s):
            """Until the end of the call, the service knows."""
            (folder / "next").write_text(f"{ahead_s:+d}")
            os.replace(folder / "next", folder / "clock")  # it must never be read half written
            eventually(lambda: abs(told_time(service) - time.time() - ahead_s) < 600)

        yield service, set_clock


def told_time(service):
    """What the service takes for the time: its web server dates each answer."""
    return parsedate_to_datetime(service.health.get("/livez").headers["date"]).timestamp()


@pytest.mark.parametrize("ahead_s", STEPS)
def test_deadlines_waits_and_the_budget_do_not_follow_the_clock(clocked, ahead_s):
    service, set_clock = clocked
    wedge = request(POINTS, contact_id="wedge")
    with service.survives(internal=None), ThreadPoolExecutor(1) as pool:
        stuck = [service.stub.Recognise.future(wedge, timeout=PATIENCE) for _ in range(WORKERS)]
        eventually(lambda: service.metric("shipshape_running") == WORKERS)
        waiting = service.stub.Recognise.future(request(POINTS), timeout=PATIENCE)
        waiting_too = pool.submit(service.ask_rest)
        late = service.stub.Recognise.future(request(POINTS), timeout=SOON_S)
        set_clock(ahead_s)
        late_too = service.ask_rest(headers={"Shipshape-Timeout-Ms": str(SOON_S * 1e3)})
        assert isinstance(late.exception(PATIENCE), grpc.RpcError), "not an hour later"
        assert late.code() in LATE
        assert late_too.status_code in (504, 429)
        service.release.touch()
        assert waiting.result().recognition.vessel, "not an hour too early"
        assert waiting_too.result().status_code == 200
        for call in stuck:
            call.exception(PATIENCE)
        service.release.unlink()
        budget = service.rest.get("/v1/capacity").json()["budget"]
        assert 0 <= budget["last_good_s"] < PATIENCE
        assert all(0 <= burn < math.inf for burn in budget["burn"].values())


@pytest.mark.parametrize("ahead_s", STEPS)
def test_ages_that_callers_tell_follow_the_clock(clocked, ahead_s):
    service, set_clock = clocked
    with service.survives():
        set_clock(ahead_s)
        now = time.time() + ahead_s
        wishes = {"max_age_ms": PATIENCE * 1e3}
        assert service.ask_rest(captured_at=now, **wishes).status_code == 200
        old = service.ask_rest(captured_at=now - 2 * PATIENCE, **wishes)
        assert (old.status_code, old.json()["error"]) == (504, "deadline_exceeded")
        future = service.ask_rest(captured_at=now + PATIENCE, **wishes)
        assert (future.status_code, future.json()["error"]) == (400, "invalid_input")


def test_when_to_come_back_does_not_follow_the_clock(clocked):
    service, set_clock = clocked
    with service.survives():
        slow = request(POINTS, contact_id="slow")
        calls = []
        for ahead_s in STEPS:
            calls += [service.stub.Recognise.future(slow, timeout=PATIENCE) for _ in range(QUEUE_LIMIT)]
            set_clock(ahead_s)
        for call in calls:
            call.exception(PATIENCE)
        refused = [call for call in calls if call.code() is not grpc.StatusCode.OK]
        assert refused
        for call in refused:
            assert call.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
            assert 0 <= int(dict(call.trailing_metadata())["grpc-retry-pushback-ms"]) < PATIENCE * 1e3
