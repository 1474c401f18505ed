"""Workers in processes of their own, each with its own interpreter, forked from one that holds what they need.

A worker that dies, or is stuck for so long that it is ended, is replaced; what it had is answered so. One thread
of the service reads what all workers of a crew say.
"""

import logging
import os
import selectors
import signal
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Protocol

from shipshape.errors import Cancelled, NotReady
from shipshape.executor.crew import Crew, Hand
from shipshape.executor.entry import Entry
from shipshape.executor.fork_client import ForkServer
from shipshape.executor.messages import packed
from shipshape.executor.process_hand import ProcessHand
from shipshape.executor.process_worker import Report

ENDED_S = 10.0  # without a word from a worker that has work, after which it is ended
YOUNG_S = 1.0  # a worker that lived no longer is not replaced at once: the next one may end like it
START_S = 10.0  # to wait for the first workers
LOOK_S = 0.5  # between two looks for workers that are stuck

_logger = logging.getLogger(__name__)


class Owner(Protocol):
    """Who gives out entries and is told what became of them: the executor."""

    def ended(self, hand: Hand, entries: Sequence[Entry]) -> None:
        """Entries have ended."""
        ...

    def gave_up(self, hand: Hand) -> None:
        """A worker is gone, with all it had."""
        ...

    def give_out(self) -> None:
        """A worker has come."""
        ...

    def stages_ran(self, stage_ms: Mapping[str, float]) -> None:
        """Stages ran, each for so many milliseconds."""
        ...


