"""Callers of a service that is leaving are told to connect anew, which brings them elsewhere."""

from typing import Any

from shipshape.serving.health import Health, State

LEAVING = (State.DRAINED, State.STOPPING)


class Farewell:
    """ASGI middleware: `Connection: close` on every answer in a state of `LEAVING`.

    Without it a connection that is kept alive would be closed by the stop, now and then in the very moment in
    which its client sends the next request.
    """

    def __init__(self, app: Any, health: Health) -> None:
        self._app = app
        self._health = health

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass everything on, and add the header."""

        async def last(message: Any) -> None:
            """Say with the answer's headers that the connection ends here."""
            if message["type"] == "http.response.start" and self._health.state in LEAVING:
                message["headers"] = [*message["headers"], (b"connection", b"close")]
            await send(message)

        await self._app(scope, receive, last)
