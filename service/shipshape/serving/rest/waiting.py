"""Waiting on the event loop for work that other threads compute."""

import asyncio
from collections.abc import Sequence
from typing import Any

from fastapi import Request

from shipshape.executor import Ticket


async def until_settled(tickets: Sequence[Ticket[Any]], request: Request) -> None:
    """Return once all tickets are settled: answered, expired at their deadline, or cancelled by the caller.

    The request's body must have been read, so that the next thing to come from the client is its leaving.
    """
    if not tickets:
        return
    everything: asyncio.Future[Any] = asyncio.gather(
        *(asyncio.wrap_future(ticket.future) for ticket in tickets), return_exceptions=True
    )
    gone: asyncio.Future[Any] = asyncio.ensure_future(_client_leaves(request))
    patience = min(ticket.remaining() for ticket in tickets)
    try:
        await asyncio.wait({everything, gone}, timeout=patience, return_when=asyncio.FIRST_COMPLETED)
        if not gone.done():
            for ticket in tickets:
                ticket.expire()  # does nothing to one that has its answer
    finally:
        gone.cancel()
        for ticket in tickets:
            ticket.cancel()  # does nothing to one that is settled


async def _client_leaves(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
