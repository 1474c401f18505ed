"""One worker: takes entries from its mailbox and carries each through the stages of its rung, one at a time.

It runs in a thread of the service or in a process of its own; which of the two, only its mailbox knows. Between
two stages it looks into the mailbox, gives way to more urgent work, drops what nobody wants any more, and takes
the cheaper rung when the time left is too short for the one it is on.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from shipshape.executor.costs import Costs
from shipshape.executor.entry import Entry
from shipshape.executor.lanes import Queues
from shipshape.executor.ticket import Clock, R, Task, W


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

    def ended(self, entry: Entry) -> None:
        """Its ticket is settled, and nothing of it runs any more."""
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
        self._open = True
        self._looked = 0.0  # when it last looked into the mailbox

    def work(self) -> None:
        """Carry whatever comes."""
        while self._open or self._queues:
            if not self._queues:
                self._take_in(wait=True)
            if (taken := self._queues.take()) is not None:
                lane, entry = taken
                if self._carry(entry):
                    self._queues.put_back(lane, entry, entry.left)
                else:
                    self._mailbox.ended(entry)
                del taken, entry  # a waiting worker must not keep the last cluster alive

    def _take_in(self, *, wait: bool) -> None:
        came = self._mailbox.read(wait=wait)
        self._looked = self._clock()
        if came is None:
            self._open = False
            return
        for entry in came:
            self._queues.append(entry.task.lane, entry, entry.left)

    def _carry(self, entry: Entry) -> bool:
        """Carry the task to its end, or drop it where nobody wants it any more; True when it has to give way."""
        if entry.began is None:
            entry.began = self._clock()
        try:
            if self._run_stages(entry):
                return True
            if not entry.ticket.settled:
                finish(entry, self._clock)
        except Exception as error:
            entry.ticket.fail(error)
        except BaseException as error:  # SystemExit and the like must end neither the worker nor the waiter
            entry.ticket.fail(RuntimeError(f"a stage raised {error!r}"))
        return False

    def _run_stages(self, entry: Entry) -> bool:
        """Until none is left, or the ticket is settled; True when the entry has to give way."""
        clock, ticket, work = self._clock, entry.ticket, entry.task.work
        now = clock()
        while True:
            slack = ticket.deadline - now
            if slack <= 0 or entry.left > slack:
                self._hurry(entry, slack)
            if ticket.settled or (stage := entry.stage) is None:
                return False
            if self._queues and self._queues.before(entry.task.lane):
                return True
            try:
                stage.run(work)
            finally:
                started, now = now, clock()
                entry.passed(stage, now - started)
                if self._on_stage is not None:
                    self._on_stage(stage.name, now - started)
            if now - self._looked >= self._mailbox.LOOK_S and self._open:
                self._take_in(wait=False)
                now = clock()

    def _hurry(self, entry: Entry, slack: float) -> None:
        """Go on on a cheaper rung, or not at all where that would only make others late as well."""
        if slack <= 0 or (not entry.step_down(slack, self._costs) and self._others_wait()):
            entry.ticket.expire()

    def _others_wait(self) -> bool:
        return bool(self._queues) or self._mailbox.others_wait()


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
