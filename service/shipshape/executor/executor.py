"""Tasks -> bounded queues, one a lane -> one worker thread a core -> answers, in time or not at all.

The slot in the queue and the worker belong to the work, not to the waiter: a caller that leaves frees its
queue slot at once, but a worker only when the stage under way has ended. Between two stages a worker gives way to
work of a more urgent lane, and takes the cheaper rung when the time left is too short for the one it is on.
"""

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any

from shipshape.errors import NotReady, Overloaded
from shipshape.executor.admission import HEADROOM, settle_rungs
from shipshape.executor.costs import Costs
from shipshape.executor.counts import Counts, outcome_of
from shipshape.executor.deadlines import Deadlines
from shipshape.executor.entry import Entry
from shipshape.executor.lanes import UP_TO, Lane, Queues, places
from shipshape.executor.ticket import Clock, R, Rung, Stage, Task, Ticket, W

StageObserver = Callable[[str, float], None]  # stage name, seconds; called on the worker for every outcome
WaitObserver = Callable[[Lane, float], None]  # lane, seconds in the queue; called on the worker
WEDGED_S = 2.0  # that one stage may take before its worker counts as stuck; usual ones take a millisecond


class Executor:
    """Bounded queues in front of a fixed number of worker threads.

    Args:
        workers: Worker threads.
        queue_limit: Tasks that may wait, beyond those being computed; see `lanes.SHARES`.
        clock: Monotonic seconds.
        on_stage: Told the seconds of each stage that ran, also of work that came to nothing.
        on_wait: Told the seconds that a task waited, whenever a worker takes it.
    """

    def __init__(
        self,
        workers: int,
        queue_limit: int,
        *,
        clock: Clock = time.monotonic,
        on_stage: StageObserver = lambda name, seconds: None,
        on_wait: WaitObserver = lambda lane, seconds: None,
    ) -> None:
        self.clock = clock
        self.queue_limit = queue_limit
        self.workers = workers
        self._on_stage = on_stage
        self._on_wait = on_wait
        self._lock = threading.RLock()  # guards everything below
        self._work_there = threading.Condition(self._lock)
        self._idle = threading.Condition(self._lock)
        self._queues: Queues[Entry] = Queues()
        self._running: set[Entry] = set()
        self._costs = Costs()
        self._open = True
        self._counts = Counts()
        self._deadlines = Deadlines(clock)
        self._threads = [
            threading.Thread(target=self._work, name=f"worker-{index}", daemon=True) for index in range(workers)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, task: Task[W, R]) -> Ticket[R]:
        """Queue one task; raises as `submit_all` does."""
        return self.submit_all([task])[0]

    def submit_all(self, tasks: Sequence[Task[W, R]]) -> list[Ticket[R]]:
        """Queue all of the tasks, which are of one lane, or none of them.

        Raises:
            Overloaded: they do not all fit into the queue, or would end too late behind what is in it.
            DeadlineExceeded: they would end too late even alone.
            NotReady: the executor is stopping.
        """
        entries = [Entry(task, self.clock) for task in tasks]
        if not entries:
            return []
        with self._lock:
            self._counts = self._counts.plus("offered", len(entries))
            try:
                self._admit(entries)
            except Exception:
                self._counts = self._counts.plus("refused", len(entries))
                raise
            for entry in entries:
                self._queues.append(entry.task.lane, entry, entry.left)
                entry.since = self.clock()
                entry.ticket.future.add_done_callback(partial(self._settled, entry))
            self._work_there.notify(len(entries))
        for entry in entries:
            self._deadlines.watch(entry.ticket)
        return [entry.ticket for entry in entries]

    def rehearse(self, task: Task[W, R]) -> R:
        """Run a task here and now, only to learn what it costs: it is neither counted nor observed."""
        entry = Entry(task, self.clock)
        for stage in task.ladder[0].stages:
            started = self.clock()
            stage.run(task.work)
            entry.passed(stage, self.clock() - started)
        self._finish(entry)
        with self._lock:
            self._learn(entry)
        answer: R = entry.ticket.future.result()
        return answer

    def counts(self) -> Counts:
        """What became of the tasks so far."""
        with self._lock:
            return self._counts

    def promise(self, rung: Rung[Any], size: float, lane: Lane) -> float:
        """Seconds in which new work of this size and lane would be answered on this rung, as admission sees it."""
        with self._lock:
            return HEADROOM * (self._wait(lane) + sum(self._costs.each([*rung.stages, rung], size)))

    def wait(self, lane: Lane) -> float:
        """Seconds until a worker will probably be free for new work of this lane."""
        with self._lock:
            return self._wait(lane)

    @property
    def alive(self) -> bool:
        """Whether no worker has died."""
        return not self._open or all(thread.is_alive() for thread in self._threads)

    @property
    def queue_depth(self) -> int:
        """Tasks that wait for a worker."""
        return len(self._queues)

    @property
    def queue_age(self) -> float:
        """Seconds that the task has waited that has waited longest; 0 when none waits."""
        with self._lock:
            return max((self.clock() - entry.since for entry in self._queues), default=0.0)

    @property
    def running(self) -> int:
        """Tasks that occupy a worker, also those whose caller has left."""
        return len(self._running)

    @property
    def sound(self) -> bool:
        """Whether every worker lives and none is stuck in a stage."""
        with self._lock:
            now = self.clock()
            stuck = any(now - entry.since > WEDGED_S for entry in self._running)
        return not stuck and all(thread.is_alive() for thread in self._threads)

    def stop(self, drain_s: float) -> bool:
        """Refuse new tasks, finish those admitted for up to `drain_s` seconds, drop the rest.

        Returns:
            Whether everything admitted was settled in time.
        """
        with self._lock:
            self._open = False
            self._work_there.notify_all()
            drained = self._idle.wait_for(lambda: not self._queues and not self._running, drain_s)
            left = list(self._queues)
        for entry in left:
            entry.ticket.fail(NotReady("the service stopped before the answer was computed"))
        self._deadlines.stop()
        if drained:
            for thread in self._threads:
                thread.join()
        return drained

    def _admit(self, entries: Sequence[Entry]) -> None:
        """The one place that says yes or no; called with the lock held."""
        if not self._open:
            raise NotReady("expected a running service, got one that is stopping")
        lane, wanted = entries[0].task.lane, len(entries)
        room = max(0, places(lane, self.queue_limit) - len(self._queues))
        wait = self._wait(lane)
        if wanted > room:
            raise Overloaded(
                f"expected at most {room} more in the queue of {self.queue_limit}, got {wanted}",
                retry_after_s=wait * min(1.0, (wanted - room) / max(1, len(self._queues))),
            )
        slack = min(entry.task.deadline for entry in entries) - self.clock()
        settle_rungs(entries, self._costs, wait=wait, slack=slack, workers=self.workers)

    def _wait(self, lane: Lane) -> float:
        running = sum(entry.left for entry in self._running if entry.task.lane in UP_TO[lane])
        return (self._queues.seconds(lane) + running) / self.workers

    def _work(self) -> None:
        while (entry := self._next()) is not None:
            gives_way = self._carry(entry)
            with self._lock:
                self._running.discard(entry)
                self._learn(entry)
                if gives_way and not entry.ticket.settled:
                    entry.since = self.clock()
                    self._queues.put_back(entry.task.lane, entry, entry.left)
                self._idle.notify_all()
            del entry  # a waiting worker must not keep the last cluster alive

    def _next(self) -> Entry | None:
        with self._lock:
            self._work_there.wait_for(lambda: self._queues or not self._open)
            if (taken := self._queues.take()) is None:
                return None
            lane, entry = taken
            self._running.add(entry)
            waited, entry.since = self.clock() - entry.since, self.clock()
        self._on_wait(lane, waited)
        return entry

    def _carry(self, entry: Entry) -> bool:
        """Carry the task to its end, or drop it where nobody wants it any more; True when it has to give way."""
        try:
            while (stage := self._next_stage(entry)) is not None:
                if self._queues.before(entry.task.lane):
                    return True
                started = entry.since = self.clock()
                try:
                    stage.run(entry.task.work)
                finally:
                    seconds = self.clock() - started
                    entry.passed(stage, seconds)
                    self._on_stage(stage.name, seconds)
            if not _unwanted(entry.ticket):
                self._finish(entry)
        except Exception as error:
            entry.ticket.fail(error)
        except BaseException as error:  # SystemExit and the like must end neither the worker nor the waiter
            entry.ticket.fail(RuntimeError(f"a stage raised {error!r}"))
        return False

    def _next_stage(self, entry: Entry) -> Stage[Any] | None:
        """The stage to run now, on a cheaper rung if time has become short; None when there is nothing to run."""
        if _unwanted(entry.ticket):
            return None
        slack = entry.ticket.remaining()
        if entry.left > slack:
            with self._lock:
                fits = entry.step_down(slack, self._costs)
                others_wait = len(self._queues) > 0
            if not fits and others_wait:  # it would only make them late as well
                entry.ticket.expire()
                return None
        return entry.stage

    def _finish(self, entry: Entry) -> None:
        started = self.clock()
        answer = entry.task.finish(entry.task.work, entry.ended())
        entry.timed.append((entry.rung, self.clock() - started))
        entry.ticket.degraded = entry.degraded
        entry.ticket.succeed(answer)

    def _learn(self, entry: Entry) -> None:
        for timed, seconds in entry.timed:
            self._costs.learn(timed, entry.task.size, seconds)
        entry.timed.clear()

    def _settled(self, entry: Entry, future: Future[Any]) -> None:
        outcome = outcome_of(entry.ticket)
        with self._lock:
            self._counts = self._counts.plus(outcome, 1)
            if self._queues.remove(entry.task.lane, entry):  # left or expired before a worker came
                self._idle.notify_all()


def _unwanted(ticket: Ticket[Any]) -> bool:
    if not ticket.settled and ticket.remaining() <= 0:
        ticket.expire()
    return ticket.settled
