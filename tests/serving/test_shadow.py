"""A shadow bundle: what callers asked is computed by it too and compared, and no caller can tell."""

import gc
import hashlib
import json
import logging
import threading
import weakref
from contextlib import contextmanager
from dataclasses import replace

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from serving.fakes import DIGEST, PATIENCE, FakePipeline, cluster, fake_model, running, until
from shipshape.cli import main
from shipshape.errors import BundleError, Cancelled, Conflict
from shipshape.serving import shadow as module
from shipshape.types import Rung

TOKEN = "a token that nobody guesses"
OTHER = "cd" * 32
NAMES = ("first", "same", "second", "crash", "hold", "turned", "bad", "odd")


class Shadowed(FakePipeline):
    """Answers as the fake pipeline does, but for what a bundle is named after."""

    def __init__(self, name):
        super().__init__()
        self.name = name
        self.halted = threading.Semaphore(0)
        self.proceed = threading.Event()

    def finish(self, work, stage_ms, rung=Rung.FULL, rung_reason=""):
        found = super().finish(work, stage_ms, rung, rung_reason)
        if self.name == "second":
            probabilities = {"tug": 0.25, "rhib": 0.625, "unknown": 0.125}
            return replace(found, vessel="rhib", probability=0.625, probabilities=probabilities)
        if self.name == "turned":
            return replace(found, heading=found.heading - 3.0)
        return found

    def _prior(self, work):
        asked = work.contact.contact_id.startswith("contact-")  # not that of the try-out
        if asked and self.name == "crash":
            raise RuntimeError("planned")
        if asked and self.name == "hold":
            self.halted.release()
            assert self.proceed.wait(PATIENCE)
        super()._prior(work)


class Service:
    """A running service with an admin door, and every shadow pipeline that it loaded, by name."""

    def __init__(self, doors, admin, loaded):
        self.doors, self.admin, self.loaded = doors, admin, loaded

    def call(self, path, **body):
        answer = (
            self.admin.post(f"/admin/{path}", json=body) if path != "status" else self.admin.get("/admin/status")
        )
        assert answer.status_code == 200, answer.text
        return answer.json()

    def shadow(self):
        return self.call("status")["shadow"]

    def ask(self, count=1, **fields):
        for index in range(count):
            answer = self.doors.ask_rest(cluster(), contact_id=f"contact-{index}", **fields)
            assert answer.status_code == 200, answer.text
            assert (answer.json()["vessel"], answer.json()["bundle"]) == ("tug", DIGEST)

    def metrics(self):
        """Of the shadow, without the times at which counters began: values by name and labels."""
        return {
            (sample.name, *sample.labels.values()): sample.value
            for family in text_string_to_metric_families(self.doors.rest.get("/metrics").text)
            for sample in family.samples
            if sample.name.startswith("shipshape_shadow") and not sample.name.endswith("_created")
        }


@contextmanager
def administered(tmp_path, **more):
    for name in NAMES:
        (tmp_path / "bundles" / name).mkdir(parents=True)
    tokens = tmp_path / "admin.tokens"
    tokens.write_text(f"ops {hashlib.sha256(TOKEN.encode()).hexdigest()}\n")
    loaded = {}

    def load(folder):
        if folder.name == "bad":
            raise BundleError("expected sha256 1 of prior.onnx, got 2")
        if folder.name == "odd":
            raise ZeroDivisionError
        loaded[folder.name] = Shadowed(folder.name)
        digest = DIGEST if folder.name in ("first", "same") else OTHER
        return fake_model(loaded[folder.name], name=folder.name, digest=digest)

    settings = {"admin_port": 0, "admin_token_file": tokens, "bundle": tmp_path / "bundles/first"}
    settings |= {"shadow_share": 1.0, "workers": 2, **more}
    with running(load=load, **settings) as doors:
        url = f"http://127.0.0.1:{doors.addresses.admin_port}"
        headers = {"Authorization": f"Bearer {TOKEN}"}
        with httpx.Client(base_url=url, headers=headers, timeout=PATIENCE, trust_env=False) as admin:
            yield Service(doors, admin, loaded)
            for pipeline in loaded.values():
                pipeline.proceed.set()


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    with administered(tmp_path_factory.mktemp("shadow")) as service:
        yield service


@pytest.fixture
def service(shared):
    """One service for most tests; each finds it without a shadow."""
    yield shared
    for pipeline in shared.loaded.values():
        pipeline.proceed.set()
    shared.call("unshadow")


def compared(service, **expected):
    """Wait for these counts, and see that there are no others."""
    until(lambda: sum(counts(service).values()) >= sum(expected.values()))
    assert {verdict: count for verdict, count in counts(service).items() if count} == expected


def counts(service):
    shadow = service.shadow()
    return {verdict: shadow[verdict] for verdict in ("same", "differs", "failed", "dropped")}


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
    from shipshape.telemetry import JsonLines  # noqa: PLC0415  # formats as the service does

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


def test_degraded_answers_are_not_compared(service):
    ticket = DegradedTicket()
    service.call("shadow", folder="same")
    run = service.doors.service.models.comparing._run
    run.sample(1.0, ticket, None, None)
    ticket.settle()
    service.ask()
    compared(service, same=1)


