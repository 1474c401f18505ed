import json
import logging
import signal
import subprocess
import sys
import threading
from types import SimpleNamespace

import httpx
import pytest
from opentelemetry.proto.trace.v1.trace_pb2 import Status
from prometheus_client import CollectorRegistry

from serving.collector import attributes, collecting
from serving.fakes import PATIENCE, cluster, request, rows
from serving.processes import MODELS, start, stopped_by, until_ready
from shipshape import tracing
from shipshape.budget import Budget
from shipshape.errors import SettingsError
from shipshape.telemetry import JsonLines, Metrics, new_request_id
from shipshape.tracing import trace_id, traces
from shipshape.v1 import shipshape_pb2 as pb

TRACE, SPAN = "4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7"
SAMPLED, NOT_SAMPLED = f"00-{TRACE}-{SPAN}-01", f"00-{TRACE}-{SPAN}-00"
STAGES = ["stage prior", "stage heading"]  # of the fake pipeline


@pytest.fixture
def collector():
    with collecting() as collector:
        yield collector


def contact(points):
    return pb.Contact(points=points.astype("<f4").tobytes())


def oip(points):
    shape = {"shape": list(points.shape), "datatype": "FP32", "data": points.ravel().tolist()}
    return {"inputs": [{"name": "points", **shape}]}


ASKING = {
    "grpc recognise": lambda doors: doors.stub.Recognise(request(cluster()), timeout=PATIENCE),
    "grpc recognise_scan": lambda doors: doors.stub.RecogniseScan(
        pb.RecogniseScanRequest(contacts=[contact(cluster())] * 2), timeout=PATIENCE
    ),
    "grpc recognise_stream": lambda doors: list(
        doors.stub.RecogniseStream(
            iter([pb.RecogniseStreamRequest(sequence=1, contacts=[contact(cluster())] * 2)]), timeout=PATIENCE
        )
    ),
    "rest recognise": lambda doors: doors.ask_rest(cluster()),
    "rest recognise_scan": lambda doors: doors.rest.post(
        "/v1/scan", json={"contacts": [{"points": rows(cluster())}] * 2}
    ),
    "oip_rest infer": lambda doors: doors.rest.post("/v2/models/shipshape/infer", json=oip(cluster())),
}


@pytest.mark.parametrize("name", ASKING)
def test_a_request_of_each_door_is_a_span_with_one_a_stage(doors, collector, name):
    with traces(collector.url, 1.0):
        ASKING[name](doors)
    (root,) = collector.roots()
    assert root.name == name
    assert root.kind == root.SPAN_KIND_SERVER
    stages = collector.children(root)
    assert [span.name for span in stages] == STAGES
    ends = [span.end_time_unix_nano for span in stages]
    assert [span.start_time_unix_nano for span in stages[1:]] == ends[:-1]  # one after the other
    assert stages[0].start_time_unix_nano >= root.start_time_unix_nano
    about = attributes(root)
    assert about["shipshape.outcome"] == "ok"
    assert about["shipshape.contacts"] == (2 if "scan" in name or "stream" in name else 1)


def test_stage_spans_are_as_long_as_the_answer_says(doors, collector):
    with traces(collector.url, 1.0):
        answer = doors.ask_rest(cluster()).json()
    (root,) = collector.roots()
    told = {f"stage {name}": ms for name, ms in answer["stage_ms"].items()}
    lasted = {span.name: span.end_time_unix_nano - span.start_time_unix_nano for span in collector.children(root)}
    assert lasted.keys() == told.keys()
    assert list(lasted.values()) == pytest.approx([ms * 1e6 for ms in told.values()], abs=2)
    assert collector.resources[0]["service.name"] == "shipshape"


def test_a_refused_request_is_a_span_without_stages(doors, collector):
    with traces(collector.url, 1.0):
        doors.ask_rest(cluster(2))
    (root,) = collector.spans
    assert attributes(root)["shipshape.outcome"] in ("invalid_input", "unprocessable")


def test_what_is_our_fault_is_marked_as_one(collector):
    metrics = Metrics(CollectorRegistry(), Budget(0.05))
    with traces(collector.url, 1.0):
        with pytest.raises(RuntimeError), metrics.request("rest", "recognise"):
            raise RuntimeError
        with metrics.request("grpc", "recognise") as outcome:
            outcome.kind = "overloaded"
    assert {span.name: span.status.code for span in collector.spans} == {
        "rest recognise": Status.STATUS_CODE_ERROR,
        "grpc recognise": Status.STATUS_CODE_UNSET,
    }


