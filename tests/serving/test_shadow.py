"""A shadow bundle: what callers asked is computed by it too and compared, and no caller can tell."""

import json
import logging
import math
import threading
import time

import pytest
from prometheus_client.parser import text_string_to_metric_families

from serving.fakes import DIGEST, PATIENCE, cluster
from serving.shadowed import OTHER, administered, compared, service, shared
from shipshape.executor import Ticket
from shipshape.serving import shadow as module
from shipshape.serving.model import Reply
from shipshape.telemetry import JsonLines
from shipshape.types import Rung

__all__ = ["service", "shared"]


def test_the_same_bundle_says_the_same(service):
    found = service.call("shadow", folder="same")
    assert found["shadow"]["digest"] == found["bundle"]["digest"] == DIGEST
    service.ask(3)
    compared(service, same=3)
    assert service.shadow()["compared"] == 3


def test_another_bundle_differs_and_the_log_says_how(service, caplog):
    before = service.metrics()
    with caplog.at_level(logging.INFO, logger=module.__name__):
        found = service.call("shadow", folder="second")
        assert (found["shadow"]["name"], found["shadow"]["digest"], found["bundle"]["name"]) == (
            "second",
            OTHER,
            "fake",
        )
        service.ask(2, headers={"X-Request-Id": "from-the-bridge"})
        compared(service, differs=2)
    said = [record for record in caplog.records if record.name == module.__name__]
    assert [record.getMessage() for record in said] == ["the shadow says rhib, the running bundle tug"] * 2
    assert said[0].fields == {"running": "tug", "shadow": "rhib"}
    after = service.metrics()
    assert after["shipshape_shadow_info", OTHER, "second"] == 1
    grown = {key: value - before.get(key, 0) for key, value in after.items() if value != before.get(key, 0)}
    assert grown["shipshape_shadow_compared_total", "differs"] == 2
    assert grown["shipshape_shadow_probability_count",] == 2
    assert grown["shipshape_shadow_probability_sum",] == pytest.approx(1.0)
    assert grown["shipshape_shadow_heading_degrees_count", "same"] == 2
    text = service.doors.rest.get("/metrics").text
    assert f'shipshape_bundle_info{{digest="{DIGEST}",name="fake"}} 1.0' in text
    assert text.count("shipshape_bundle_info{") == 1


def test_the_log_line_names_the_request(service):
    lines, handler = [], logging.StreamHandler()
    handler.emit = lambda record: lines.append(json.loads(JsonLines().format(record)))
    logger = logging.getLogger(module.__name__)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        service.call("shadow", folder="second")
        service.ask(headers={"X-Request-Id": "from-the-bridge"})
        compared(service, differs=1)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
    assert [(line["request_id"], line["running"], line["shadow"]) for line in lines] == [
        ("from-the-bridge", "tug", "rhib")
    ]


def test_a_half_turn_is_told_apart_from_a_small_one(service):
    before = service.metrics()
    service.call("shadow", folder="turned")
    service.ask()
    compared(service, same=1)
    after = service.metrics()
    key = ("shipshape_shadow_heading_degrees_sum", "opposite")
    assert after[key] - before.get(key, 0.0) == pytest.approx(180 - 171.887, abs=0.01)


def test_a_shadow_that_fails_harms_nobody(service):
    service.call("shadow", folder="crash")
    offered = service.call("status")["contacts"]
    service.ask(4)
    compared(service, failed=4)
    status = service.call("status")
    assert status["contacts"] == {
        **offered,
        "offered": offered["offered"] + 4,
        "completed": offered["completed"] + 4,
    }
    assert status["ready"]
    assert service.doors.service.executor.counts(spare=True).failed >= 4


