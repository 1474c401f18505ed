"""Waiting on the event loop for work that others compute, without a task or a timer a request."""

from collections.abc import Sequence
from typing import Any

from shipshape.executor import Ticket
from shipshape.serving.rest.incoming import Incoming


async def until_settled(tickets: Sequence[Ticket[Any]], incoming: Incoming) -> None:
    """Return once all tickets are settled: answered, expired at their deadline, or cancelled as the client left.

    The executor itself expires tickets, so there is no timer here.
    """
    if all(ticket.settled for ticket in tickets):
        return
    waiter = incoming.mailbox.wait_for(tickets)
    incoming.connection.watch(waiter)
    try:
        await waiter
    finally:
        incoming.connection.unwatch(waiter)
        for ticket in tickets:
            if not ticket.settled:
                ticket.cancel()
