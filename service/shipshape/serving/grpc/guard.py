"""What every RPC of shipshape.v1 passes: limits, parsing, metrics, request id, and the one table of errors."""

from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import grpc
from google.protobuf.message import DecodeError

from shipshape.errors import InvalidInput
from shipshape.serving.encoding import Limits, check_body
from shipshape.serving.faults import Fault, FaultKind, fault_of
from shipshape.telemetry import SCAN, SINGLE, STREAM, Metrics, new_request_id, request_id

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
METHODS = {"Recognise": SINGLE, "RecogniseScan": SCAN, "GetModelInfo": "model_info"}
PREFIX = "/shipshape.v1.Shipshape/"
Behaviour = Callable[[Any, grpc.ServicerContext], Any]
StreamBehaviour = Callable[[Iterator[Any], grpc.ServicerContext], Iterator[Any]]


class Guard(grpc.ServerInterceptor):  # type: ignore[type-arg]  # generic in the stubs only
    """Wraps the methods of shipshape.v1 and leaves health and reflection alone."""

    def __init__(self, metrics: Metrics, limits: Limits) -> None:
        self._metrics = metrics
        self._limits = limits

    def intercept_service(self, continuation: Any, handler_call_details: Any) -> Any:
        """The method's handler, guarded."""
        handler = continuation(handler_call_details)
        if handler is None or not handler_call_details.method.startswith(PREFIX):
            return handler
        # No deserializer: gRPC would answer INTERNAL to bytes that do not parse, and that is not our fault.
        if handler.request_streaming:
            return grpc.stream_stream_rpc_method_handler(
                self._guarded_stream(handler.stream_stream, handler.request_deserializer),
                response_serializer=handler.response_serializer,
            )
        method = METHODS[handler_call_details.method.removeprefix(PREFIX)]
        return grpc.unary_unary_rpc_method_handler(
            self._guarded(handler.unary_unary, handler.request_deserializer, method),
            response_serializer=handler.response_serializer,
        )

    def _guarded(self, behaviour: Behaviour, parse: Callable[[bytes], Any], method: str) -> Behaviour:
        def call(raw: bytes, context: grpc.ServicerContext) -> Any:
            new_request_id(_proposed_id(context))
            with self._metrics.request("grpc", method) as outcome:
                try:
                    check_body(len(raw), self._limits)
                    message = _parsed(raw, parse)
                    if method == SCAN:
                        outcome.contacts = len(message.contacts)
                    return behaviour(message, context)
                except Exception as error:
                    fault = fault_of(error)
                    outcome.kind = fault.kind
                    _abort(context, fault)

        return call

    def _guarded_stream(self, behaviour: StreamBehaviour, parse: Callable[[bytes], Any]) -> StreamBehaviour:
        def call(raws: Iterator[bytes], context: grpc.ServicerContext) -> Iterator[Any]:
            new_request_id(_proposed_id(context))
            set_trailing(context)
            try:
                yield from behaviour(self._messages(raws, parse), context)
            except (
                Exception
            ) as error:  # what a message alone gets wrong is answered in the stream, and counted there
                fault = fault_of(error)
                with self._metrics.request("grpc", STREAM) as outcome:
                    outcome.kind = fault.kind
                _abort(context, fault)

        return call

    def _messages(self, raws: Iterator[bytes], parse: Callable[[bytes], Any]) -> Iterator[Any]:
        for raw in raws:
            check_body(len(raw), self._limits)
            yield _parsed(raw, parse)


def set_trailing(context: grpc.ServicerContext, *entries: tuple[str, str]) -> None:
    """Trailing metadata: `entries` and the request's id."""
    context.set_trailing_metadata((*entries, ("x-request-id", request_id.get())))


def _parsed(raw: bytes, parse: Callable[[bytes], Any]) -> Any:
    try:
        return parse(raw)
    except DecodeError as error:
        raise InvalidInput(
            f"expected a message of shipshape.v1, got {len(raw)} bytes that do not parse as one"
        ) from error


def _abort(context: grpc.ServicerContext, fault: Fault) -> NoReturn:
    set_trailing(context, ("shipshape-error", fault.kind))
    context.abort(STATUS[fault.kind], fault.message)
    raise AssertionError("unreachable: abort raises")


def _proposed_id(context: grpc.ServicerContext) -> str:
    metadata = dict(context.invocation_metadata() or ())
    proposed = metadata.get("x-request-id", "")
    return proposed if isinstance(proposed, str) else ""