class DegradedTicket:
    degraded = True

    def __init__(self):
        from concurrent.futures import Future  # noqa: PLC0415  # the only test that makes one

        self.future = Future()

    def settle(self):
        self.future.set_result(None)


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


def test_a_bad_one_is_refused_and_changes_nothing(service):
    service.call("shadow", folder="second")
    for folder, kind in (("bad", "bundle_refused"), ("odd", "bundle_refused"), ("../..", "invalid_input")):
        answer = service.admin.post("/admin/shadow", json={"folder": folder})
        assert answer.json()["error"] == kind
    status = service.call("status")
    assert (status["shadow"]["name"], status["bundle"]["digest"]) == ("second", DIGEST)
    service.ask()
    compared(service, differs=1)


def test_another_one_takes_its_place_and_counts_anew(service):
    service.call("shadow", folder="second")
    service.ask(2)
    compared(service, differs=2)
    assert service.call("shadow", folder="turned")["shadow"]["name"] == "turned"
    service.ask()
    compared(service, same=1)


def test_without_a_shadow_nothing_is_watched(service):
    core = service.doors.service._core
    assert core._watch is None
    service.call("shadow", folder="second")
    assert core._watch is not None
    assert service.call("unshadow")["shadow"] is None
    assert core._watch is None
    assert not any(name == "shipshape_shadow_info" for name, *_ in service.metrics())
    assert service.call("unshadow")["shadow"] is None, "it may be repeated"


def test_a_shadow_that_was_unloaded_is_freed_at_once(service):
    freed = threading.Event()
    gc.disable()  # collections come when they come: nothing may wait for them
    try:
        service.call("shadow", folder="second")
        # What only the model knows: the fake pipeline knows itself.
        weakref.finalize(service.doors.service.models.shadow.model.render, freed.set)
        service.ask(2)
        compared(service, differs=2)
        service.call("unshadow")
        assert freed.wait(PATIENCE)
    finally:
        gc.enable()


def test_promote_and_roll_back(service):
    service.call("shadow", folder="second")
    status = service.call("promote")
    try:
        assert (status["bundle"]["name"], status["previous"]["digest"], status["shadow"]) == (
            "second",
            DIGEST,
            None,
        )
        assert service.doors.rest.get("/v1/model").json()["bundle"] == OTHER
        refused = service.admin.post("/admin/promote")
        assert (refused.status_code, refused.json()["error"]) == (409, "conflict")
    finally:
        assert service.call("rollback")["bundle"]["digest"] == DIGEST


def test_promoting_the_running_bundle_changes_nothing(service):
    before = service.call("shadow", folder="same")
    after = service.call("promote")
    assert (after["bundle"], after["previous"]) == (before["bundle"], before["previous"])
    assert after["shadow"] is None


def test_one_change_at_a_time(service):
    models = service.doors.service.models
    with models._alone():
        for change in (lambda: models.cast_shadow("second"), models.end_shadow, models.promote):
            with pytest.raises(Conflict, match="expected one change of the bundle at a time"):
                change()


def test_no_call_without_the_token(service):
    for path in ("shadow", "unshadow", "promote"):
        url = f"{service.admin.base_url}/admin/{path}"
        answer = httpx.post(url, json={"folder": "second"}, trust_env=False)
        assert (answer.status_code, answer.json()["error"]) == (401, "unauthenticated")
        assert service.doors.rest.post(f"/admin/{path}", headers=service.admin.headers).status_code == 404
    contract = service.admin.get("/openapi.json")
    assert {"/admin/shadow", "/admin/unshadow", "/admin/promote"} <= contract.json()["paths"].keys()


def test_a_stop_ends_the_shadow(tmp_path):
    with administered(tmp_path) as service:
        service.call("shadow", folder="hold")
        service.ask()
        assert service.loaded["hold"].halted.acquire(timeout=PATIENCE)
        comparing = service.doors.service.models.comparing
        service.loaded["hold"].proceed.set()
        service.doors.service.stop()
        assert comparing._run is None
        with pytest.raises(Cancelled):
            comparing.begin(fake_model(FakePipeline()), apart=True)


def test_the_command_line(service, tmp_path, capsys):
    token = tmp_path / "admin.token"
    token.write_text(f"{TOKEN}\n")

    def call(*words):
        return main(["admin", *words, "--url", str(service.admin.base_url), "--token-file", str(token)])

    assert call("shadow", "second") == 0
    assert json.loads(capsys.readouterr().out)["shadow"]["name"] == "second"
    assert call("unshadow") == 0
    assert json.loads(capsys.readouterr().out)["shadow"] is None
    assert call("promote") == 1
    assert capsys.readouterr().err == (
        "shipshape: expected a shadow to promote, got a service that has none: load it with shadow\n"
    )
    for words in (["shadow"], ["unshadow"], ["promote"]):
        with pytest.raises(SystemExit) as ended:
            main(["admin", *words, "--help"])
        assert ended.value.code == 0
        assert f"example:\n  shipshape admin {words[0]}" in capsys.readouterr().out
