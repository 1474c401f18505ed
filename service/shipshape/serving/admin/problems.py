"""The one table of errors of the admin door."""

from fastapi import FastAPI, Request, Response

from shipshape.errors import (
    BundleError,
    Cancelled,
    Conflict,
    InvalidInput,
    ShipshapeError,
)
from shipshape.serving.rest.problems import document, identify

STATUS: dict[type[ShipshapeError], tuple[int, str]] = {
    InvalidInput: (400, "invalid_input"),
    Conflict: (409, "conflict"),
    BundleError: (422, "bundle_refused"),
    Cancelled: (503, "not_ready"),  # the service was told to stop
}


def add_refusals(app: FastAPI) -> None:
    """Answer each error of the table with its problem document."""
    for kind in STATUS:
        app.add_exception_handler(kind, _refusal)


def _refusal(request: Request, error: Exception) -> Response:
    identify(request.scope)
    status, name = next(STATUS[kind] for kind in type(error).__mro__ if kind in STATUS)
    return document(status, title=name.replace("_", " ").capitalize(), detail=str(error), error=name)
