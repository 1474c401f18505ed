"""Expires tickets at their deadline, by a thread of its own: however stuck the workers are."""

import heapq
import itertools
import math
import threading
import weakref
from typing import Any

from shipshape.executor.ticket import Clock, Ticket

STEP_S = 0.002  # tickets that are due within it share one awakening
FEW = 1024  # entries that are not worth looking through for settled ones


class Deadlines:
    """Watches tickets until `stop`; one that was settled and let go of by everybody is forgotten."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._changed = threading.Condition()
        self._due: list[tuple[float, int, weakref.ref[Ticket[Any]]]] = []
        self._order = itertools.count()  # tickets themselves do not compare
        self._next = math.inf  # when the thread will wake up by itself
        self._full = FEW  # entries at which the settled ones are thrown out: deadlines may be an hour away
        self._open = True
        self._thread = threading.Thread(target=self._run, name="deadlines", daemon=True)
        self._thread.start()

    def watch(self, ticket: Ticket[Any]) -> None:
        """Expire this ticket when its time has come."""
        if ticket.deadline == math.inf:
            return
        with self._changed:
            if len(self._due) >= self._full:
                self._throw_out()
            heapq.heappush(self._due, (ticket.deadline, next(self._order), weakref.ref(ticket)))
            if ticket.deadline < self._next - STEP_S:
                self._changed.notify()

    def stop(self) -> None:
        """Watch no more."""
        with self._changed:
            self._open = False
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while (late := self._late()) is not None:
            for ticket in late:
                ticket.expire()  # not under the lock: it tells the executor, which may be telling us
            del late  # else the last one would be kept alive

    def _late(self) -> list[Ticket[Any]] | None:
        """Wait until some are due; those that are not settled yet, or None at the end."""
        with self._changed:
            while self._open:
                late = self._pop()
                if late:
                    return late
                self._next = self._due[0][0] if self._due else math.inf
                patience = max(self._next - self._clock(), STEP_S)
                self._changed.wait(min(patience, threading.TIMEOUT_MAX))
            return None

    def _pop(self) -> list[Ticket[Any]]:
        late = []
        now = self._clock()
        while self._due:
            due, _, reference = self._due[0]
            ticket = reference()
            if ticket is not None and not ticket.settled:
                if due > now:
                    break
                late.append(ticket)
            heapq.heappop(self._due)
        return late

    def _throw_out(self) -> None:
        self._due = [entry for entry in self._due if (ticket := entry[2]()) is not None and not ticket.settled]
        heapq.heapify(self._due)
        self._full = max(FEW, 2 * len(self._due))
