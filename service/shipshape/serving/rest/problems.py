"""The one table of errors of the REST door, and RFC 9457 problem documents."""

import math
from http import HTTPStatus

import orjson
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.types import Scope

from shipshape.serving.faults import Fault, FaultKind, fault_of
from shipshape.telemetry import new_request_id, request_id

STATUS = {
    FaultKind.INVALID_INPUT: 400,
    FaultKind.TOO_LARGE: 413,
    FaultKind.UNPROCESSABLE: 422,
    FaultKind.OVERLOADED: 429,
    FaultKind.DEADLINE_EXCEEDED: 504,
    FaultKind.CANCELLED: 499,  # not registered, but what proxies log for a client that left
    FaultKind.NOT_READY: 503,
    FaultKind.UNAUTHENTICATED: 401,
    FaultKind.INTERNAL: 500,
}
MEDIA_TYPE = "application/problem+json"
ID_HEADER = "X-Request-Id"
ID_NAME = ID_HEADER.lower().encode()  # as it stands among the bytes
TRACE_NAME = b"traceparent"
RETRY_HEADER = "Shipshape-Retry-After-Ms"  # beside Retry-After, which knows whole seconds only


def identify(scope: Scope) -> str:
    """The request's id, in its problem document and in the log; the same however often it is asked for."""
    state = scope.setdefault("state", {})
    if "request_id" not in state:
        given = {
            name: value.decode("latin-1") for name, value in scope["headers"] if name in (ID_NAME, TRACE_NAME)
        }
        state["request_id"] = new_request_id(given.get(ID_NAME, ""), given.get(TRACE_NAME, ""))
    return str(state["request_id"])


def problem(fault: Fault) -> Response:
    """The problem document of a fault."""
    title = fault.kind.replace("_", " ").capitalize()
    response = document(STATUS[fault.kind], title=title, detail=fault.message, error=fault.kind)
    response.raw_headers += [(name.lower().encode(), text.encode()) for name, text in retry_headers(fault).items()]
    if fault.kind is FaultKind.UNAUTHENTICATED:
        response.raw_headers.append((b"www-authenticate", b"Bearer"))
    return response


def retry_headers(fault: Fault) -> dict[str, str]:
    """When callers who were refused shall come back, if the fault says it."""
    if fault.retry_after_s is None:
        return {}
    whole = max(1, math.ceil(fault.retry_after_s))  # seconds, by its RFC
    return {"Retry-After": str(whole), RETRY_HEADER: str(fault.retry_after_ms)}


def refusal(error: HTTPException, detail: str) -> Response:
    """The problem document of what has no kind of its own, but a status."""
    title = HTTPStatus(error.status_code).phrase
    response = document(error.status_code, title=title, detail=detail, error=FaultKind.INVALID_INPUT)
    response.headers.update(error.headers or {})
    return response


def add_handlers(app: FastAPI) -> None:
    """Give the framework's own refusals the same form."""
    app.add_exception_handler(HTTPException, _framework_refusal)
    app.add_exception_handler(RequestValidationError, _validation_refusal)
    app.add_exception_handler(Exception, _unforeseen)


def _framework_refusal(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    identify(request.scope)
    detail = error.detail
    if error.status_code == 404:
        detail = f"expected a path that /openapi.json lists, got {request.url.path!r:.80}"
    elif error.status_code == 405:
        allowed = (error.headers or {}).get("Allow", "another method")
        detail = f"expected {allowed} on {request.url.path}, got {request.method}"
    return refusal(error, detail)


def _validation_refusal(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    identify(request.scope)
    first = error.errors()[0]
    where = ".".join(map(str, first["loc"]))
    return problem(Fault(FaultKind.INVALID_INPUT, f"expected another value of {where}, got: {first['msg']}"))


def _unforeseen(request: Request, error: Exception) -> Response:
    identify(request.scope)
    return problem(fault_of(error))


def document(status: int, *, title: str, detail: str, error: str) -> Response:
    """A problem document in the words given."""
    body = {
        "type": f"urn:shipshape:problem:{error}",
        "title": title,
        "status": status,
        "detail": detail,
        "error": error,
        "request_id": request_id.get(),
    }
    return Response(orjson.dumps(body), status, {ID_HEADER: request_id.get()}, media_type=MEDIA_TYPE)
