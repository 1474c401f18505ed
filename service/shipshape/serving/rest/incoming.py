"""A request as its handlers see it: looked up in the bytes that came, nothing made that nobody asks for."""

import time
from typing import Annotated

from fastapi import Depends, Request
from starlette.types import Receive, Scope

from shipshape.serving.rest.connection import Connection
from shipshape.serving.rest.mailbox import Mailbox


class Incoming:
    """One request.

    Args:
        scope: Of ASGI, passed by `protocol` and by `doorkeeper`.
        receive: Gives the body.

    Attributes:
        query: What stands behind the question mark, as it came.
        client: The name that limits hold for.
        connection: Tells when the client leaves.
        mailbox: Tells when tickets are settled.
        whole: Whether all of its body was there when its handler began.
    """

    __slots__ = ("_headers", "_received", "client", "connection", "mailbox", "query", "receive", "scope", "whole")

    def __init__(self, scope: Scope, receive: Receive) -> None:
        state = scope["state"]
        self.scope = scope
        self.receive = receive
        self.query: str = scope["query_string"].decode("latin-1")
        self.client: str = state["client"]
        self.connection: Connection = state["connection"]
        self.mailbox: Mailbox = state["mailbox"]
        self.whole: bool = state.get("whole", False)
        self._received: float = state["received"]
        self._headers = dict(reversed(scope["headers"]))  # the first of each name

    def header(self, name: bytes) -> str | None:
        """The first header of this name, which is in small letters; None without one."""
        value: bytes | None = self._headers.get(name)
        return None if value is None else value.decode("latin-1")

    def waited(self) -> float:
        """Seconds since its first byte came."""
        return time.monotonic() - self._received


async def incoming(request: Request) -> Incoming:
    """The same of the framework's request."""
    return Incoming(request.scope, request.receive)


FromRequest = Annotated[Incoming, Depends(incoming)]  # of a handler that the framework calls
