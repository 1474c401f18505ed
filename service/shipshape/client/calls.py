"""One endpoint over gRPC: a channel, the calls on it, and what each call tells of the endpoint."""

import time
from typing import Any

import grpc
from grpc_health.v1 import health_pb2, health_pb2_grpc

from shipshape.client.answers import Answer, Capacity, Info, Refusal
from shipshape.client.endpoint import Endpoint
from shipshape.client.failures import error_of, value_of
from shipshape.client.messages import from_contact, from_wishes, to_answer, to_capacity, to_info, to_results
from shipshape.client.route import Route
from shipshape.client.wishes import Wishes
from shipshape.errors import NotReady, ServiceFault
from shipshape.executor import Lane
from shipshape.types import Contact
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1.shipshape_pb2_grpc import ShipshapeStub

SERVICE = "shipshape.v1.Shipshape"
LOAD_KEY = "shipshape-load"


class Calls:
    """The calls to one endpoint; opened in the event loop that uses it.

    Args:
        endpoint: Where it is.
        route: Told of how it answers.
    """

    def __init__(self, endpoint: Endpoint, route: Route) -> None:
        self.endpoint = endpoint
        self.route = route
        self._channel = endpoint.open()
        self.stub: Any = ShipshapeStub(self._channel)  # type: ignore[no-untyped-call]
        self._health: Any = health_pb2_grpc.HealthStub(self._channel)

    async def recognise(self, contact: Contact, wishes: Wishes, timeout_s: float) -> Answer:
        """One contact; raises ShipshapeError."""
        request = pb.RecogniseRequest(contact=self.encode(contact), options=from_wishes(wishes))
        response, took_s, load = await self._call(self.stub.Recognise, request, timeout_s)
        answer = to_answer(response.recognition, self.endpoint.url)
        # The time to draw a picture is in no stage: it would pass for the way there and back.
        self.route.told_answer(took_s, 0.0 if wishes.png else sum(answer.stage_ms.values()) / 1e3, load)
        return answer

    async def scan(
        self, contacts: list[Contact], wishes: Wishes, timeout_s: float
    ) -> tuple[Answer | Refusal, ...]:
        """Many contacts, admitted together or not at all; raises ShipshapeError."""
        encoded = [self.encode(contact) for contact in contacts]
        request = pb.RecogniseScanRequest(contacts=encoded, options=from_wishes(wishes))
        response, took_s, load = await self._call(self.stub.RecogniseScan, request, timeout_s)
        self.route.told_answer(took_s, 0.0, load)
        return to_results(response.results, self.endpoint.url)

    async def capacity(self, points: int, lane: Lane, timeout_s: float) -> Capacity:
        """What it would promise a contact of so many points; raises ShipshapeError."""
        request = pb.GetCapacityRequest(points=points, lane=f"LANE_{lane.name}")
        response, took_s, _ = await self._call(self.stub.GetCapacity, request, timeout_s)
        capacity = to_capacity(response)
        self.route.told_capacity(capacity, took_s)
        return capacity

    async def info(self, timeout_s: float) -> Info:
        """What it runs, and what it takes; raises ShipshapeError."""
        response, _, _ = await self._call(self.stub.GetModelInfo, pb.GetModelInfoRequest(), timeout_s)
        return to_info(response)

    async def probe(self, timeout_s: float) -> None:
        """Ask for health, then for capacity, whose time is a round trip on a connection that stands.

        Raises:
            NotReady: It does not want requests now.
            ShipshapeError: It does not answer.
        """
        check = health_pb2.HealthCheckRequest(service=SERVICE)
        health, _, _ = await self._call(self._health.Check, check, timeout_s)
        if health.status != health_pb2.HealthCheckResponse.SERVING:
            raise NotReady(f"expected a ready service at {self.endpoint.url}, got one that is not")
        await self.capacity(0, Lane.TRACKING, timeout_s)

    def encode(self, contact: Contact) -> pb.Contact:
        """The message of a contact, in the form that suits the link."""
        return from_contact(contact, self.endpoint.link.step_m)

    async def close(self) -> None:
        """Disconnect; calls under way are cancelled."""
        await self._channel.close(None)

    async def _call(self, method: Any, request: Any, timeout_s: float) -> tuple[Any, float, float | None]:
        """The response, its seconds, and the load that came with it."""
        started = time.monotonic()
        call = method(request, timeout=timeout_s, metadata=self.endpoint.metadata())
        try:
            response = await call
            trailing = await call.trailing_metadata()
        except grpc.aio.AioRpcError as error:
            raise error_of(error, self.endpoint.url) from error
        except grpc.aio.UsageError as error:  # the channel was closed meanwhile
            raise ServiceFault(f"expected an open client, got one that is closed: {error}") from error
        return response, time.monotonic() - started, _load(value_of(trailing, LOAD_KEY))


def _load(told: str | bytes | None) -> float | None:
    try:
        return None if told is None else max(0.0, float(told))
    except ValueError:
        return None