def test_a_stop_does_not_wait_for_a_collector_that_never_answers(monkeypatch):
    answers = threading.Event()
    provider = SimpleNamespace(get_tracer=lambda name: None, shutdown=answers.wait)
    monkeypatch.setattr(tracing, "_provider", lambda url, share: provider)
    monkeypatch.setattr(tracing, "LAST_SPANS_S", 0.01)
    with traces("http://127.0.0.1:1/v1/traces", 1.0):
        pass  # would hang at its end
    answers.set()


def test_the_callers_trace_goes_on(doors, collector):
    with traces(collector.url, 0.0):
        doors.ask_rest(cluster(), headers={"traceparent": SAMPLED, "X-Request-Id": "voyage-7"})
        doors.stub.Recognise(request(cluster()), timeout=PATIENCE, metadata=[("traceparent", SAMPLED)])
        doors.ask_rest(cluster(), headers={"traceparent": NOT_SAMPLED})
        doors.ask_rest(cluster())
    roots = collector.roots()
    assert {span.name for span in roots} == {"rest recognise", "grpc recognise"}
    assert {span.trace_id.hex() for span in collector.spans} == {TRACE}
    assert {span.parent_span_id.hex() for span in roots} == {SPAN}
    assert "voyage-7" in {attributes(span)["shipshape.request_id"] for span in roots}


def test_no_span_is_made_while_nobody_asks_for_any(doors, collector):
    with traces(None, 1.0):
        doors.ask_rest(cluster(), headers={"traceparent": SAMPLED})
    assert collector.spans == []


@pytest.mark.parametrize("asked", [False, True])
def test_log_lines_name_the_trace(doors, collector, caplog, asked):
    caplog.set_level(logging.DEBUG, "shipshape.telemetry")
    caplog.handler.setFormatter(JsonLines())
    with traces(collector.url if asked else None, 1.0):
        doors.ask_rest(cluster(), headers={"traceparent": SAMPLED, "X-Request-Id": "voyage-8"})
    (line,) = [json.loads(text) for text in caplog.text.splitlines() if "voyage-8" in text]
    assert line["trace_id"] == TRACE
    assert line.items() >= {"door": "rest", "method": "recognise", "outcome": "ok", "contacts": 1}.items()
    assert line["ms"] > 0


@pytest.mark.parametrize(
    "header",
    ["", "x", f"00-{'0' * 32}-{SPAN}-01", f"00-{TRACE}-{'0' * 16}-01", f"ff-{TRACE}-{SPAN}-01", SAMPLED.upper()],
)
def test_a_header_that_is_none_is_passed_over(header):
    new_request_id("", SAMPLED)
    assert trace_id.get() == TRACE
    new_request_id("", header)
    assert trace_id.get() == ""


def test_traces_without_their_extra_say_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "opentelemetry.sdk.trace", None)
    with pytest.raises(SettingsError, match=r"shipshape\[otel\]"), traces("http://127.0.0.1:1/v1/traces", 1.0):
        pass


def test_nothing_that_makes_or_sends_spans_is_imported_while_off():
    script = "import sys, shipshape.commands; print([n for n in sys.modules if n.startswith('opentelemetry.')])"
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "sdk" not in ran.stdout
    assert "exporter" not in ran.stdout


@pytest.mark.skipif(not (MODELS / "manifest.toml").is_file(), reason="models/ has no manifest.toml yet")
def test_the_last_spans_leave_before_the_process_does(collector):
    process = start("-m", "shipshape", "serve", SHIPSHAPE_TRACES_URL=collector.url)
    with process:
        rest_port, _ = until_ready(process)
        url = f"http://127.0.0.1:{rest_port}/v1/recognise"
        given = httpx.post(url, json={"points": rows(cluster())}, trust_env=False)
        stopped_by(process, signal.SIGTERM)
    assert given.status_code == 200
    (root,) = collector.roots()
    assert [span.name for span in collector.children(root)] == [
        f"stage {name}" for name in given.json()["stage_ms"]
    ]
