"""What all requests share that come over one connection: who asks, and whether somebody still listens."""

import asyncio


class Connection:
    """Used on the event loop alone.

    Args:
        client: The name that limits hold for, where no token says another.
    """

    __slots__ = ("_lost", "_watchers", "client")

    def __init__(self, client: str) -> None:
        self.client = client
        self._lost = False
        self._watchers: set[asyncio.Future[None]] = set()

    def watch(self, watcher: asyncio.Future[None]) -> None:
        """Settle `watcher` when the connection is lost, unless it is settled by then."""
        self._watchers.add(watcher)
        if self._lost:
            self.lose()

    def unwatch(self, watcher: asyncio.Future[None]) -> None:
        """Nobody awaits it any more."""
        self._watchers.discard(watcher)

    def lose(self) -> None:
        """The client has left: nobody will read an answer."""
        self._lost = True
        for watcher in self._watchers:
            if not watcher.done():
                watcher.set_result(None)
