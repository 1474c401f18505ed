"""A worker process as the executor sees it: what it has been given, and the socket to it."""

import os
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from shipshape.executor.admission import AHEAD_S
from shipshape.executor.crew import WEDGED_S, Hand
from shipshape.executor.entry import Entry
from shipshape.executor.lanes import Lane, Queues
from shipshape.executor.messages import Inbox, packed

MOST = 16  # entries that it is given at a time


class ProcessHand(Hand):
    """A worker process; its thread of the crew reads what it says."""

    def __init__(self, connection: socket.socket, wake: Callable[[], None]) -> None:
        super().__init__()
        connection.setblocking(False)
        self.connection = connection
        self.inbox = Inbox()
        self.unsent = bytearray()
        self.process_id: int | None = None  # known once it has said so
        self.born = time.monotonic()
        self._ahead: Queues[Entry] = Queues()
        self._closed = False
        self._sending = threading.Lock()
        self._wake = wake
        self._heard = time.monotonic()

    def give(self, entry: Entry) -> None:
        """One more entry; its task's work has been packed."""
        if not self.given:
            self._heard = time.monotonic()
        self.given[id(entry)] = entry
        task = entry.task
        self._ahead.append(task.lane, entry, entry.left)
        message = packed((id(entry), task.work, task.deadline, entry.place, entry.why))
        with self._sending:
            self.unsent += message

    def drop(self, entry: Entry) -> None:
        """As `Hand.drop`."""
        super().drop(entry)
        self._ahead.remove(entry.task.lane, entry)

    def take_back(self, entry: Entry) -> None:
        """Nobody wants this entry any more."""
        message = packed((id(entry),))
        with self._sending:
            self.unsent += message
        self.flush()

    def room(self, lane: Lane) -> int | None:
        """How many go before; None where it will not be free so soon that one more had better be there by then."""
        if not self.alive:
            return None
        count = self._ahead.count(lane)
        if count and (count >= MOST or self._ahead.seconds(lane) > AHEAD_S):
            return None
        return count

    def is_stuck(self, now: float) -> bool:
        """Whether it has work and has said nothing for `WEDGED_S`."""
        return self.silent_s(now) > WEDGED_S

    def silent_s(self, now: float) -> float:
        """Seconds since it said something or was given work; 0 while it has none."""
        return now - self._heard if self.given else 0.0

    def heard(self) -> None:
        """It has said something."""
        self._heard = time.monotonic()

    @property
    def alive(self) -> bool:
        """Whether it has said that it is there, and has not ended since."""
        return self.process_id is not None and not self._closed

    def seconds(self, lane: Lane, now: float) -> float:
        """As `Hand.seconds`, less what must have been done by now."""
        expected = self._ahead.seconds(lane)
        return max(0.0, expected - self.silent_s(now)) if expected else 0.0

    def flush(self) -> None:
        """Send what can be sent now; the crew sends the rest."""
        with self._sending, suppress(OSError):  # no room now; or it died, which the crew hears otherwise
            while self.unsent:
                del self.unsent[: self.connection.send(self.unsent)]
        if self.unsent:
            self._wake()

    def close(self) -> None:
        """It may end; one that still computes is ended."""
        self._closed = True
        self.connection.close()
        if self.given and self.process_id is not None:
            with suppress(ProcessLookupError):
                os.kill(self.process_id, signal.SIGKILL)