def test_every_door_and_every_contact_of_a_scan_is_compared(service):
    service.call("shadow", folder="second")
    doors = service.doors
    doors.ask_grpc(cluster(), contact_id="one")
    points = [{"points": cluster().astype(float).tolist(), "contact_id": str(index)} for index in range(3)]
    bad = {"points": [[0.0, 0.0, 0.0]]}
    answer = doors.rest.post("/v1/scan", json={"contacts": [*points, bad]})
    assert [("recognition" in result) for result in answer.json()["results"]] == [True, True, True, False]
    compared(service, differs=4)


def test_what_is_asked_in_the_shadow_counts_for_no_caller(service):
    doors, executor = service.doors, service.doors.service.executor
    service.call("shadow", folder="second")

    def callers():
        text = doors.rest.get("/metrics").text
        names = ("shipshape_contacts_total", "shipshape_budget_total", "shipshape_queue_seconds_count")
        return {
            (sample.name, *sample.labels.values()): sample.value
            for family in text_string_to_metric_families(text)
            for sample in family.samples
            if sample.name in names
        }

    before, offered, spare = callers(), executor.counts(), executor.counts(spare=True)
    service.ask(5)
    compared(service, differs=5)
    grown = {key: value - before.get(key, 0) for key, value in callers().items()}
    assert {key: value for key, value in grown.items() if value} == {
        ("shipshape_contacts_total", "rest", "ok"): 5,
        ("shipshape_budget_total", "true"): 5,
        ("shipshape_queue_seconds_count", "tracking"): 5,
    }
    after = executor.counts()
    assert (after.offered - offered.offered, after.completed - offered.completed, after.pending) == (5, 5, 0)
    own = executor.counts(spare=True)
    assert (own.offered - spare.offered, own.completed - spare.completed, own.pending) == (10, 10, 0)


@pytest.mark.parametrize("end", ["degraded", "failed", "cancelled"])
def test_what_was_not_answered_in_full_is_not_compared(service, end):
    service.call("shadow", folder="same")
    ticket = Ticket(math.inf, time.monotonic)
    service.doors.service.models.comparing._run.sample(1.0, ticket, None, None)
    if end == "degraded":
        ticket.succeed(Reply(b"", Rung.HEADING_AND_BOX, {}))
    elif end == "failed":
        ticket.fail(RuntimeError("planned"))
    else:
        ticket.future.cancel()
    service.ask()
    compared(service, same=1)


def test_what_finds_no_room_is_dropped(service):
    """The shadow holds its worker; the other one answers callers as ever."""
    service.call("shadow", folder="hold")
    service.ask()
    pipeline = service.loaded["hold"]
    assert pipeline.halted.acquire(timeout=PATIENCE)
    service.ask(module.BACKLOG + 3)
    compared(service, dropped=3)
    pipeline.proceed.set()
    compared(service, dropped=3, same=module.BACKLOG + 1)


def test_nothing_is_compared_while_workers_are_short(tmp_path, monkeypatch):
    """Of one worker, half a contact under way is already too much."""
    with administered(tmp_path, workers=1) as service:
        doors, pipeline = service.doors, service.doors.pipeline
        service.call("shadow", folder="second")
        held = threading.Thread(target=doors.ask_rest, args=(cluster(),), kwargs={"contact_id": "hold"})
        service.ask()
        compared(service, differs=1)
        held.start()
        assert pipeline.entered.acquire(timeout=PATIENCE)
        run = doors.service.models.comparing._run
        looks = iter([False, False, False, True])
        monkeypatch.setattr(run._ended, "wait", lambda patience: next(looks))
        assert not run._has_room(0.0), "it looked three times, and then came the end"
        monkeypatch.undo()
        pipeline.release.set()
        held.join(PATIENCE)


def test_a_share_of_the_contacts_is_compared(tmp_path, monkeypatch):
    chances = iter([0.2, 0.3, 0.24, 0.9])
    with administered(tmp_path, shadow_share=0.25) as service:
        service.call("shadow", folder="second")
        monkeypatch.setattr(module.random, "random", lambda: next(chances))
        service.ask(4)
        compared(service, differs=2)
