"""A pipeline that does what a contact's id says, a service around it, and clients of both its doors."""

import os
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import grpc
import httpx
import numpy as np
import pytest

from shipshape.bundle import Bundle, CatalogueVessel
from shipshape.serving.local_model import LocalModel
from shipshape.serving.service import Service
from shipshape.settings import Settings
from shipshape.types import (
    Box,
    Contact,
    ImageMethod,
    ImagePair,
    Options,
    Preset,
    Reason,
    Recognition,
    ReferenceBox,
    RestoredCloud,
    Rung,
)
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub
from shipshape.validation import ContactLimits, check_contact

PATIENCE = 10.0
DIGEST = "ab" * 32
PNG = b"\x89PNG fake"
SECRET = "the secret of the stage"
DESCRIPTORS = np.random.default_rng(0).integers(0, 256, (3, 5, 16, 32), np.uint8)
HEAD = "POST /v1/recognise HTTP/1.1\r\nHost: x\r\nContent-Type: application/octet-stream\r\nContent-Length: {}\r\n"
HALF = HEAD.format(4800).encode() + b"\r\nabc"


FAKE_BUNDLE = Bundle(
    name="fake",
    digest=DIGEST,
    catalogue=(
        CatalogueVessel("tug", ReferenceBox(20.0, 8.0, 10.0)),
        CatalogueVessel("rhib", ReferenceBox(9.0, 2.5, 3.0)),
    ),
    models={},
    parameters={},
    scores={"p": {"accuracy": 0.99}, "note": "made up"},
    training={},
)


@dataclass(frozen=True, eq=False)
class FakeStage:
    name: str
    run: object


@dataclass(frozen=True, eq=False)
class FakeRung:
    name: Rung
    stages: object


@dataclass
class FakeWork:
    contact: Contact
    options: Options


class FakePipeline:
    """Contact ids that mean something: "hold" waits for `release`, "crash" fails."""

    def __init__(self):
        self.entered = threading.Semaphore(0)
        self.release = threading.Event()
        self.computed = []
        self.stages = (FakeStage("prior", self._prior), FakeStage("heading", lambda work: None))
        self.rungs = (FakeRung(Rung.FULL, self.stages), FakeRung(Rung.HEADING_AND_BOX, self.stages[:1]))

    def begin(self, contact, options):
        check_contact(contact, ContactLimits())
        return FakeWork(contact, options)

    def ladder(self, options):
        return [rung for rung in self.rungs if rung.name is Rung.FULL or options.lowest_rung is not Rung.FULL]

    def finish(self, work, stage_ms, rung=Rung.FULL, rung_reason=""):
        self.computed.append(work.contact.contact_id)
        return replace(recognition_of(work, dict(stage_ms)), rung=rung, rung_reason=rung_reason)

    def _prior(self, work):
        if work.contact.contact_id == "crash":
            raise RuntimeError(SECRET)
        if work.contact.contact_id == "hold":
            self.entered.release()
            assert self.release.wait(PATIENCE)


def recognition_of(work, stage_ms):
    points = work.contact.points_level
    own = work.contact.own_true_heading_deg
    paper = work.options.preset is Preset.PAPER
    image = np.arange(64 * 64 * 3, dtype=np.uint32).astype(np.uint8).reshape(64, 64, 3)
    return Recognition(
        vessel="tug",
        probability=0.75,
        probabilities={"tug": 0.75, "rhib": 0.125, "unknown": 0.125},
        unknown=False,
        reasons=(Reason.FEW_POINTS, Reason.END_ON),
        heading=0.5,
        heading_std=0.0625,
        bow_probability=0.875,
        aspect_deg=30.0,
        true_heading_deg=None if own is None else own % 360,
        box=Box((40.0, 1.5, -2.0), ReferenceBox(20.0, 8.0, 10.0)),
        restored=RestoredCloud(np.concatenate([points, -points]), np.arange(2 * len(points)) < len(points)),
        images=ImagePair(image, 255 - image),
        keypoints_level=points[:3].copy(),
        rung=Rung.FULL,
        rung_reason="",
        preset=work.options.preset,
        image_method=work.options.image_method if paper else None,
        bundle=DIGEST,
        stage_ms=stage_ms,
        descriptors=DESCRIPTORS,
    )


def cluster(count=40, seed=0):
    """A patch 20 m by 4 m, 40 m ahead: float32 (count, 3)."""
    unit = np.random.default_rng(seed).random((count, 3))
    return (unit * [2, 20, 4] + [40, -10, -2]).astype(np.float32)


def rows(points):
    return points.astype(float).tolist()


@dataclass
class Doors:
    """A running service with clients of both its doors."""

    service: Service
    pipeline: FakePipeline
    rest: httpx.Client
    stub: ShipshapeStub
    channel: grpc.Channel
    addresses: object
    kept: list = field(default_factory=list)

    def ask_rest(self, points, path="/v1/recognise", headers=None, **fields):
        return self.rest.post(path, json={"points": rows(points), **fields}, headers=headers)

    def ask_grpc(self, points, options=None, timeout=PATIENCE, **fields):
        return self.stub.Recognise.with_call(request(points, options, **fields), timeout=timeout)


def request(points, options=None, **fields):
    packed = points if isinstance(points, bytes) else points.astype("<f4").tobytes()
    return pb.RecogniseRequest(contact=pb.Contact(points=packed, **fields), options=options)


def image_methods():
    return list(ImageMethod)


def fake_model(pipeline, **fields):
    return LocalModel(replace(FAKE_BUNDLE, **fields), pipeline, lambda contact, recognition: PNG)


@contextmanager
def running(*, opened=True, load=None, **settings):
    """A service around a fresh fake pipeline on free ports; `load` reads bundles for a swap."""
    pipeline = FakePipeline()
    settings = {
        "rest_port": 0,
        "grpc_port": 0,
        "workers": 1,
        "drain_s": PATIENCE,
        "default_timeout_ms": PATIENCE * 1e3,
        **settings,
    }
    service = Service(
        Settings(**settings),
        settings["workers"],
        load=load,
        on_death=lambda: pytest.fail("a door died"),
    )
    addresses = service.start()
    if opened:
        service.open(fake_model(pipeline))
    channel = grpc.insecure_channel(f"127.0.0.1:{addresses.grpc_port}")
    rest = httpx.Client(base_url=f"http://127.0.0.1:{addresses.rest_port}", timeout=PATIENCE, trust_env=False)
    with channel, rest:
        yield Doors(service, pipeline, rest, ShipshapeStub(channel), channel, addresses)
        pipeline.release.set()
        rest.close()
        channel.close()
        service.stop()


def until(condition):
    """Give way until another thread has made it so."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if condition():
            return
        os.sched_yield()
    pytest.fail("it never came true")


def refuses(doors):
    try:
        doors.ask_grpc(cluster())
    except grpc.RpcError as error:
        return error.code() is grpc.StatusCode.UNAVAILABLE
    return False


@pytest.fixture(scope="module")
def doors():
    """One service for all tests of a module that leave it as they found it."""
    with running() as doors:
        yield doors
