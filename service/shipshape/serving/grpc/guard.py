"""What every RPC of our services passes: limits, parsing, metrics, request id, and the one table of errors."""

from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, NoReturn

import grpc
from google.protobuf.message import DecodeError, EncodeError

from shipshape.errors import InvalidInput
from shipshape.serving.access import Access
from shipshape.serving.clients import Share
from shipshape.serving.encoding import Limits, check_body
from shipshape.serving.faults import Fault, FaultKind, fault_of
from shipshape.serving.grpc.callers import client_of
from shipshape.serving.oip.models import UnknownModel
from shipshape.telemetry import SCAN, SINGLE, STREAM, Metrics, Outcome, new_request_id, request_id
from shipshape.v1 import shipshape_pb2 as pb

STATUS = {
    FaultKind.INVALID_INPUT: grpc.StatusCode.INVALID_ARGUMENT,
    FaultKind.TOO_LARGE: grpc.StatusCode.INVALID_ARGUMENT,
    FaultKind.UNPROCESSABLE: grpc.StatusCode.INVALID_ARGUMENT,
    FaultKind.OVERLOADED: grpc.StatusCode.RESOURCE_EXHAUSTED,
    FaultKind.DEADLINE_EXCEEDED: grpc.StatusCode.DEADLINE_EXCEEDED,
    FaultKind.CANCELLED: grpc.StatusCode.CANCELLED,
    FaultKind.NOT_READY: grpc.StatusCode.UNAVAILABLE,
    FaultKind.UNAUTHENTICATED: grpc.StatusCode.UNAUTHENTICATED,
    FaultKind.INTERNAL: grpc.StatusCode.INTERNAL,
}
Behaviour = Callable[[Any, grpc.ServicerContext], Any]
StreamBehaviour = Callable[[Iterator[Any], grpc.ServicerContext], Generator[Any, None, None]]


@dataclass(frozen=True, slots=True)
class Guarded:
    """A service whose RPCs are guarded."""

    service: str
    door: str  # in the metrics
    methods: Mapping[str, str]  # RPC to its name in the metrics


V1 = Guarded(
    "shipshape.v1.Shipshape",
    "grpc",
    {
        "Recognise": SINGLE,
        "RecogniseScan": SCAN,
        "RecogniseStream": STREAM,
        "GetModelInfo": "model_info",
        "GetCapacity": "capacity",
    },
)


@dataclass(slots=True)
class Call:
    """The RPC under way, for its servicer."""

    outcome: Outcome  # to write
    share: Share  # to take from


current_call: ContextVar[Call] = ContextVar("call")


class Guard(grpc.ServerInterceptor):  # type: ignore[type-arg]  # generic in the stubs only
    """Wraps the methods of one service and leaves all others alone."""

    def __init__(self, guarded: Guarded, metrics: Metrics, limits: Limits, access: Access) -> None:
        self._of = guarded
        self._metrics = metrics
        self._access = access
        self._limits = limits

    def intercept_service(self, continuation: Any, handler_call_details: Any) -> Any:
        """The method's handler, guarded."""
        handler = continuation(handler_call_details)
        service, _, name = handler_call_details.method.removeprefix("/").partition("/")
        if handler is None or service != self._of.service:
            return handler
        method = self._of.methods[name]
        # Neither deserializer nor serializer: gRPC would answer INTERNAL to bytes that do not parse, which is not
        # our fault, and to an answer for which memory is short, without a word in the metrics.
        if handler.request_streaming:
            return grpc.stream_stream_rpc_method_handler(
                self._guarded_stream(handler.stream_stream, handler.request_deserializer)
            )
        return grpc.unary_unary_rpc_method_handler(
            self._guarded(handler.unary_unary, handler.request_deserializer, method)
        )

    def _guarded(self, behaviour: Behaviour, parse: Callable[[bytes], Any], method: str) -> Behaviour:
        def call(raw: bytes, context: grpc.ServicerContext) -> Any:
            """One call: its id, its time, its share, and its refusal in our words."""
            identify(context)
            with self._metrics.request(self._of.door, method) as outcome:
                try:
                    check_body(len(raw), self._limits)
                    message = _parsed(raw, parse, self._of.service)
                    if method == SCAN:
                        outcome.contacts = len(message.contacts)
                    outcome.urgent = method not in (SINGLE, SCAN) or message.options.lane != pb.LANE_BATCH
                    with self._access.clients.share(client_of(context, self._access)) as share:
                        current_call.set(Call(outcome, share))
                        share.take(min(outcome.contacts, self._limits.max_contacts))
                        return _written(behaviour(message, context))
                except Exception as error:
                    fault = fault_of(error)
                    outcome.kind = fault.kind
                    unknown = isinstance(error, UnknownModel)
                    refuse(context, fault, grpc.StatusCode.NOT_FOUND if unknown else None)

        return call

    def _guarded_stream(self, behaviour: StreamBehaviour, parse: Callable[[bytes], Any]) -> StreamBehaviour:
        def call(raws: Iterator[bytes], context: grpc.ServicerContext) -> Generator[Any, None, None]:
            """One stream; what its messages get wrong is their own answers' matter."""
            identify(context)
            set_trailing(context)
            try:
                with closing(behaviour(self._messages(raws, parse), context)) as answers:
                    yield from map(_written, answers)
            except Exception as error:  # a message that is wrong is answered and counted in the stream
                fault = fault_of(error)
                with self._metrics.request(self._of.door, STREAM) as outcome:
                    outcome.kind = fault.kind
                refuse(context, fault)

        return call

    def _messages(self, raws: Iterator[bytes], parse: Callable[[bytes], Any]) -> Iterator[Any]:
        for raw in raws:
            check_body(len(raw), self._limits)
            yield _parsed(raw, parse, self._of.service)


def identify(context: grpc.ServicerContext) -> None:
    """Give the call its id, in its trailing metadata and in the log: the caller's own, else a fresh one."""
    metadata = dict(context.invocation_metadata() or ())
    proposed, traceparent = metadata.get("x-request-id", ""), metadata.get("traceparent", "")
    new_request_id(proposed if isinstance(proposed, str) else "", str(traceparent))


def set_trailing(context: grpc.ServicerContext, *entries: tuple[str, str | bytes]) -> None:
    """Trailing metadata: `entries` and the request's id."""
    context.set_trailing_metadata((*entries, ("x-request-id", request_id.get())))


def refuse(context: grpc.ServicerContext, fault: Fault, status: grpc.StatusCode | None = None) -> NoReturn:
    """End the call with `status`, or that of `fault`, and tell gRPC's own retries how long to wait."""
    entries = [("shipshape-error", str(fault.kind))]
    if fault.retry_after_ms is not None:
        entries.append(("grpc-retry-pushback-ms", str(fault.retry_after_ms)))
    set_trailing(context, *entries)
    context.abort(status or STATUS[fault.kind], fault.message)
    raise AssertionError("unreachable: abort raises")


def _written(response: Any) -> bytes:
    """The response, unless a worker has encoded it already."""
    try:
        return response if isinstance(response, bytes) else response.SerializeToString()
    except EncodeError as error:  # all that protobuf says when memory is short, or an answer over its 2 GiB
        raise MemoryError("no memory to write the answer") from error


def _parsed(raw: bytes, parse: Callable[[bytes], Any], service: str) -> Any:
    try:
        return parse(raw)
    except DecodeError as error:
        raise InvalidInput(
            f"expected a message of {service.rpartition('.')[0]}, got {len(raw)} bytes that do not parse as one"
        ) from error
