"""What every RPC of our services passes: limits, parsing, metrics, request id, and the one table of errors."""

import math
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, NoReturn

import grpc
from google.protobuf.message import DecodeError

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import Limits, check_body
from shipshape.serving.faults import Fault, FaultKind, fault_of
from shipshape.serving.oip.models import UnknownModel
from shipshape.telemetry import DEGRADED, SCAN, SINGLE, Metrics, Outcome, new_request_id, request_id
from shipshape.types import Rung
from shipshape.v1 import shipshape_pb2 as pb

STATUS = {
    FaultKind.INVALID_INPUT: grpc.StatusCode.INVALID_ARGUMENT,
    FaultKind.TOO_LARGE: grpc.StatusCode.INVALID_ARGUMENT,
    FaultKind.UNPROCESSABLE: grpc.StatusCode.INVALID_ARGUMENT,
    FaultKind.OVERLOADED: grpc.StatusCode.RESOURCE_EXHAUSTED,
    FaultKind.DEADLINE_EXCEEDED: grpc.StatusCode.DEADLINE_EXCEEDED,
    FaultKind.CANCELLED: grpc.StatusCode.CANCELLED,
    FaultKind.NOT_READY: grpc.StatusCode.UNAVAILABLE,
    FaultKind.INTERNAL: grpc.StatusCode.INTERNAL,
}
Behaviour = Callable[[Any, grpc.ServicerContext], Any]


@dataclass(frozen=True, slots=True)
class Guarded:
    """A service whose RPCs are guarded."""

    service: str
    door: str  # in the metrics
    methods: Mapping[str, str]  # RPC to its name in the metrics


V1 = Guarded(
    "shipshape.v1.Shipshape",
    "grpc",
    {"Recognise": SINGLE, "RecogniseScan": SCAN, "GetModelInfo": "model_info", "GetCapacity": "capacity"},
)
current_outcome: ContextVar[Outcome] = ContextVar("outcome")  # of the RPC under way, for its servicer to write


class Guard(grpc.ServerInterceptor):  # type: ignore[type-arg]  # generic in the stubs only
    """Wraps the methods of one service and leaves all others alone."""

    def __init__(self, guarded: Guarded, metrics: Metrics, limits: Limits) -> None:
        self._of = guarded
        self._metrics = metrics
        self._limits = limits

    def intercept_service(self, continuation: Any, handler_call_details: Any) -> Any:
        """The method's handler, guarded."""
        handler = continuation(handler_call_details)
        service, _, name = handler_call_details.method.removeprefix("/").partition("/")
        if handler is None or service != self._of.service:
            return handler
        method = self._of.methods[name]
        # No deserializer: gRPC would answer INTERNAL to bytes that do not parse, and that is not our fault.
        return grpc.unary_unary_rpc_method_handler(
            self._guarded(handler.unary_unary, handler.request_deserializer, method),
            response_serializer=handler.response_serializer,
        )

    def _guarded(self, behaviour: Behaviour, parse: Callable[[bytes], Any], method: str) -> Behaviour:
        def call(raw: bytes, context: grpc.ServicerContext) -> Any:
            new_request_id(_proposed_id(context))
            with self._metrics.request(self._of.door, method) as outcome:
                current_outcome.set(outcome)
                try:
                    check_body(len(raw), self._limits)
                    message = _parsed(raw, parse, self._of.service)
                    if method == SCAN:
                        outcome.contacts = len(message.contacts)
                    outcome.urgent = method not in (SINGLE, SCAN) or message.options.lane != pb.LANE_BATCH
                    response = behaviour(message, context)
                except Exception as error:
                    fault = fault_of(error)
                    outcome.kind = fault.kind
                    set_trailing(context, ("shipshape-error", fault.kind), *_pushback(fault))
                    unknown = isinstance(error, UnknownModel)
                    _abort(context, grpc.StatusCode.NOT_FOUND if unknown else STATUS[fault.kind], fault.message)
                if method == SINGLE and response.recognition.rung != Rung.FULL:
                    outcome.kind = DEGRADED
                return response

        return call


def set_trailing(context: grpc.ServicerContext, *entries: tuple[str, str | bytes]) -> None:
    """Trailing metadata: `entries` and the request's id."""
    context.set_trailing_metadata((*entries, ("x-request-id", request_id.get())))


def _pushback(fault: Fault) -> tuple[tuple[str, str], ...]:
    """When clients with a retry policy shall come back; theirs is ignored then."""
    if fault.retry_after_s is None:
        return ()
    return (("grpc-retry-pushback-ms", str(math.ceil(fault.retry_after_s * 1e3))),)


def _parsed(raw: bytes, parse: Callable[[bytes], Any], service: str) -> Any:
    try:
        return parse(raw)
    except DecodeError as error:
        raise InvalidInput(
            f"expected a message of {service.rpartition('.')[0]}, got {len(raw)} bytes that do not parse as one"
        ) from error


def _abort(context: grpc.ServicerContext, code: grpc.StatusCode, message: str) -> NoReturn:
    context.abort(code, message)
    raise AssertionError("unreachable: abort raises")


def _proposed_id(context: grpc.ServicerContext) -> str:
    metadata = dict(context.invocation_metadata() or ())
    proposed = metadata.get("x-request-id", "")
    return proposed if isinstance(proposed, str) else ""
