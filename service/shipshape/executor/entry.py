"""A task inside the executor: the rung it is on, the stages behind it, and what is expected of those ahead."""

from typing import Any

from shipshape.executor.costs import Costs
from shipshape.executor.ticket import Clock, Ended, Rung, Stage, Task, Ticket


class Entry:
    """One admitted task. Its worker alone changes it while it runs, the holder of the lock while it waits.

    Attributes:
        left: Seconds that the stages ahead will probably take.
        since: When it began to wait.
        began: When a worker first took it up; None before.
        busy: Seconds that a worker gave to it so far.
        over: Its worker has nothing more to do with it.
        hand: The worker that it was given to; None while it waits in the queue.
        timed: What was timed since the costs were last learned from it, with seconds.
    """

    __slots__ = (
        "_ahead",
        "_place",
        "_stages",
        "_why",
        "began",
        "busy",
        "hand",
        "left",
        "over",
        "since",
        "stage_ms",
        "task",
        "ticket",
        "timed",
    )

    def __init__(self, task: Task[Any, Any], clock: Clock) -> None:
        self.task = task
        self.ticket: Ticket[Any] = Ticket(task.deadline, clock)
        self.left = self.since = self.busy = 0.0
        self.began: float | None = None
        self.over = False
        self.hand: object = None
        self.timed: list[tuple[object, float]] = []
        self.stage_ms: dict[str, float] = {}
        self._ahead: list[float] = []  # seconds expected of each stage ahead and of `finish`
        self._place = 0
        self._stages = task.ladder[0].stages
        self._why = ""

    @property
    def place(self) -> int:
        """Of its rung on the ladder."""
        return self._place

    @property
    def why(self) -> str:
        """It is not on the first rung: a sentence; empty when it is."""
        return self._why

    @property
    def rung(self) -> Rung[Any]:
        """The one it is on."""
        return self.task.ladder[self._place]

    @property
    def stage(self) -> Stage[Any] | None:
        """The next one; None when all have run."""
        done = len(self.stage_ms)
        return self._stages[done] if done < len(self._stages) else None

    def move_to(self, place: int, costs: Costs, why: str = "") -> None:
        """Go on with the rung at this place of the ladder, the last one if it has fewer."""
        self._place = min(place, len(self.task.ladder) - 1)
        self._stages = self.rung.stages
        self._why = why if self._place else ""
        self._ahead = self._costs_of(self.rung, costs)
        self.left = sum(self._ahead)

    def expected(self, rung: int, costs: Costs) -> float:
        """Seconds that all that is ahead on this rung will probably take."""
        return sum(self._costs_of(self.task.ladder[min(rung, len(self.task.ladder) - 1)], costs))

    def step_down(self, slack: float, costs: Costs) -> bool:
        """Change to the dearest rung below that fits into `slack` seconds; whether there was one.

        Only a rung that begins with the stages that ran already can be changed to.
        """
        ran = self.rung.stages[: len(self.stage_ms)]
        for place in range(self._place + 1, len(self.task.ladder)):
            goes_on = self.task.ladder[place].stages[: len(ran)] == ran
            if goes_on and self.expected(place, costs) <= slack:
                self.move_to(place, costs, why_cheaper(self.left, slack))
                return True
        return False

    def passed(self, stage: Stage[Any], seconds: float) -> None:
        """The next stage has run."""
        self.stage_ms[stage.name] = seconds * 1e3
        self.timed.append((stage, seconds))
        self.left -= self._ahead.pop(0) if self._ahead else 0.0

    def ended(self) -> Ended:
        """How it was computed, once every stage has run."""
        return Ended(self.rung.name, self._why, self.stage_ms)

    @property
    def degraded(self) -> bool:
        """Whether it is on another rung than the first."""
        return self._place > 0

    def _costs_of(self, rung: Rung[Any], costs: Costs) -> list[float]:
        return costs.each([*rung.stages[len(self.stage_ms) :], rung], self.task.size)


def why_cheaper(needed: float, slack: float) -> str:
    """Why an answer is not on the first rung; both in seconds."""
    return f"the full answer was expected to take {needed * 1e3:.1f} ms, with {slack * 1e3:.1f} ms left"
