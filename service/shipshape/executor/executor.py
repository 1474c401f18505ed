"""Tasks -> bounded queue -> one worker thread a core -> answers; deadlines and leaving callers respected.

The slot in the queue and the worker belong to the work, not to the waiter: a caller that leaves frees its
queue slot at once, but a worker only when the stage under way has ended.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Any

from shipshape.errors import Cancelled, DeadlineExceeded, NotReady, Overloaded
from shipshape.executor.ticket import Clock, R, Task, Ticket, W

StageObserver = Callable[[str, float], None]  # stage name, seconds; called on the worker for every outcome


@dataclass(frozen=True, slots=True)
class Counts:
    """What became of all tasks; offered = refused + the four outcomes + those still pending."""

    offered: int = 0
    refused: int = 0
    completed: int = 0
    expired: int = 0
    cancelled: int = 0
    failed: int = 0

    @property
    def pending(self) -> int:
        """Tasks admitted and not yet settled."""
        return self.offered - self.refused - self.completed - self.expired - self.cancelled - self.failed


class Executor:
    """A bounded queue in front of a fixed number of worker threads.

    Args:
        workers: Worker threads.
        queue_limit: Tasks that may wait, beyond those being computed.
        clock: Monotonic seconds.
        on_stage: Told the seconds of each stage that ran, also of work that came to nothing.
    """

    def __init__(
        self,
        workers: int,
        queue_limit: int,
        *,
        clock: Clock = time.monotonic,
        on_stage: StageObserver = lambda name, seconds: None,
    ) -> None:
        self.clock = clock
        self.queue_limit = queue_limit
        self._on_stage = on_stage
        self._changed = threading.Condition()  # guards everything below
        self._queue: deque[tuple[Task[Any, Any], Ticket[Any]]] = deque()
        self._running = 0
        self._open = True
        self._counts = Counts()
        self._threads = [
            threading.Thread(target=self._work, name=f"worker-{index}", daemon=True) for index in range(workers)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, task: Task[W, R]) -> Ticket[R]:
        """Queue one task; raises as `submit_all` does."""
        return self.submit_all([task])[0]

    def submit_all(self, tasks: Sequence[Task[W, R]]) -> list[Ticket[R]]:
        """Queue all of the tasks or none of them.

        Raises:
            Overloaded: they do not all fit into the queue.
            NotReady: the executor is stopping.
        """
        tickets: list[Ticket[R]] = [Ticket(task.deadline, self.clock) for task in tasks]
        with self._changed:
            self._count("offered", len(tasks))
            self._admit(len(tasks))
            for task, ticket in zip(tasks, tickets, strict=True):
                self._queue.append((task, ticket))
                ticket.future.add_done_callback(self._settled)
            self._changed.notify_all()
        return tickets

    def counts(self) -> Counts:
        """What became of the tasks so far."""
        with self._changed:
            return self._counts

    @property
    def queue_depth(self) -> int:
        """Tasks that wait for a worker."""
        return len(self._queue)

    @property
    def running(self) -> int:
        """Tasks that occupy a worker, also those whose caller has left."""
        return self._running

    def stop(self, drain_s: float) -> bool:
        """Refuse new tasks, finish those admitted for up to `drain_s` seconds, drop the rest.

        Returns:
            Whether everything admitted was settled in time.
        """
        with self._changed:
            self._open = False
            self._changed.notify_all()
            drained = self._changed.wait_for(lambda: not self._queue and not self._running, drain_s)
            left = [ticket for _, ticket in self._queue]
        for ticket in left:
            ticket.fail(NotReady("the service stopped before the answer was computed"))
        if drained:
            for thread in self._threads:
                thread.join()
        return drained

    def _admit(self, wanted: int) -> None:
        """The one place that says yes or no; called with the lock held."""
        room = self.queue_limit - len(self._queue)
        if self._open and wanted <= room:
            return
        self._count("refused", wanted)
        if not self._open:
            raise NotReady("expected a running service, got one that is stopping")
        raise Overloaded(f"expected at most {room} more in the queue of {self.queue_limit}, got {wanted}")

    def _work(self) -> None:
        while (item := self._next()) is not None:
            _run(*item, on_stage=self._on_stage, clock=self.clock)
            del item  # a waiting worker must not keep the last cluster alive
            with self._changed:
                self._running -= 1
                self._changed.notify_all()

    def _next(self) -> tuple[Task[Any, Any], Ticket[Any]] | None:
        with self._changed:
            self._changed.wait_for(lambda: self._queue or not self._open)
            if not self._queue:
                return None
            self._running += 1
            return self._queue.popleft()

    def _settled(self, future: Future[Any]) -> None:
        outcome = _outcome(future)
        with self._changed:
            self._count(outcome, 1)
            for index, (_, ticket) in enumerate(self._queue):
                if ticket.future is future:  # the caller left, or time ran out, before a worker came
                    del self._queue[index]
                    self._changed.notify_all()
                    break

    def _count(self, name: str, by: int) -> None:
        self._counts = replace(self._counts, **{name: getattr(self._counts, name) + by})


def _run(task: Task[W, R], ticket: Ticket[R], *, on_stage: StageObserver, clock: Clock) -> None:
    """Carry the task to its end, or drop it at the first stage boundary where nobody wants it any more."""
    stage_ms: dict[str, float] = {}
    try:
        for stage in task.stages:
            if _unwanted(ticket):
                return
            start = clock()
            try:
                stage.run(task.work)
            finally:
                seconds = clock() - start
                stage_ms[stage.name] = seconds * 1e3
                on_stage(stage.name, seconds)
        if not _unwanted(ticket):
            ticket.succeed(task.finish(task.work, stage_ms))
    except Exception as error:
        ticket.fail(error)
    except BaseException as error:  # SystemExit and the like must end neither the worker nor the waiter
        ticket.fail(RuntimeError(f"a stage raised {error!r}"))


def _unwanted(ticket: Ticket[Any]) -> bool:
    if not ticket.settled and ticket.remaining() <= 0:
        ticket.expire()
    return ticket.settled


def _outcome(future: Future[Any]) -> str:
    if future.cancelled():
        return "cancelled"
    error = future.exception()
    if error is None:
        return "completed"
    if isinstance(error, DeadlineExceeded):
        return "expired"
    return "cancelled" if isinstance(error, Cancelled) else "failed"
