"""The paths that are asked thousands of times a second go straight to their handlers, past the framework.

The framework documents these paths, and would answer them with the same bytes (docs/adr/0018).
"""

from collections.abc import Awaitable, Callable, Mapping

from fastapi import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from shipshape.serving.rest.incoming import Incoming


class Front:
    """ASGI application.

    Args:
        app: Answers all else.
        posts: Handlers of POST, by path.
    """

    def __init__(self, app: ASGIApp, posts: Mapping[str, Callable[[Incoming], Awaitable[Response]]]) -> None:
        self._app = app
        self._posts = posts

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """The handler's answer, or the framework's."""
        handler = self._posts.get(scope["path"]) if scope.get("method") == "POST" else None
        if handler is None:
            await self._app(scope, receive, send)
            return
        response = await handler(Incoming(scope, receive))
        start = {"type": "http.response.start", "status": response.status_code, "headers": response.raw_headers}
        await send(start)
        await send({"type": "http.response.body", "body": response.body})
