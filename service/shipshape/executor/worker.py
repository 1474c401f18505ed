"""One worker: takes entries from its mailbox and carries each through the stages of its rung.

It runs in a thread of the service or in a process of its own; which of the two, only its mailbox knows. Between
two stages it looks into the mailbox, gives way to more urgent work, drops what nobody wants any more, and takes
the cheaper rung when the time left is too short for the one it is on. Entries at hand take turns, a stage each
(ADR 0025): the second finds the code and the weights of the stage in the caches of the processor.
"""

import math
from collections.abc import Callable, Sequence
from typing import Protocol

from shipshape.executor.admission import QUEUE_HEADROOM
from shipshape.executor.costs import Costs
from shipshape.executor.entry import Entry
from shipshape.executor.lanes import Queues
from shipshape.executor.ticket import Clock, R, Task, W

HOLD_S = 0.005  # that the end of an entry is kept back to be told with that of others: each time wakes somebody


class Mailbox(Protocol):
    """Where a worker's entries come from, and where it says what became of them.

    Attributes:
        LOOK_S: Between two looks into it while there is work; stages may be shorter than a look takes.
    """

    LOOK_S: float

    def read(self, *, wait: bool) -> Sequence[Entry] | None:
        """The entries that came since the last time; None when no more can come.

        Args:
            wait: Until something is there, if only the news that an entry is no longer wanted.
        """
        ...

    def others_wait(self) -> bool:
        """Whether there is work for this worker that it has not been given yet."""
        ...

    def ended(self, entries: Sequence[Entry]) -> None:
        """Their tickets are settled, and nothing of them runs any more."""
        ...


class Worker:
    """Works until its mailbox is closed and empty.

    Args:
        mailbox: See there.
        costs: Of stages; learned by whoever owns the mailbox.
        clock: Monotonic seconds.
        on_stage: Told the name of each stage that ran and its seconds, also of work that came to nothing.
    """

    def __init__(
        self,
        mailbox: Mailbox,
        costs: Costs,
        clock: Clock,
        on_stage: Callable[[str, float], None] | None = None,
    ) -> None:
        self._mailbox = mailbox
        self._costs = costs
        self._clock = clock
        self._on_stage = on_stage
        self._queues: Queues[Entry] = Queues()
        self._group: list[Entry] = []  # of one lane, taking turns
        self._open = True
        self._looked = 0.0  # when it last looked into the mailbox
        self._spent_until = 0.0  # its time is counted as some entry's, or as nobody's

    def work(self) -> None:
        """Carry whatever comes."""
        while self._open or self._queues:
            if not self._queues:
                self._take_in(wait=True)
            self._carry()

    def _take_in(self, *, wait: bool) -> None:
        came = self._mailbox.read(wait=wait)
        self._looked = self._clock()
        if wait:
            self._spent_until = self._looked
        if came is None:
            self._open = False
            return
        for entry in came:
            self._queues.append(entry.task.lane, entry, entry.left)

    def _carry(self) -> None:
        """Carry a group, a stage of each in turn, until all have ended or have to give way."""
        self._take_group()
        over: list[Entry] = []
        tell_at = 0.0
        while self._group:
            entry = min(self._group, key=_stages_done)
            if self._queues and self._queues.before(entry.task.lane):
                self._put_back()
                break
            self._step(entry)
            if entry.ticket.settled:
                self._group.remove(entry)
                tell_at = tell_at if over else self._spent_until + HOLD_S
                over.append(entry)
            if over and self._spent_until >= tell_at:
                self._mailbox.ended(over)
                over = []
            if self._open and self._spent_until - self._looked >= self._mailbox.LOOK_S:
                self._take_in(wait=False)
        if over:
            self._mailbox.ended(over)

    def _take_group(self) -> None:
        """The first entry, and those behind it in its lane that can take turns with it without being late."""
        together, due, now = 0.0, math.inf, self._clock()
        while (first := self._queues.first()) is not None:
            lane, entry = first
            together += entry.left
            due = min(due, entry.ticket.deadline)
            late = now + QUEUE_HEADROOM * together > due
            if self._group and (late or lane is not self._group[0].task.lane):
                break
            self._queues.remove(lane, entry)
            self._group.append(entry)

    def _put_back(self) -> None:
        while self._group:
            entry = self._group.pop()
            self._queues.put_back(entry.task.lane, entry, entry.left)

    def _step(self, entry: Entry) -> None:
        """The next stage of an entry, or its answer after the last, unless nobody wants it any more."""
        since = self._spent_until
        if entry.began is None:
            entry.began = since
        try:
            self._advance(entry)
        except Exception as error:
            entry.ticket.fail(error)
        except BaseException as error:  # SystemExit and the like must end neither the worker nor the waiter
            entry.ticket.fail(RuntimeError(f"a stage raised {error!r}"))
        self._spent_until = self._clock()
        entry.busy += self._spent_until - since

    def _advance(self, entry: Entry) -> None:
        started = self._clock()
        slack = entry.ticket.deadline - started
        if slack <= 0 or entry.left > slack:
            self._hurry(entry, slack)
        if entry.ticket.settled:
            return
        if (stage := entry.stage) is None:
            finish(entry, self._clock)
            return
        try:
            stage.run(entry.task.work)
        finally:
            seconds = self._clock() - started
            entry.passed(stage, seconds)
            if self._on_stage is not None:
                self._on_stage(stage.name, seconds)

    def _hurry(self, entry: Entry, slack: float) -> None:
        """Go on on a cheaper rung, or not at all where that would only make others late as well."""
        if slack <= 0 or (not entry.step_down(slack, self._costs) and self._others_wait()):
            entry.ticket.expire()

    def _others_wait(self) -> bool:
        return len(self._group) > 1 or bool(self._queues) or self._mailbox.others_wait()


def _stages_done(entry: Entry) -> int:
    return len(entry.stage_ms)


def rehearse(task: Task[W, R], costs: Costs, clock: Clock) -> R:
    """Run a task here and now, on its first rung, only to learn what it costs; raises whatever a stage raises."""
    entry = Entry(task, clock)
    for stage in task.ladder[0].stages:
        started = clock()
        stage.run(task.work)
        entry.passed(stage, clock() - started)
    finish(entry, clock)
    for timed, seconds in entry.timed:
        costs.learn(timed, task.size, seconds)
    answer: R = entry.ticket.future.result()
    return answer


def finish(entry: Entry, clock: Clock) -> None:
    """Settle the ticket with the answer, once every stage has run."""
    started = clock()
    answer = entry.task.finish(entry.task.work, entry.ended())
    entry.timed.append((entry.rung, clock() - started))
    entry.ticket.degraded = entry.degraded
    entry.ticket.succeed(answer)
