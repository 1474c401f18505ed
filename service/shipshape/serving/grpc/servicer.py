"""shipshape.v1.Shipshape: translate, delegate to the core, translate back."""

from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import grpc

from shipshape.executor import Ticket
from shipshape.serving.core import Core, conclude, outcome_of
from shipshape.serving.encoding import check_contacts
from shipshape.serving.grpc import convert
from shipshape.serving.grpc.guard import current_call, set_trailing
from shipshape.serving.grpc.streams import STREAMS, Streams
from shipshape.serving.load_report import GRPC_TRAILER, PLAIN_TRAILER, as_message
from shipshape.serving.model import Order
from shipshape.serving.timing import LONGEST_MS, Timeouts, server_timing
from shipshape.telemetry import Metrics
from shipshape.v1 import shipshape_pb2 as pb
from shipshape.v1 import shipshape_pb2_grpc as pb_grpc

USUAL_POINTS = 300  # of a contact, when nothing else is said
NEVER_S = 365 * 86400.0  # gRPC hands out centuries when the caller set no deadline


class Servicer(pb_grpc.ShipshapeServicer):
    """The methods of the contract; errors are the guard's matter.

    Answers with recognitions are the bytes that the workers encoded; the guard passes bytes on as they are.
    """

    def __init__(self, core: Core, metrics: Metrics, timeouts: Timeouts, streams: Streams) -> None:
        self._core = core
        self._metrics = metrics
        self._timeouts = timeouts
        self._streams = streams

    def Recognise(self, request: pb.RecogniseRequest, context: grpc.ServicerContext) -> bytes:
        """One contact."""
        model = self._core.model()
        wishes = convert.to_wishes(request.options)
        contact = convert.to_contact(request.contact, self._core.limits)
        order = Order(contact, wishes, convert.encode_single)
        ticket = self._core.submit(model, order, deadline_of(self._core, self._timeouts, context))
        cancel_with(context, [ticket])
        reply = ticket.result()
        current_call.get().outcome.kind = outcome_of(reply)
        set_timing(context, reply.stage_ms, self._core.load())
        return bytes(reply.content)

    def RecogniseScan(self, request: pb.RecogniseScanRequest, context: grpc.ServicerContext) -> bytes:
        """Many contacts of one scan."""
        model = self._core.model()
        wishes = convert.to_wishes(request.options)
        check_contacts(len(request.contacts), self._core.limits)
        contacts = convert.to_contacts(request.contacts, self._core.limits)
        deadline = deadline_of(self._core, self._timeouts, context)
        scan = self._core.submit_scan(model, contacts, wishes, convert.encode_in_scan, deadline)
        cancel_with(context, scan.tickets)
        outcomes, stage_ms = conclude(scan, "grpc", self._metrics)
        set_timing(context, stage_ms, self._core.load())
        contact_ids = (contact.contact_id for contact in request.contacts)
        return convert.joined(pb.RecogniseScanResponse, contact_ids, outcomes)

    def RecogniseStream(
        self, request_iterator: Iterator[pb.RecogniseStreamRequest], context: grpc.ServicerContext
    ) -> Iterator[bytes]:
        """Many messages in one long call."""
        return self._streams.serve(request_iterator, context)

    def GetModelInfo(
        self, request: pb.GetModelInfoRequest, context: grpc.ServicerContext
    ) -> pb.GetModelInfoResponse:
        """What this service runs and what it accepts."""
        info = convert.from_model(self._core.model(), version("shipshape"))
        limits = self._core.limits
        info.limits.max_body_bytes = limits.max_body_bytes
        info.limits.max_points = limits.max_points
        info.limits.max_contacts = limits.max_contacts
        info.limits.default_timeout_ms = self._timeouts.default_ms
        info.limits.budget_ms = self._timeouts.budget_ms
        info.limits.max_streams = STREAMS
        set_trailing(context)
        return info

    def GetCapacity(self, request: pb.GetCapacityRequest, context: grpc.ServicerContext) -> pb.GetCapacityResponse:
        """What would be promised now, and how the budget is doing."""
        capacity = self._core.capacity(request.points or USUAL_POINTS, convert.to_lane(request.lane))
        set_trailing(context)
        return convert.from_capacity(capacity, self._metrics.budget.report())


def deadline_of(core: Core, timeouts: Timeouts, context: grpc.ServicerContext) -> float:
    """The caller's deadline, or the default one, on the executor's clock."""
    remaining = context.time_remaining()
    if remaining is None or remaining > NEVER_S:
        remaining = timeouts.default_ms / 1e3
    return core.deadline_in(min(remaining, LONGEST_MS / 1e3))


def cancel_with(context: grpc.ServicerContext, tickets: Sequence[Ticket[Any]]) -> None:
    """Drop the work when the RPC ends before it."""

    def cancel() -> None:
        """The RPC has ended; does nothing to a ticket that is settled."""
        for ticket in tickets:
            ticket.cancel()

    if not context.add_callback(cancel):  # it has ended already
        cancel()


def set_timing(context: grpc.ServicerContext, stage_ms: Mapping[str, float], load: float) -> None:
    """Trailing metadata: the milliseconds of each stage, the load and the request's id."""
    current_call.get().outcome.computed(stage_ms)
    loads = ((GRPC_TRAILER, as_message(load)), (PLAIN_TRAILER, f"{load:.3f}"))
    set_trailing(context, ("server-timing", server_timing(stage_ms)), *loads)
