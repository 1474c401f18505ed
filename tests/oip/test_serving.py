"""Deadlines, leaving callers, a full queue and the counters, through every form of the protocol."""

import re
import socket

import grpc
import numpy as np
import pytest
from prometheus_client.parser import text_string_to_metric_families

from oip.wire import FORMS, HEADER, INFER, binary, by_grpc_raw, by_json, call, envelope, message, read, scan
from serving.fakes import PATIENCE, cluster, running, until
from shipshape.inference.open_inference_pb2_grpc import GRPCInferenceServiceStub
from shipshape.serving.rest.bodies import LARGE_JSON_BYTES

POINTS = cluster()
HOLD = {"points": POINTS, "contact_id": [b"hold"]}
each_form = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)


@each_form
def test_parameter_timeout_is_a_deadline_in_microseconds(form):
    with running() as doors:
        late = form(doors, HOLD, parameters={"timeout": 50_000})
        assert late.status in (504, grpc.StatusCode.DEADLINE_EXCEEDED)
        assert late.kind == "deadline_exceeded"
        doors.pipeline.release.set()
        assert form(doors, {"points": POINTS}, parameters={"timeout": 9_000_000}).outputs["error"] == [""]


@pytest.mark.parametrize(
    "inputs", [HOLD, scan(POINTS, POINTS, contact_id=[b"hold", b"hold"])], ids=["one", "scan"]
)
def test_the_deadlines_of_both_doors_hold(inputs):
    with running() as doors:
        late = read(doors.rest.post(INFER, json=envelope(inputs), headers={"Shipshape-Timeout-Ms": "50"}))
        assert (late.status, late.kind) == (504, "deadline_exceeded")
        assert call(doors, message(inputs), timeout=0.05).status is grpc.StatusCode.DEADLINE_EXCEEDED


@each_form
def test_what_is_too_old_is_refused(form):
    with running() as doors:
        stale = form(doors, {"points": POINTS}, parameters={"captured_at": 1e9, "max_age_ms": 1000})
        assert stale.kind == "deadline_exceeded"
        typed = doors.ask_rest(POINTS, captured_at=1e9, max_age_ms=1000).json()
        assert (stale.kind, re.sub(r"\d+", "", stale.error)) == (
            typed["error"],
            re.sub(r"\d+", "", typed["detail"]),
        )


def test_the_work_of_callers_who_leave_is_dropped():
    with running() as doors:
        rpc = GRPCInferenceServiceStub(doors.channel).ModelInfer.future(message(HOLD), timeout=PATIENCE)
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        rpc.cancel()
        until(lambda: doors.service.executor.counts().cancelled == 1)
        body, size = binary({"points": POINTS, "contact_id": [b"left"]})
        head = f"POST {INFER} HTTP/1.1\r\nHost: x\r\nContent-Length: {len(body)}\r\n{HEADER}: {size}\r\n\r\n"
        with socket.create_connection(("127.0.0.1", doors.addresses.rest_port), timeout=PATIENCE) as client:
            client.sendall(head.encode() + body)
            until(lambda: doors.service.executor.queue_depth == 1)
        until(lambda: doors.service.executor.counts().cancelled == 2)
        doors.pipeline.release.set()
        assert by_json(doors, {"points": POINTS}).status == 200
        assert not {"hold", "left"} & set(doors.pipeline.computed)


def test_a_full_queue_refuses():
    with running(queue_limit=2, max_contacts=2) as doors:
        stub = GRPCInferenceServiceStub(doors.channel)
        running_call = stub.ModelInfer.future(message(HOLD), timeout=PATIENCE)
        assert doors.pipeline.entered.acquire(timeout=PATIENCE)
        waiting = stub.ModelInfer.future(message(scan(POINTS, POINTS)), timeout=PATIENCE)
        until(lambda: doors.service.executor.queue_depth == 2)
        by_rest, by_grpc = by_json(doors, {"points": POINTS}), by_grpc_raw(doors, scan(POINTS, POINTS))
        assert (by_rest.status, by_grpc.status) == (429, grpc.StatusCode.RESOURCE_EXHAUSTED)
        assert int(by_rest.headers["retry-after"]) >= 1
        assert int(by_grpc.headers["grpc-retry-pushback-ms"]) >= 1
        doors.pipeline.release.set()
        assert len(running_call.result().outputs) == len(waiting.result().outputs) > 0


def counted(doors):
    text = doors.rest.get("/metrics").text
    return {
        (sample.name, *sorted(sample.labels.values())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
        if sample.labels.get("door", "").startswith("oip") and not sample.name.endswith(("_bucket", "_sum"))
    }


def test_metrics_tell_of_every_outcome():
    """Contacts that were answered, refused alone, and refused with their request."""
    with running() as doors:
        for form in (by_json, by_grpc_raw):
            form(doors, {"points": POINTS})
            form(doors, scan(POINTS, POINTS[:3], POINTS))
            form(doors, {"points": POINTS[:3]})
            form(doors, scan(POINTS, POINTS), parameters={"bundle": "other"})
        doors.rest.get("/v2")
        seen = counted(doors)
    count, contacts = "shipshape_request_seconds_count", "shipshape_contacts_total"
    for door in ("oip_rest", "oip_grpc"):
        assert seen[count, *sorted([door, "infer", "ok"])] == 2
        assert seen[count, *sorted([door, "infer", "unprocessable"])] == 1
        assert seen[count, *sorted([door, "infer", "invalid_input"])] == 1
        assert seen[contacts, *sorted([door, "ok"])] == 3
        assert seen[contacts, *sorted([door, "unprocessable"])] == 2
        assert seen[contacts, *sorted([door, "invalid_input"])] == 2
        assert seen["shipshape_in_flight", door] == 0
    assert seen[count, *sorted(["oip_rest", "server_metadata", "ok"])] == 1


def test_a_large_request_and_a_large_answer():
    """Both are handled off the event loop; the answer is the same."""
    many = cluster(20_000)
    with running() as doors:
        names = ["restored_points", "restored_counts"]
        by_rest, by_grpc = by_json(doors, {"points": many}, names), by_grpc_raw(doors, {"points": many}, names)
        assert by_rest.outputs["restored_counts"].tolist() == [40_000]
        assert np.array_equal(by_rest.outputs["restored_points"], by_grpc.outputs["restored_points"])


def test_large_json_before_raw_tensors_is_parsed_in_another_process(monkeypatch):
    asked = []

    async def parse(self, parse, body, query, seconds):
        asked.append(len(body))
        return parse(body, query, self._limits)

    monkeypatch.setattr("shipshape.serving.rest.json_process.JsonProcess.parse", parse)
    text = b'{"inputs": [{"name": "points", "datatype": "FP32", "shape": [120, 3],'
    text += b'"parameters": {"binary_data_size": 1440}}]}' + b" " * LARGE_JSON_BYTES
    body = text + cluster(120).tobytes()
    with running() as doors:
        answer = doors.rest.post(INFER, content=body, headers={HEADER: str(len(text))})
        assert (answer.status_code, asked) == (200, [len(body)]), answer.text
