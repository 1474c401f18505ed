"""HTTP/1.1 on one connection: uvicorn's, with bounds and refusals that it lacks, and what handlers ask of it.

Refused although the parser takes it: a request of HTTP/1.1 without one Host, and other versions. A wish to speak
another protocol is passed over, as the standard allows, and trailers are dropped: none may pass for a header.
"""

import logging
import ssl
import time
from asyncio import Transport
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from httptools import HttpParserError, HttpParserUpgrade, HttpRequestParser
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from shipshape.serving.clients import client_name
from shipshape.serving.faults import FaultKind
from shipshape.serving.rest.connection import Connection
from shipshape.serving.rest.joined import Joined
from shipshape.serving.rest.problems import document
from shipshape.telemetry import new_request_id

HEADER_BYTES = 64 * 2**10  # of one request; and at most so many come without anything of it being complete
HEAD_S = 20.0  # in which the headers of a request must come, once they began to
REST_S = 20.0  # in which the rest of a body comes, once its request was answered without
LINGER_S = 1.0  # in which a client that is still sending gets to read why it was refused
MOST_PIPELINED = 1024  # requests on one connection that wait for the one before them
MOST_CONNECTIONS = 4096
VERSIONS = ("1.0", "1.1")
_INVALID, _OVERLOADED = FaultKind.INVALID_INPUT, FaultKind.OVERLOADED

_logger = logging.getLogger(__name__)


