"""An event loop that wakes when it is told to."""

import asyncio
import select
import selectors


class PreciseSelector(selectors.DefaultSelector):
    """Waits in microseconds.

    epoll waits in whole milliseconds, rounded up, which would send each request half a millisecond late. An epoll
    is itself something that can be waited for, which select does in microseconds.
    """

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """As any selector's."""
        if timeout is not None and timeout > 0:
            select.select([self], [], [], timeout)
            timeout = 0
        return super().select(timeout)


def precise_loop() -> asyncio.AbstractEventLoop:
    """A fresh event loop whose timers are exact to some tens of microseconds."""
    return asyncio.SelectorEventLoop(PreciseSelector())
