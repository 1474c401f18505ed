"""A service with an admin door, and shadow bundles that do what their folder is named after."""

import hashlib
import threading
from contextlib import contextmanager
from dataclasses import replace

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from serving.fakes import DIGEST, PATIENCE, FakePipeline, cluster, fake_model, running, until
from shipshape.errors import BundleError
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


def compared(service, **expected):
    """Wait for these counts, and see that there are no others."""
    until(lambda: sum(counts(service).values()) >= sum(expected.values()))
    assert {verdict: count for verdict, count in counts(service).items() if count} == expected


def counts(service):
    shadow = service.shadow()
    return {verdict: shadow[verdict] for verdict in ("same", "differs", "failed", "dropped")}


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
