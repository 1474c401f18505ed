"""Who comes in through the REST door: a token for every path but those of health, and whose limits hold."""

import logging

from starlette.types import ASGIApp, Receive, Scope, Send

from shipshape import console
from shipshape.errors import Unauthenticated
from shipshape.serving.access import Access
from shipshape.serving.clients import client_name
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
            state = scope["state"]
            given = [value.decode("latin-1") for name, value in scope["headers"] if name == b"authorization"]
            try:
                holder = self._access.holder(given)
            except Unauthenticated as error:
                identify(scope)
                _logger.debug("refused %s: %s", state["connection"].client, error)
                await problem(fault_of(error))(scope, receive, send)
                return
            state["client"] = state["connection"].client if holder is None else client_name(holder, None, "")
        await self._app(scope, receive, send)
