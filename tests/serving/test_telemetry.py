import asyncio
import json
import logging
import sys

import pytest
from prometheus_client import CollectorRegistry

from shipshape.budget import Budget
from shipshape.telemetry import JsonLines, Metrics, new_request_id, request_id


def record(message, exc_info=None):
    return logging.LogRecord("shipshape.x", logging.ERROR, __file__, 1, message, (), exc_info)


def test_a_log_line_is_one_object():
    new_request_id("voyage-7")
    try:
        raise ValueError("two\nlines")
    except ValueError:
        text = JsonLines().format(record("it ünder\nbroke", sys.exc_info()))
    assert "\n" not in text
    line = json.loads(text)
    assert (line["level"], line["message"], line["request_id"]) == ("error", "it ünder\nbroke", "voyage-7")
    assert "ValueError" in line["traceback"]
    assert line["time"].endswith("Z")


def test_no_request_no_id():
    request_id.set("")
    assert "request_id" not in json.loads(JsonLines().format(record("start")))


@pytest.mark.parametrize("proposed", ["", "x" * 65, "a b", "a\nb", '"', "é"])
def test_an_id_that_could_harm_a_log_is_replaced(proposed):
    chosen = new_request_id(proposed)
    assert chosen != proposed
    assert len(chosen) == 16
    assert request_id.get() == chosen


def test_a_request_is_timed_though_it_fails():
    metrics = Metrics(CollectorRegistry(), Budget(0.05))

    def fail():
        with metrics.request("rest", "recognise") as outcome:
            outcome.kind = "internal"
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    labels = {"door": "rest", "method": "recognise", "outcome": "internal"}
    assert metrics.registry.get_sample_value("shipshape_request_seconds_count", labels) == 1
    assert metrics.registry.get_sample_value("shipshape_in_flight", {"door": "rest"}) == 0


@pytest.mark.parametrize(("error", "kind"), [(asyncio.CancelledError, "cancelled"), (MemoryError, "internal")])
def test_a_request_that_was_broken_off_is_not_ok(error, kind):
    metrics = Metrics(CollectorRegistry(), Budget(0.05))
    with pytest.raises(error), metrics.request("rest", "recognise"):
        raise error
    labels = {"door": "rest", "method": "recognise", "outcome": kind}
    assert metrics.registry.get_sample_value("shipshape_request_seconds_count", labels) == 1
    assert metrics.registry.get_sample_value("shipshape_contacts_total", {"door": "rest", "outcome": kind}) == 1


def test_two_services_in_one_process_do_not_share_metrics():
    first, second = Metrics(CollectorRegistry(), Budget(0.05)), Metrics(CollectorRegistry(), Budget(0.05))
    first.observe_stage("prior", 0.01)
    labels = {"stage": "prior"}
    assert first.registry.get_sample_value("shipshape_stage_seconds_count", labels) == 1
    assert second.registry.get_sample_value("shipshape_stage_seconds_count", labels) is None