class Protocol(HttpToolsProtocol):
    """Each request's state gets its `connection`, and what `Incoming` says of `received` and `whole`."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]  # as its parent does
        """A connection, its handshake done."""
        super().connection_made(transport)
        self._heading = self._in_body = False  # which part of a request is on its way
        self._silent = 0  # bytes since anything of a request was complete
        self._answered = 0.0  # when the last answer was complete, monotonic seconds
        tls: ssl.SSLObject | None = transport.get_extra_info("ssl_object")
        certificate = _name(tls.getpeercert() or {}) if tls is not None else None
        self._connection = Connection(client_name(None, certificate, self.client[0] if self.client else ""))
        self._joined: Any = Joined(transport)
        self.app_state = {**self.app_state, "connection": self._connection}
        if len(self.connections) > MOST_CONNECTIONS:
            sentence = f"expected at most {MOST_CONNECTIONS} connections, got one more"
            self._refuse(_RefusedError(429, _OVERLOADED, sentence))
        else:
            self._close_in(self.timeout_keep_alive)

    def connection_lost(self, exc: Exception | None) -> None:
        """The client left, or was sent away."""
        super().connection_lost(exc)
        self._unset_keepalive_if_required()
        self._connection.lose()

    def data_received(self, data: bytes) -> None:
        """Parse; a request begins as soon as its headers are complete."""
        if self.parser is None or self.transport.is_closing():  # it was refused, what follows is not read
            return
        self._silent += len(data)
        self._unset_keepalive_if_required()
        try:
            self._feed(data)
        except HttpParserError as error:
            known = error.__context__
            sentence = f"expected a request of HTTP/1.1, got something else: {error}"
            self._refuse(known if isinstance(known, _RefusedError) else _RefusedError(400, _INVALID, sentence))
            return
        if self._silent > HEADER_BYTES:
            self._refuse(_too_large())
        elif not self._owed():
            self._close_in(self._patience())

    def on_message_begin(self) -> None:
        """The first byte of a request."""
        super().on_message_begin()
        self._heading, self._in_body, self._silent = True, False, 0
        self.scope["state"]["received"] = time.monotonic()

    def on_headers_complete(self) -> None:
        """Begin the request; what this raises refuses it."""
        self._heading, self._silent = False, 0
        if self.parser.should_upgrade() and self.parser.get_method() != b"CONNECT":
            return  # the parser stops here, and `_feed` goes on
        self._check_head()
        super().on_headers_complete()
        self._in_body = True
        self.cycle.transport = self._joined
        self.headers = []  # for the trailers; the request keeps the list that it has

    def on_body(self, body: bytes) -> None:
        """Some of the body."""
        self._silent = 0
        super().on_body(body)

    def on_message_complete(self) -> None:
        """The end of a request."""
        if not self.parser.should_upgrade():
            self._in_body = False
            self.scope["state"]["whole"] = True
            super().on_message_complete()

    def on_response_complete(self) -> None:
        """The end of an answer."""
        self._joined.flush()
        self._answered = time.monotonic()
        super().on_response_complete()

    def _check_head(self) -> None:
        version, method = self.parser.get_http_version(), self.parser.get_method()
        if version not in VERSIONS or method == b"CONNECT":
            raise _RefusedError(400, _INVALID, f"expected HTTP/1.1, got HTTP/{version} and {method.decode()}")
        hosts = sum(name == b"host" for name, _ in self.headers)
        if hosts > 1 or (hosts == 0 and version == "1.1"):
            raise _RefusedError(400, _INVALID, f"expected the header Host once, got it {hosts} times")
        if len(self.url) + sum(len(name) + len(value) + 4 for name, value in self.headers) > HEADER_BYTES:
            raise _too_large()
        if len(self.pipeline) >= MOST_PIPELINED:
            raise _RefusedError(429, _OVERLOADED, f"expected at most {MOST_PIPELINED} requests at once, got more")

    def _feed(self, data: bytes) -> None:
        """Parse; raises HttpParserError at what is no request."""
        while True:
            try:
                self.parser.feed_data(data)
                return
            except HttpParserUpgrade as stopped:
                data = self._head_without_upgrade() + data[stopped.args[0] :]
                self.parser = HttpRequestParser(self)

    def _head_without_upgrade(self) -> bytes:
        kept = [b"%s: %s\r\n" % (name, value) for name, value in self.headers if name != b"upgrade"]
        version = self.parser.get_http_version().encode()
        return b"%s %s HTTP/%s\r\n%s\r\n" % (self.parser.get_method(), self.url, version, b"".join(kept))

    def _close_in(self, seconds: float) -> None:
        """Close, unless something comes before."""
        self.timeout_keep_alive_task = self.loop.call_later(seconds, self.timeout_keep_alive_handler)

    def _patience(self) -> float:
        """Seconds for what comes next from a client that waits for no answer."""
        if self._heading:
            return float(self.scope["state"]["received"] + HEAD_S - time.monotonic())
        if self._in_body:
            return self._answered + REST_S - time.monotonic()
        return self.timeout_keep_alive

    def _owed(self) -> bool:
        """Whether a request whose headers came is still to be answered."""
        return self.cycle is not None and not self.cycle.response_complete

    def _refuse(self, refused: "_RefusedError") -> None:
        """Read no more of this connection, and close it; before that, answer what can still be answered."""
        _logger.debug("refused %s: %s", self._connection.client, refused.sentence)
        self.parser = None  # type: ignore[assignment]  # as its parent does
        if self._owed() and (self.pipeline or not self._in_body):
            self.cycle.keep_alive = False  # whole requests came before: theirs are the next answers
            return
        if not (self._in_body and self.cycle.response_started):
            self.transport.write(self._written(refused))
        if self._owed():  # who still waits for the body
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        if self.transport.can_write_eof():
            self.transport.write_eof()
            self._close_in(LINGER_S)  # a socket that is closed with bytes unread takes back what it has sent
        else:
            self.transport.close()

    def _written(self, refused: "_RefusedError") -> bytes:
        new_request_id()
        title = HTTPStatus(refused.status).phrase
        response = document(refused.status, title=title, detail=refused.sentence, error=refused.kind)
        headers = [*self.server_state.default_headers, *response.raw_headers, (b"connection", b"close")]
        lines = b"".join(b"%s: %s\r\n" % header for header in headers)
        return b"%s%s\r\n%s" % (STATUS_LINE[refused.status], lines, response.body)


class _RefusedError(Exception):
    """What came is refused before any handler is asked."""

    def __init__(self, status: int, kind: FaultKind, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status
        self.kind = kind
        self.sentence = sentence


def _too_large() -> _RefusedError:
    return _RefusedError(431, FaultKind.TOO_LARGE, f"expected at most {HEADER_BYTES} bytes of headers, got more")


def _name(certificate: Mapping[str, Any]) -> str | None:
    subject = [value for part in certificate.get("subject", ()) for key, value in part if key == "commonName"]
    alternatives = [value for _, value in certificate.get("subjectAltName", ())]
    return next(filter(None, subject + alternatives), None)
