"""What would be promised now, the state of the budget and the load, through both doors."""

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from prometheus_client.parser import text_string_to_metric_families

from serving.fakes import PATIENCE, cluster, request, running
from shipshape.executor.admission import HEADROOM
from shipshape.serving.grpc.guard import Call, current_call
from shipshape.serving.grpc.servicer import Servicer
from shipshape.serving.load_report import as_message
from shipshape.serving.timing import Timeouts
from shipshape.telemetry import Outcome
from shipshape.v1 import shipshape_pb2 as pb

POINTS = cluster()


@pytest.fixture
def doors():
    with running(workers=1) as doors:
        yield doors


def believe(doors, seconds):
    for _ in range(100):
        doors.service.executor._costs.learn(doors.pipeline.stages[1], 300, seconds)


def test_each_rung_is_promised_in_its_time_and_both_doors_agree(doors):
    believe(doors, 2.0)
    told = doors.rest.get("/v1/capacity").json()
    assert [promise["rung"] for promise in told["promises"]] == ["full", "heading_and_box"]
    assert told["promises"][0]["milliseconds"] == pytest.approx(HEADROOM * 2000, rel=0.2)
    assert told["promises"][1]["milliseconds"] < 100
    assert (told["wait_ms"], told["queue_depth"], told["running"], told["workers"]) == (0, 0, 0, 1)
    found = doors.stub.GetCapacity(pb.GetCapacityRequest(), timeout=PATIENCE)
    assert [(promise.rung, promise.milliseconds) for promise in found.promises] == [
        (promise["rung"], promise["milliseconds"]) for promise in told["promises"]
    ]
    assert (found.workers, found.budget.level, found.budget.budget_ms) == (1, "ok", 50.0)


def test_what_waits_is_told_to_those_whom_it_delays(doors):
    believe(doors, 2.0)
    contact = pb.Contact(points=POINTS.astype("<f4").tobytes(), contact_id="hold")
    future = doors.stub.Recognise.future(pb.RecogniseRequest(contact=contact), timeout=PATIENCE)
    assert doors.pipeline.entered.acquire(timeout=PATIENCE)
    waits = {
        lane: doors.rest.get("/v1/capacity", params={"lane": lane}).json()["wait_ms"]
        for lane in ("collision", "tracking", "batch")
    }
    assert waits["collision"] == 0 < waits["tracking"] == waits["batch"]
    assert doors.rest.get("/v1/capacity").json()["running"] == 1
    doors.pipeline.release.set()
    future.result()


@pytest.mark.parametrize("query", [{"points": "0"}, {"points": "many"}, {"lane": "fast"}, {"other": "1"}])
def test_a_wrong_question_is_refused(doors, query):
    refused = doors.rest.get("/v1/capacity", params=query)
    assert (refused.status_code, refused.json()["error"]) == (400, "invalid_input")


def test_nothing_is_promised_before_the_service_is_ready():
    with running(opened=False) as doors:
        assert doors.rest.get("/v1/capacity").status_code == 503


def test_the_budget_is_told_everywhere():
    with running(budget_ms=1e-3) as doors:
        doors.ask_rest(POINTS)
        doors.ask_grpc(POINTS)
        doors.ask_rest(POINTS, lane="batch")
        doors.ask_rest(POINTS[:3])
        budget = doors.rest.get("/v1/capacity").json()["budget"]
        assert (budget["good"], budget["bad"], budget["last_good_s"]) == (0, 2, None)
        assert budget["level"] in ("warn", "error")
        assert budget["burn"]["5m"] == pytest.approx(100)
        families = text_string_to_metric_families(doors.rest.get("/metrics").text)
        samples = {(s.name, *s.labels.values()): s.value for family in families for s in family.samples}
        assert samples["shipshape_budget_total", "false"] == 2
        assert samples["shipshape_error_budget_burn", "5m"] == pytest.approx(100)
        assert samples["shipshape_budget_level",] >= 1
        assert samples["shipshape_budget_seconds",] == pytest.approx(1e-6)
        assert samples["shipshape_workers",] == 1


def test_answers_inside_the_budget_are_good():
    with running(budget_ms=PATIENCE * 1e3) as doors:
        doors.ask_rest(POINTS)
        doors.rest.post("/v1/scan", json={"contacts": [{"points": POINTS.tolist()}]})
        budget = doors.rest.get("/v1/capacity").json()["budget"]
        assert (budget["level"], budget["good"], budget["bad"]) == ("ok", 2, 0)


def orca():
    """The one field of the load report that is used, as its schema declares it."""
    file = descriptor_pb2.FileDescriptorProto(name="orca.proto", package="orca", syntax="proto3")
    report = file.message_type.add(name="OrcaLoadReport")
    report.field.add(name="application_utilization", number=9, type=1, label=1)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("orca.OrcaLoadReport"))


class Context:
    """What the servicer needs of a call; gRPC clients hand the load to their balancer and hide it from callers."""

    def time_remaining(self):
        return None

    def add_callback(self, callback):
        return True

    def set_trailing_metadata(self, metadata):
        self.trailing = dict(metadata)


def test_every_answer_carries_the_load(doors):
    text = doors.ask_rest(POINTS).headers["endpoint-load-metrics"]
    assert text == "TEXT application_utilization=0.000"
    context, core, metrics = Context(), doors.service._core, doors.service._metrics
    current_call.set(Call(Outcome(), None))
    Servicer(core, metrics, Timeouts(), doors.service._grpc._streams).Recognise(request(POINTS), context)
    report = orca().FromString(context.trailing["endpoint-load-metrics-bin"])
    assert 0.0 <= report.application_utilization <= 1.0
    assert float(context.trailing["shipshape-load"]) == pytest.approx(report.application_utilization, abs=1e-3)
    _, call = doors.ask_grpc(POINTS)
    assert 0.0 <= float(dict(call.trailing_metadata())["shipshape-load"]) <= 1.0


def test_the_load_is_the_message_that_balancers_know():
    assert orca().FromString(as_message(1.75)).application_utilization == 1.75
