"""An HTTP listener: uvicorn in a thread of its own, on a socket that was bound before."""

import socket
import ssl
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import uvicorn
from starlette.types import ASGIApp

from shipshape.serving.rest.protocol import Protocol
from shipshape.serving.tls import Tls

KEEP_ALIVE_S = 75  # longer than proxies keep idle connections, else they meet a closed one now and then
READ_S = 60.0  # in which a client takes some of what is on its way to it, or loses its connection and the answer


class RestDoor:
    """Listens from `start` to `stop`.

    Args:
        app: Answers.
        tls: None speaks plain HTTP.
        on_death: Called when the listener ends without having been asked to.
        name: How threads and error messages call it.
        shared: Other processes may listen on the same port; the system spreads connections among them.
    """

    def __init__(
        self,
        app: ASGIApp,
        tls: Tls | None,
        *,
        on_death: Callable[[], None],
        name: str = "REST",
        shared: bool = False,
    ) -> None:
        self._app = app
        self._tls = tls
        self._name = name
        self._on_death = on_death
        self._shared = shared
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    def start(self, host: str, port: int) -> int:
        """Listen; the real port.

        Raises:
            OSError: The address cannot be bound.
        """
        listener = _listener(host, port, self._name, shared=self._shared)
        bound: int = listener.getsockname()[1]
        # log_config: the service's own log format holds. access_log: the metrics and debug lines tell more.
        config = uvicorn.Config(
            self._app,
            log_config=None,
            access_log=False,
            http=Protocol,
            timeout_keep_alive=KEEP_ALIVE_S,
            ws="none",
            lifespan="on",
            server_header=False,
            proxy_headers=False,  # a caller could name any address as its own
            ssl_context_factory=None if self._tls is None else partial(_context, self._tls),
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._serve, args=(self._server, listener), name=self._name.lower(), daemon=True
        )
        self._thread.start()
        return bound

    def stop(self, drain_s: float) -> None:
        """Accept no more, let requests under way end for up to `drain_s` seconds, then break them off."""
        if self._server is None or self._thread is None:
            return
        self._server.config.timeout_graceful_shutdown = max(1, round(drain_s))
        self._server.should_exit = True
        self._thread.join(drain_s + 2)

    def _serve(self, server: uvicorn.Server, listener: socket.socket) -> None:
        try:
            server.run(sockets=[listener])
        finally:
            listener.close()
            if not server.should_exit:
                self._on_death()


def _context(tls: Tls, *_: Any) -> ssl.SSLContext:  # what uvicorn passes on is for those who have none
    return tls.context()


def _listener(host: str, port: int, name: str, *, shared: bool) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # Of TCP by name: else asyncio's own loop takes it for something that needs no TCP_NODELAY.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    if sys.platform == "linux":  # connections inherit it; elsewhere who never reads keeps the answer in memory
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, round(READ_S * 1e3))
    if shared:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    try:
        listener.bind((host, port))
        listener.listen(2048)
    except OSError as error:
        listener.close()
        reason = error.strerror or error
        raise OSError(f"expected to listen on {host}:{port} for {name}, got: {reason}") from error
    return listener
