"""Tasks -> bounded queues, one a lane -> workers, one a core -> answers, in time or not at all.

Slot in the queue and worker belong to the work, not to the waiter: a caller that leaves frees its queue slot at
once, a worker when the stage under way has ended. What a worker does is in `worker`, how it is reached in `crew`.
"""

import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from operator import itemgetter
from typing import Any

from shipshape.errors import DeadlineExceeded, NotReady
from shipshape.executor.admission import behind, check_room, check_wait, settle_rungs, with_headroom
from shipshape.executor.costs import Costs
from shipshape.executor.counts import Counts
from shipshape.executor.crew import Crew, Hand, ThreadCrew
from shipshape.executor.deadlines import Deadlines
from shipshape.executor.entry import Entry
from shipshape.executor.lanes import Lane, Queues
from shipshape.executor.ticket import Clock, R, Rung, Task, Ticket, W
from shipshape.executor.worker import rehearse


class Executor:
    """Bounded queues in front of a fixed number of workers.

    Args:
        workers: How many compute at a time.
        queue_limit: Tasks that may wait, beyond those being computed; see `lanes.SHARES`.
        clock: Monotonic seconds.
        on_stage: Told the seconds of each stage that ran, also of work that came to nothing.
        on_wait: Told the seconds that a task waited, once it was taken up.
    """

    def __init__(
        self,
        workers: int,
        queue_limit: int,
        *,
        clock: Clock = time.monotonic,
        on_stage: Callable[[str, float], None] = lambda name, seconds: None,
        on_wait: Callable[[Lane, float], None] = lambda lane, seconds: None,
    ) -> None:
        self.clock = clock
        self.queue_limit = queue_limit
        self.workers = workers
        self._on_stage, self._on_wait = on_stage, on_wait
        self._lock = threading.RLock()  # guards everything below
        self._idle = threading.Condition(self._lock)
        self._queues: Queues[Entry] = Queues()
        self._costs = Costs()
        self._crews: list[Crew] = []
        self._rested = clock()  # when a worker without work last got some
        self._threads: ThreadCrew | None = None  # made for the first task that names no crew
        self._open = True
        self._counts = {spare: Counts() for spare in (False, True)}
        self._deadlines = Deadlines(clock)

    def submit(self, task: Task[W, R]) -> Ticket[R]:
        """Queue one task; raises as `submit_all` does."""
        return self.submit_all([task])[0]

    def submit_all(self, tasks: Sequence[Task[W, R]]) -> list[Ticket[R]]:
        """Queue all of the tasks, which are of one lane and all spare or not, or none of them.

        Raises:
            Overloaded: they do not all fit into the queue, or would end too late behind what is in it.
            DeadlineExceeded: they would end too late even alone.
            NotReady: the executor is stopping.
        """
        entries = [Entry(task, self.clock) for task in tasks]
        if not entries:
            return []
        with self._lock:
            counts = self._counts[tasks[0].spare]
            counts.offered += len(entries)
            try:
                self._admit(entries)
            except Exception:
                counts.refused += len(entries)
                raise
            now = self.clock()
            for entry in entries:
                self._queues.append(entry.task.lane, entry, entry.left)
                entry.since = now
            self.give_out()
        for entry in entries:
            entry.ticket.future.add_done_callback(partial(self._settled, [entry]))
            self._deadlines.watch(entry.ticket)
        return [entry.ticket for entry in entries]

    def check(self, lane: Lane, deadline: float) -> None:
        """Say no at once, before anything of a task is known, where even the cheapest one would be refused.

        Args:
            lane: Of the task; the most urgent one where it is not known.
            deadline: On the executor's clock, seconds.

        Raises:
            DeadlineExceeded: It is already late.
            Overloaded: No place in the queue, or no time behind all that waits.
        """
        slack = deadline - self.clock()
        if slack <= 0:
            raise DeadlineExceeded("expected an answer before the deadline, got a request that is already late")
        with self._lock:
            if self.load > 1.0:
                check_wait(self._check_room(1, lane), slack)

    def rehearse(self, task: Task[W, R]) -> R:
        """Run a task here and now, only to learn what it costs: it is neither counted nor observed."""
        with self._lock:
            return rehearse(task, self._costs, self.clock)

    def learn(self, timed: Iterable[tuple[object, float]], size: float) -> None:
        """What was timed took so many seconds for work of this size."""
        with self._lock:
            for what, seconds in timed:
                self._costs.learn(what, size, seconds)

    def join(self, crew: Crew) -> None:
        """Count this crew's workers as those of the service, sound only while they are whole, until `leave`."""
        with self._lock:
            self._crews.append(crew)

    def leave(self, crew: Crew) -> None:
        """The crew has no workers any more, or none for callers: tasks that name it still reach them."""
        with self._lock:
            if crew in self._crews:
                self._crews.remove(crew)

    def counts(self, *, spare: bool = False) -> Counts:
        """What became of the callers' tasks so far, or of the spare ones."""
        with self._lock:
            return replace(self._counts[spare])

    def promise(self, rung: Rung[Any], size: float, lane: Lane) -> float:
        """Seconds in which new work of this size and lane would be answered on this rung, as admission sees it."""
        with self._lock:
            return with_headroom(self.wait(lane), sum(self._costs.each([*rung.stages, rung], size)))

    def wait(self, lane: Lane) -> float:
        """Seconds that new work of this lane will probably wait."""
        with self._lock:
            given = sum(hand.seconds(lane, self.clock()) for hand in self._hands())
            return behind((self._queues.seconds(lane) + given) / self.workers, self.clock() - self._rested)

    @property
    def alive(self) -> bool:
        """Whether no worker is gone for good."""
        return not self._open or all(crew.worth_keeping for crew in self._crews)

    @property
    def queue_depth(self) -> int:
        """Tasks that wait for a worker."""
        with self._lock:
            return len(self._queues) + sum(hand.waiting for hand in self._hands())

    @property
    def load(self) -> float:
        """Tasks that wait or are computed, a worker: over 1, there is a queue."""
        given = sum(len(hand.given) for crew in self._crews for hand in crew.hands)
        return (len(self._queues) + given) / self.workers

    @property
    def queue_age(self) -> float:
        """Seconds that the task has waited that has waited longest; 0 when none waits."""
        with self._lock:
            return max((self.clock() - entry.since for entry in self._queues), default=0.0)

    @property
    def running(self) -> int:
        """Workers that are occupied, also by tasks whose caller has left."""
        with self._lock:
            return sum(bool(hand.given) for hand in self._hands())

    @property
    def sound(self) -> bool:
        """Whether every worker lives and none is stuck in a stage."""
        with self._lock:
            stuck = any(hand.is_stuck(self.clock()) for hand in self._hands())
            return self._open and not stuck and all(crew.whole for crew in self._crews)

    def stop(self, drain_s: float) -> bool:
        """Refuse new tasks, finish those admitted for up to `drain_s` seconds, drop the rest.

        Returns:
            Whether everything admitted was settled in time.
        """
        with self._lock:
            self._open = False
            drained = self._idle.wait_for(lambda: not self._queues and not self.running, drain_s)
            left, crews = list(self._queues), list(self._crews)
        for entry in left:
            entry.ticket.fail(NotReady("the service stopped before the answer was computed"))
        self._deadlines.stop()
        for crew in crews:
            crew.close()
        return drained

    def gave_up(self, hand: Hand) -> None:
        """This worker is gone: whatever it had is answered so, and others go on."""
        with self._lock:
            lost = list(hand.given.values())
            hand.given.clear()
            for entry in lost:
                entry.over = True
            self.give_out()
            self._idle.notify_all()
        for entry in lost:
            entry.ticket.fail(NotReady("expected an answer, got a worker that ended before it: ask again"))

    def ended(self, hand: Hand, entries: Sequence[Entry]) -> None:
        """A worker has done with some entries, whose tickets are settled."""
        for entry in entries:
            if entry.began is not None and not entry.task.spare:
                self._on_wait(entry.task.lane, entry.began - entry.since)
        with self._lock:
            for entry in entries:
                entry.over = True
                hand.drop(entry)
                for timed, seconds in entry.timed:
                    self._costs.learn(timed, entry.task.size, seconds)
            self.give_out()
            if not hand.given:
                self._idle.notify_all()

    def stages_ran(self, stage_ms: Mapping[str, float]) -> None:
        """Stages ran in a worker that cannot tell so itself."""
        for name, milliseconds in stage_ms.items():
            self._on_stage(name, milliseconds / 1e3)

    def give_out(self) -> None:
        """Give tasks to workers that have room, the most urgent first."""
        given: set[Hand] = set()
        with self._lock:
            while (first := self._queues.first()) is not None:
                lane, entry = first
                crew = entry.task.crew or self._thread_crew()
                rooms = [
                    (room, len(hand.given), hand) for hand in crew.hands if (room := hand.room(lane)) is not None
                ]
                if not rooms:
                    break
                *_, hand = min(rooms, key=itemgetter(0, 1))
                self._queues.remove(lane, entry)
                entry.hand = hand
                if not hand.given:
                    self._rested = self.clock()
                hand.give(entry)
                given.add(hand)
            for hand in given:
                hand.flush()

    def _admit(self, entries: Sequence[Entry]) -> None:
        """The one place that says yes or no; called with the lock held."""
        if not self._open:
            raise NotReady("expected a running service, got one that is stopping")
        if entries[0].task.spare:
            return  # it takes nobody's place, and no time in what others are promised
        wait = self._check_room(len(entries), entries[0].task.lane)
        slack = min(entry.task.deadline for entry in entries) - self.clock()
        settle_rungs(entries, self._costs, wait=wait, slack=slack, workers=self.workers)

    def _check_room(self, wanted: int, lane: Lane) -> float:
        """Refuse what has no place; else the seconds that it will wait."""
        wait = self.wait(lane)
        depth = max(0, self.queue_depth - self._counts[True].pending)
        check_room(wanted, lane, limit=self.queue_limit, depth=depth, wait=wait)
        return wait

    def _hands(self) -> Iterable[Hand]:
        for crew in self._crews:
            yield from crew.hands

    def _thread_crew(self) -> ThreadCrew:
        if self._threads is None:
            self._threads = ThreadCrew(
                self.workers,
                self._costs,
                self.clock,
                on_stage=self._on_stage,
                on_end=self.ended,
                others_wait=lambda: len(self._queues) > 0,
            )
            self._crews.append(self._threads)
        return self._threads

    def _settled(self, held: list[Entry], future: Future[Any]) -> None:
        entry = held.pop()  # taken out, else ticket and entry, and so the model, would know each other for ever
        with self._lock:
            self._counts[entry.task.spare].settle(entry.ticket)
            if self._queues.remove(entry.task.lane, entry):  # left or expired before a worker came
                self._idle.notify_all()
            elif not entry.over and isinstance(entry.hand, Hand):
                entry.hand.take_back(entry)
