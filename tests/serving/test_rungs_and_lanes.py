"""Lanes, rungs and the age of what was seen, as callers of both doors meet them."""

import time

import grpc
import pytest

from serving.fakes import PATIENCE, cluster, running
from shipshape.executor import Lane
from shipshape.types import Rung
from shipshape.v1 import shipshape_pb2 as pb

POINTS = cluster()
LONG_S = 1e3  # that a stage is believed to take, far beyond any deadline of these tests


@pytest.fixture(scope="module")
def slow():
    """A service that believes its second stage to take very long."""
    with running() as doors:
        for _ in range(100):
            doors.service.executor._costs.learn(doors.pipeline.stages[1], len(POINTS), LONG_S)
        yield doors


def test_a_short_deadline_gets_a_cheaper_answer_that_says_why(slow):
    answer = slow.ask_rest(POINTS).json()
    assert answer["rung"] == "heading_and_box"
    assert list(answer["stage_ms"]) == ["prior"]
    assert "ms left" in answer["rung_reason"]
    found = slow.ask_grpc(POINTS)[0].recognition
    assert found.rung == "heading_and_box"
    assert "ms left" in found.rung_reason


def test_it_is_counted_as_degraded(slow):
    slow.ask_rest(POINTS)
    slow.ask_grpc(POINTS)
    slow.rest.post("/v1/scan", json={"contacts": [{"points": POINTS.tolist()}]})
    metrics = slow.rest.get("/metrics").text
    for door, method in [("rest", "recognise"), ("grpc", "recognise")]:
        assert f'shipshape_request_seconds_count{{door="{door}",method="{method}",outcome="degraded"}}' in metrics
    assert 'shipshape_contacts_total{door="rest",outcome="degraded"}' in metrics
    assert slow.service.executor.counts().degraded >= 3


def test_a_caller_may_forbid_it(slow):
    held = slow.ask_rest(POINTS, lowest_rung="full").json()
    assert held["rung"] == "full", "nothing waits: it may try"
    options = pb.Options(lowest_rung=pb.RUNG_FULL)
    assert slow.ask_grpc(POINTS, options)[0].recognition.rung == "full"


def test_who_is_refused_is_told_when_to_come_back():
    with running(workers=1, queue_limit=256) as doors:
        stage = doors.pipeline.stages[1]
        doors.service.executor._costs.learn(stage, len(POINTS), LONG_S)
        future = doors.stub.Recognise.future(held_request(), timeout=5 * PATIENCE)
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        doors.service.executor._costs._lines.clear()
        doors.service.executor._costs.learn(stage, len(POINTS), PATIENCE / 2)
        refused = doors.ask_rest(POINTS, lowest_rung="full")
        assert refused.status_code == 429, refused.text
        assert refused.json()["error"] == "overloaded"
        assert int(refused.headers["Retry-After"]) >= 1
        assert int(refused.headers["Shipshape-Retry-After-Ms"]) > 0
        with pytest.raises(grpc.RpcError) as error:
            doors.ask_grpc(POINTS, pb.Options(lowest_rung=pb.RUNG_FULL))
        assert error.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED
        assert int(dict(error.value.trailing_metadata())["grpc-retry-pushback-ms"]) > 0
        doors.pipeline.release.set()
        assert future.result().recognition.rung == "full"


def held_request():
    contact = pb.Contact(points=POINTS.astype("<f4").tobytes(), contact_id="hold")
    return pb.RecogniseRequest(contact=contact, options=pb.Options(lowest_rung=pb.RUNG_FULL))


@pytest.fixture(scope="module")
def doors():
    with running() as doors:
        yield doors


@pytest.mark.parametrize(("name", "number"), [(lane.value, pb.Lane.Value(f"LANE_{lane.name}")) for lane in Lane])
def test_every_lane_is_known_to_both_doors(doors, name, number):
    assert doors.ask_rest(POINTS, lane=name).status_code == 200
    doors.ask_grpc(POINTS, pb.Options(lane=number))
    assert f'shipshape_queue_seconds_count{{lane="{name}"}}' in doors.rest.get("/metrics").text


@pytest.mark.parametrize("rung", list(Rung))
def test_every_rung_is_known_to_both_doors(doors, rung):
    assert doors.ask_rest(POINTS, lowest_rung=rung.value).status_code == 200
    doors.ask_grpc(POINTS, pb.Options(lowest_rung=pb.Rung.Value(f"RUNG_{rung.name}")))


def test_points_that_are_too_old_are_not_computed(doors):
    before = len(doors.pipeline.computed)
    seen = {"captured_at": time.time() - 3, "max_age_ms": 2000.0}
    late = doors.ask_rest(POINTS, **seen)
    assert late.status_code == 504
    assert "at most 2000 ms ago" in late.json()["detail"]
    with pytest.raises(grpc.RpcError) as error:
        doors.ask_grpc(POINTS, pb.Options(**seen))
    assert error.value.code() is grpc.StatusCode.DEADLINE_EXCEEDED
    assert len(doors.pipeline.computed) == before


def test_points_that_are_young_enough_are_answered_and_their_age_is_seen(doors):
    seen = {"captured_at": time.time(), "max_age_ms": 1e6}
    assert doors.ask_rest(POINTS, **seen).status_code == 200
    doors.ask_grpc(POINTS, pb.Options(**seen))
    assert "shipshape_age_seconds_count 0" not in doors.rest.get("/metrics").text


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"captured_at": time.time() + 1e4}, "in the future"),
        ({"captured_at": float("nan")}, "captured_at in seconds"),
        ({"max_age_ms": 100.0}, "captured_at beside max_age_ms"),
        ({"captured_at": 1.0, "max_age_ms": 0.0}, "max_age_ms above 0"),
    ],
)
def test_an_age_that_cannot_be_is_refused(doors, options, said):
    with pytest.raises(grpc.RpcError) as error:
        doors.ask_grpc(POINTS, pb.Options(**options))
    assert error.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert said in error.value.details()
    query = {name: str(value) for name, value in options.items()}
    packed = {"content": POINTS.astype("<f4").tobytes(), "headers": {"Content-Type": "application/octet-stream"}}
    refused = doors.rest.post("/v1/recognise", params=query, **packed)
    assert refused.status_code == 400
    assert said in refused.json()["detail"]


@pytest.mark.parametrize("wrong", [pb.Options(lane=9), pb.Options(lowest_rung=9)])
def test_numbers_that_the_contract_does_not_know_are_refused(doors, wrong):
    with pytest.raises(grpc.RpcError) as error:
        doors.ask_grpc(POINTS, wrong)
    assert error.value.code() is grpc.StatusCode.INVALID_ARGUMENT


def test_readiness_falls_while_a_worker_is_stuck(monkeypatch):
    monkeypatch.setattr("shipshape.executor.crew.WEDGED_S", 0.05)
    with running(workers=1) as doors:
        future = doors.stub.Recognise.future(held_request(), timeout=PATIENCE)
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        _until_ready_is(doors, 503)
        doors.pipeline.release.set()
        future.result()
        _until_ready_is(doors, 200)


def _until_ready_is(doors, status):
    end = time.monotonic() + PATIENCE
    while doors.rest.get("/readyz").status_code != status:
        assert time.monotonic() < end
        time.sleep(0.01)