class ProcessCrew(Crew):
    """As many worker processes as there are workers, for one preparation, which begins at once.

    Args:
        prepare: "module:function", which only the processes import; it makes a `process_worker.Prepared`.
        arguments: Of it.
    """

    def __init__(self, prepare: str, *arguments: Any) -> None:
        self.hands: Sequence[ProcessHand] = ()
        self._what = packed((prepare, arguments))
        self._server = ForkServer(self._what)
        self._workers = 0
        self._owner: Owner
        self._missing_until = 0.0  # when the next worker may be forked in the place of one that is gone
        self._closing = False
        self._barren = False  # nothing forks any more
        self._whole = threading.Event()  # all workers have been there
        self._fresh: ForkServer | None = None  # in the place of one that died
        self._selector = selectors.DefaultSelector()
        self._woken, self._waker = socket.socketpair()
        self._waker.setblocking(False)
        self._thread = threading.Thread(target=self._serve, name="crew", daemon=True)

    def loaded(self) -> None:
        """Wait until the preparation has read what it needs; raises as `prepared` does."""
        self._server.message(lambda: False)

    def prepared(self, stopping: Callable[[], bool]) -> Any:
        """Wait for the rest of the preparation, after `loaded`; its description.

        Raises:
            Cancelled: `stopping` said so.
            NotReady: The process that prepares ended without a word.
            Exception: Whatever the preparation raises.
        """
        return self._server.message(stopping)

    def start(self, owner: Owner, workers: int) -> None:
        """Have the workers forked, once all is prepared, and wait for them.

        Raises:
            NotReady: They did not come.
        """
        self._owner, self._workers = owner, workers
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._selector.register(self._server.control, selectors.EVENT_READ)
        self._fill()
        self._thread.start()
        if not self._whole.wait(START_S):
            raise NotReady(f"expected {workers} worker processes within {START_S:g} s, got fewer")

    @property
    def whole(self) -> bool:
        """Whether all workers are there."""
        return len(self.hands) == self._workers and all(hand.alive for hand in self.hands)

    @property
    def worth_keeping(self) -> bool:
        """Whether workers that end are replaced, and heard."""
        return self._thread.is_alive() and not self._barren

    def close(self) -> None:
        """End the workers; whoever still waits for one of them is told so."""
        self._closing = True
        self._wake()
        if self._thread.ident is None:
            self._release()
        elif threading.current_thread() is not self._thread:
            self._thread.join()
        self._server.end()

    def _serve(self) -> None:
        while not self._closing:
            for key, events in self._selector.select(LOOK_S):
                if isinstance(hand := key.data, ProcessHand):
                    if events & selectors.EVENT_WRITE:
                        hand.flush()
                    if events & selectors.EVENT_READ:
                        self._hear(hand)
                elif key.fileobj is self._woken:
                    self._woken.recv(4096)
                else:
                    self._replace_server()
            self._look_after()
        for hand in self.hands:
            self._let_go(hand)
        self._release()

    def _release(self) -> None:
        self._selector.close()
        self._woken.close()
        self._waker.close()

    def _look_after(self) -> None:
        now = time.monotonic()
        for hand in self.hands:
            wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if hand.unsent else 0)
            if self._selector.get_key(hand.connection).events != wanted:
                self._selector.modify(hand.connection, wanted, hand)
            if hand.silent_s(now) > ENDED_S and hand.process_id is not None:
                _logger.error("worker %d said nothing for %s s and is ended", hand.process_id, ENDED_S)
                os.kill(hand.process_id, signal.SIGKILL)
        if self._fresh is not None:
            self._server, self._fresh = self._fresh, None
            self._selector.register(self._server.control, selectors.EVENT_READ)
        if len(self.hands) < self._workers and now >= self._missing_until:
            self._fill()

    def _hear(self, hand: ProcessHand) -> None:
        if (messages := hand.inbox.receive(hand.connection)) is None:
            self._lost(hand)
            return
        hand.heard()
        if messages and hand.process_id is None:
            hand.process_id = messages.pop(0)
            self._owner.give_out()
            if self.whole:
                self._whole.set()
        if messages:
            self._owner.ended(hand, [self._end(hand, Report(*message)) for message in messages])

    def _end(self, hand: ProcessHand, report: Report) -> Entry:
        entry = hand.given[report.number]
        entry.began, entry.over = report.began, True
        self._owner.stages_ran(report.stage_ms)
        if isinstance(report.result, Exception):
            entry.ticket.fail(report.result)
        else:
            if report.place == entry.place:  # else it changed half-way: the time is that of no rung
                entry.timed.append((entry.rung, report.seconds))
            entry.ticket.degraded = report.place > 0
            entry.ticket.succeed(report.result)
        return entry

    def _lost(self, hand: ProcessHand) -> None:
        lost = len(hand.given)
        _logger.error("worker %s ended with %d contacts; another takes its place", hand.process_id, lost)
        self.hands = [other for other in self.hands if other is not hand]
        lived = time.monotonic() - hand.born
        self._missing_until = time.monotonic() + (0.0 if lived > YOUNG_S else YOUNG_S)
        self._let_go(hand)

    def _let_go(self, hand: ProcessHand) -> None:
        self._selector.unregister(hand.connection)
        hand.close()
        self._owner.gave_up(hand)

    def _fill(self) -> None:
        while len(self.hands) < self._workers:
            try:
                connection = self._server.fork()
            except OSError:
                return  # its end is noticed on its control socket
            hand = ProcessHand(connection, self._wake)
            self._selector.register(connection, selectors.EVENT_READ, hand)
            self.hands = [*self.hands, hand]

    def _replace_server(self) -> None:
        _logger.error("the process that forks workers ended; another takes its place")
        self._selector.unregister(self._server.control)
        self._server.end()
        threading.Thread(target=self._start_server, name="crew-server", daemon=True).start()

    def _start_server(self) -> None:
        fresh = ForkServer(self._what)
        try:
            for _ in ("loaded", "prepared"):
                fresh.message(lambda: self._closing)
        except Cancelled:
            fresh.end()
        except Exception:
            _logger.exception("workers that end will not be replaced")
            fresh.end()
            self._barren = True
        else:
            self._fresh = fresh
            self._wake()
            if self._closing:  # nobody may have taken it over
                fresh.end()

    def _wake(self) -> None:
        with suppress(OSError):  # it is awake already, or closed
            self._waker.send(b"w")
