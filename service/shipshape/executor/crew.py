"""Workers as the executor sees them: what each has been given, and how to give it more or take it back."""

import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

from shipshape.executor.costs import Costs
from shipshape.executor.entry import Entry
from shipshape.executor.lanes import UP_TO, Lane
from shipshape.executor.ticket import Clock
from shipshape.executor.worker import Worker

WEDGED_S = 2.0  # that one stage may take before its worker counts as stuck; usual ones take a millisecond


class Hand(ABC):
    """One worker. The executor calls everything in here with its lock held.

    Attributes:
        given: The entries that it has and that have not ended, in the order in which they were given.
    """

    def __init__(self) -> None:
        self.given: dict[int, Entry] = {}

    @abstractmethod
    def give(self, entry: Entry) -> None:
        """One more entry, which may stay here until `flush`."""

    @abstractmethod
    def flush(self) -> None:
        """Let the worker have what it was given."""

    def drop(self, entry: Entry) -> None:
        """The entry has ended."""
        self.given.pop(id(entry), None)

    @abstractmethod
    def take_back(self, entry: Entry) -> None:
        """Nobody wants this entry any more; it ends at the next stage boundary."""

    @abstractmethod
    def room(self, lane: Lane) -> int | None:
        """How many entries go before a new one of this lane; None when that would take too long."""

    @abstractmethod
    def is_stuck(self, now: float) -> bool:
        """Whether a stage takes longer than `WEDGED_S`."""

    @property
    @abstractmethod
    def alive(self) -> bool:
        """Whether it works at all."""

    @property
    def waiting(self) -> int:
        """How many of its entries wait for the one that is computed."""
        if len(self.given) <= 1:
            return 0
        return max(0, sum(not entry.ticket.settled for entry in self.given.values()) - 1)

    def seconds(self, lane: Lane, now: float) -> float:
        """That its work will probably take which goes before new work of this lane."""
        return sum(entry.left for entry in self.given.values() if entry.task.lane in UP_TO[lane])


class Crew(ABC):
    """Workers of one kind: each can carry whatever another can."""

    hands: Sequence[Hand]

    @property
    @abstractmethod
    def whole(self) -> bool:
        """Whether all workers are there."""

    @property
    @abstractmethod
    def worth_keeping(self) -> bool:
        """Whether no worker is gone for good."""

    @abstractmethod
    def close(self) -> None:
        """Let the workers end; what they still have is given up where nothing else ends it."""


class ThreadHand(Hand):
    """A worker in a thread of this process; also its mailbox."""

    LOOK_S = 0.0

    def __init__(self, crew: "ThreadCrew", name: str, clock: Clock) -> None:
        super().__init__()
        self._crew = crew
        self._mail: queue.SimpleQueue[Entry | None] = queue.SimpleQueue()
        self._heard = 0.0  # when it last looked into its mail, or was given work while it had none
        worker = Worker(self, crew.costs, clock, crew.on_stage)
        self.thread = threading.Thread(target=worker.work, name=name, daemon=True)
        self.thread.start()

    def give(self, entry: Entry) -> None:
        """One more entry."""
        if not self.given:
            self._heard = self._crew.clock()
        self.given[id(entry)] = entry
        self._mail.put(entry)

    def flush(self) -> None:
        """It has it already."""

    def take_back(self, entry: Entry) -> None:
        """Its ticket, which the worker looks at, says so already."""

    def room(self, lane: Lane) -> int | None:
        """0 when its worker would begin at the next stage boundary."""
        return None if any(entry.task.lane in UP_TO[lane] for entry in self.given.values()) else 0

    def is_stuck(self, now: float) -> bool:
        """Whether a stage takes longer than `WEDGED_S`."""
        return bool(self.given) and now - self._heard > WEDGED_S

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self.thread.is_alive()

    def read(self, *, wait: bool) -> Sequence[Entry] | None:
        """As `Mailbox.read`."""
        came: list[Entry] = []
        while wait or not self._mail.empty():
            if (entry := self._mail.get()) is None:
                if not came:
                    return None
                self._mail.put(None)  # for the next time
                break
            came.append(entry)
            wait = False
        self._heard = self._crew.clock()
        return came

    def others_wait(self) -> bool:
        """As `Mailbox.others_wait`."""
        return self._crew.others_wait()

    def ended(self, entries: Sequence[Entry]) -> None:
        """As `Mailbox.ended`."""
        self._crew.on_end(self, entries)

    def close(self) -> None:
        """Nothing more will be given."""
        self._mail.put(None)


class ThreadCrew(Crew):
    """Workers in threads of this process: for what cannot travel, and for accelerators, which want one process.

    Args:
        workers: Threads.
        costs: Of stages.
        clock: Monotonic seconds.
        on_stage: Told of each stage that ran, on the worker.
        on_end: Told of each entry that ended, on the worker.
        others_wait: Whether anything waits for a worker.
    """

    def __init__(
        self,
        workers: int,
        costs: Costs,
        clock: Clock,
        *,
        on_stage: Callable[[str, float], None],
        on_end: Callable[[Hand, Sequence[Entry]], Any],
        others_wait: Callable[[], bool],
    ) -> None:
        self.costs = costs
        self.clock = clock
        self.on_stage = on_stage
        self.on_end = on_end
        self.others_wait = others_wait
        self._hands = [ThreadHand(self, f"worker-{index}", clock) for index in range(workers)]
        self.hands = self._hands

    @property
    def whole(self) -> bool:
        """Whether all threads run."""
        return all(hand.alive for hand in self.hands)

    @property
    def worth_keeping(self) -> bool:
        """Whether all threads run: none is replaced."""
        return self.whole

    def close(self) -> None:
        """Let the threads end; one that is stuck in a stage is left behind."""
        for hand in self._hands:
            hand.close()
