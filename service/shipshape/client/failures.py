"""How a call ended -> an error of the product; which of them may be tried again."""

from typing import Any

import grpc

from shipshape.errors import (
    Cancelled,
    DeadlineExceeded,
    InvalidInput,
    NotReady,
    Overloaded,
    ServiceFault,
    ShipshapeError,
    TooLarge,
    Unauthenticated,
    Unprocessable,
    Unreachable,
)
from shipshape.v1 import shipshape_pb2 as pb

KINDS: dict[str, type[ShipshapeError]] = {
    "invalid_input": InvalidInput,
    "too_large": TooLarge,
    "unprocessable": Unprocessable,
    "overloaded": Overloaded,
    "deadline_exceeded": DeadlineExceeded,
    "cancelled": Cancelled,
    "not_ready": NotReady,
    "internal": ServiceFault,
    "unauthenticated": Unauthenticated,
}
# What gRPC itself says, without a kind of ours: of RESOURCE_EXHAUSTED, that a message is over its limit.
STATUS: dict[grpc.StatusCode, type[ShipshapeError]] = {
    grpc.StatusCode.UNAVAILABLE: Unreachable,
    grpc.StatusCode.DEADLINE_EXCEEDED: DeadlineExceeded,
    grpc.StatusCode.RESOURCE_EXHAUSTED: TooLarge,
    grpc.StatusCode.CANCELLED: Unreachable,  # by the service that stops: what the caller cancels has no status
    grpc.StatusCode.UNAUTHENTICATED: Unauthenticated,
}
# A recognition changes nothing in the service: to ask again is always safe, and after these it may help.
RETRYABLE = (Unreachable, NotReady, Overloaded)
KIND_KEY, PUSHBACK_KEY = "shipshape-error", "grpc-retry-pushback-ms"


def error_of(call: grpc.aio.AioRpcError, where: str) -> ShipshapeError:
    """The error of a call to `where` that ended with a status."""
    trailing = call.trailing_metadata()
    kind, details = KINDS.get(str(value_of(trailing, KIND_KEY))), call.details() or ""
    if kind is Overloaded:
        return Overloaded(details, retry_after_s=_seconds(value_of(trailing, PUSHBACK_KEY)))
    if kind is not None:
        return kind(details)
    status = call.code()
    if status is grpc.StatusCode.DEADLINE_EXCEEDED:
        return Silent(f"expected an answer of {where} in time, got none")
    if status is grpc.StatusCode.UNAVAILABLE:
        return Unreachable(
            f"expected a service at {where}, got none: is it running, and is that its address? {details}"
        )
    return STATUS.get(status, ServiceFault)(f"expected an answer of {where}, got {status.name}: {details}")


def error_of_contact(error: pb.ContactError) -> ShipshapeError:
    """The error of one contact of a scan, or of one message of a stream."""
    known = error.kind in pb.ErrorKind.values()  # a newer service may have others
    name = pb.ErrorKind.Name(error.kind).removeprefix("ERROR_KIND_").lower() if known else ""
    kind = KINDS.get(name, ServiceFault)
    if kind is Overloaded and error.HasField("retry_after_ms"):
        return Overloaded(error.message, retry_after_s=error.retry_after_ms / 1e3)
    return kind(error.message)


def value_of(metadata: Any, key: str) -> str | bytes | None:
    """The first value of a key; gRPC's metadata are pairs, though they have the methods of a mapping."""
    return next((value for name, value in metadata or () if name == key), None)


class Silent(DeadlineExceeded):
    """The service said nothing within the deadline, not even that it is too short."""


def _seconds(milliseconds: object) -> float | None:
    try:
        return max(0.0, float(str(milliseconds)) / 1e3)
    except ValueError:
        return None
