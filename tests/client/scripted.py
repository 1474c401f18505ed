"""A gRPC service of shipshape.v1 that does what a test says, so that a client can be shown any of its answers."""

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field

import grpc
import numpy as np
from grpc_health.v1 import health_pb2, health_pb2_grpc

from shipshape.types import Contact
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1 import shipshape_pb2_grpc

PATIENCE = 20.0  # s, for what must come


@dataclass
class Scripted(shipshape_pb2_grpc.ShipshapeServicer, health_pb2_grpc.HealthServicer):
    """Answers with its name as the vessel; first come the `refusals`, one a call: status, kind, pushback in ms."""

    name: str
    refusals: list = field(default_factory=list)
    serving: bool = True
    locked: bool = False  # nobody has the right token
    load: float = 0.0
    computing_ms: float = 2.0
    budget_ms: float = 10_000.0
    held: threading.Event | None = None  # until which every contact waits
    asked: list = field(default_factory=list)  # requests
    deadlines: list = field(default_factory=list)  # seconds left when they came
    metadata: list = field(default_factory=list)
    cancelled: threading.Event = field(default_factory=threading.Event)
    entered: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))
    url: str = ""

    def Recognise(self, request, context):
        self._enter(request, context)
        context.set_trailing_metadata((("shipshape-load", f"{self.load:.3f}"),))
        return pb.RecogniseResponse(recognition=self._answer(request.contact))

    def RecogniseScan(self, request, context):
        self._enter(request, context)
        return pb.RecogniseScanResponse(results=[self._result(contact) for contact in request.contacts])

    def RecogniseStream(self, requests, context):
        for request in requests:
            self._enter(request, context)
            yield pb.RecogniseStreamResponse(
                sequence=request.sequence, results=[self._result(contact) for contact in request.contacts]
            )

    def GetCapacity(self, request, context):
        if self.locked:
            refuse(context, grpc.StatusCode.UNAUTHENTICATED, "unauthenticated")
        promises = [pb.Promise(rung="full", milliseconds=self.computing_ms)]
        budget = pb.Budget(level="ok", budget_ms=self.budget_ms)
        return pb.GetCapacityResponse(promises=promises, running=round(2 * self.load), workers=2, budget=budget)

    def Check(self, request, context):
        answer = health_pb2.HealthCheckResponse
        return answer(status=answer.SERVING if self.serving else answer.NOT_SERVING)

    def _enter(self, request, context):
        if self.locked:
            refuse(context, grpc.StatusCode.UNAUTHENTICATED, "unauthenticated")
        self.asked.append(request)
        self.deadlines.append(context.time_remaining())
        self.metadata.append(dict(context.invocation_metadata()))
        if self.refusals:
            refuse(context, *self.refusals.pop(0))
        if self.held is not None:
            context.add_callback(self.cancelled.set)
            self.entered.release()
            self.held.wait(PATIENCE)

    def _answer(self, contact):
        return pb.Recognition(
            contact_id=contact.contact_id,
            vessel=self.name,
            rung="full",
            preset=pb.PRESET_BEST,
            stages=[pb.StageTime(stage="prior", milliseconds=self.computing_ms)],
        )

    def _result(self, contact):
        return pb.ContactResult(contact_id=contact.contact_id, recognition=self._answer(contact))


def refuse(context, status, kind="", pushback_ms=None):
    entries = [("shipshape-error", kind)] if kind else []
    if pushback_ms is not None:
        entries.append(("grpc-retry-pushback-ms", str(pushback_ms)))
    context.set_trailing_metadata(tuple(entries))
    context.abort(status, f"expected something else, got {kind or status.name}")


@contextmanager
def serving(service, port=0):
    """The service on a free port, or on one that it had before; at its `url`."""
    server = grpc.server(ThreadPoolExecutor(16), options=[("grpc.so_reuseport", 0)])
    shipshape_pb2_grpc.add_ShipshapeServicer_to_server(service, server)
    health_pb2_grpc.add_HealthServicer_to_server(service, server)
    service.url = f"grpc://127.0.0.1:{server.add_insecure_port(f'127.0.0.1:{port}')}"
    server.start()
    try:
        yield service
    finally:
        if service.held is not None:
            service.held.set()
        server.stop(None).wait(PATIENCE)


def gone():
    """The URL of a service that has stopped."""
    with serving(Scripted("gone")) as service:
        return service.url


def of_any_shape(points):
    """A contact as a program makes it that checks no types, as these tests do."""
    contact = Contact(np.zeros((1, 3), np.float32))
    object.__setattr__(contact, "points_level", points)
    return contact
