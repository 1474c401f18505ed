"""From the threads that settle tickets to the event loop that waits for them."""

import asyncio
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

from shipshape.executor import Ticket


class Mailbox:
    """Hands what threads have settled to one event loop: many tickets at a time, for one awakening."""

    def __init__(self) -> None:
        self._settled: deque[_Waiter] = deque()
        self._rung = False  # whether the loop has been told to look

    def wait_for(self, tickets: Sequence[Ticket[Any]]) -> asyncio.Future[None]:
        """Done when all tickets are; called on the loop."""
        waiter = _Waiter(self, asyncio.get_running_loop(), len(tickets))
        for ticket in tickets:
            ticket.future.add_done_callback(waiter.one_settled)
        return waiter.done

    def put(self, waiter: "_Waiter") -> None:
        """One of its tickets is settled; called on any thread."""
        self._settled.append(waiter)
        if not self._rung:
            self._rung = True
            with suppress(RuntimeError):  # the loop has ended, and with it who waited
                waiter.loop.call_soon_threadsafe(self._deliver)

    def _deliver(self) -> None:
        self._rung = False  # before looking: what comes from now on rings again
        while self._settled:
            self._settled.popleft().count_down()


class _Waiter:
    """One request that waits for so many tickets."""

    __slots__ = ("_left", "_mailbox", "done", "loop")

    def __init__(self, mailbox: Mailbox, loop: asyncio.AbstractEventLoop, left: int) -> None:
        self.done: asyncio.Future[None] = loop.create_future()
        self.loop = loop
        self._mailbox = mailbox
        self._left = left

    def one_settled(self, _: Future[Any]) -> None:
        """Called on whichever thread has settled a ticket."""
        self._mailbox.put(self)

    def count_down(self) -> None:
        """Called on the loop."""
        self._left -= 1
        if self._left == 0 and not self.done.done():
            self.done.set_result(None)
