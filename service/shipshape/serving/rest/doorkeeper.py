"""Who comes in through the REST door: a token for every path but those of health, and whose limits hold."""

import logging
import ssl
from asyncio import Transport
from collections.abc import Mapping
from typing import Any

from fastapi import Request
from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from shipshape import console
from shipshape.errors import Unauthenticated
from shipshape.serving.access import Access
from shipshape.serving.faults import fault_of
from shipshape.serving.rest.problems import identify, problem

OPEN = frozenset({"/startedz", "/livez", "/readyz"})  # probes hold no tokens

_logger = logging.getLogger(__name__)


class Doorkeeper:
    """Refuses a request without a good token before its body is read, whichever path it is meant for."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """The application's answer, or 401."""
        if scope["type"] == "http" and scope["path"] not in OPEN and not console.is_open(scope["path"]):
            request = Request(scope)
            address = request.client.host if request.client else ""
            certificate = getattr(request.state, "certificate", None)
            try:
                given = request.headers.getlist("authorization")
                request.state.client = self._access.client(given, certificate, address)
            except Unauthenticated as error:
                identify(request)
                _logger.debug("refused %s: %s", address, error)
                await problem(fault_of(error))(scope, receive, send)
                return
        await self._app(scope, receive, send)


class CertifiedProtocol(H11Protocol):
    """HTTP/1.1 that tells the application, as `state.certificate`, the name in the client's certificate."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]  # as its parent does
        """A connection, its handshake done."""
        super().connection_made(transport)
        connection: ssl.SSLObject | None = transport.get_extra_info("ssl_object")
        shown = connection.getpeercert() if connection is not None else None
        self.app_state = {**self.app_state, "certificate": _name(shown) if shown else None}


def _name(certificate: Mapping[str, Any]) -> str | None:
    subject = [value for part in certificate.get("subject", ()) for key, value in part if key == "commonName"]
    alternatives = [value for _, value in certificate.get("subjectAltName", ())]
    return next(filter(None, subject + alternatives), None)
