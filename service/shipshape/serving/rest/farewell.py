"""Callers of a service that is leaving are told to connect anew, which brings them elsewhere."""

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from shipshape.serving.health import Health


class Farewell:
    """ASGI middleware: `Connection: close` on every answer of a service that is leaving.

    Without it a connection that is kept alive would be closed by the stop, now and then in the very moment in
    which its client sends the next request.
    """

    def __init__(self, app: ASGIApp, health: Health) -> None:
        self._app = app
        self._health = health

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass everything on, and add the header."""

        async def last(message: Message) -> None:
            """Say with the answer's headers that the connection ends here."""
            if message["type"] == "http.response.start" and self._health.leaving:
                message["headers"] = [*message["headers"], (b"connection", b"close")]
            await send(message)

        await self._app(scope, receive, last)
