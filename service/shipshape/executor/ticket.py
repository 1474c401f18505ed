"""A task as the caller hands it in, and the ticket the caller holds while it is computed."""

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar, runtime_checkable

from shipshape.errors import Cancelled, DeadlineExceeded
from shipshape.executor.lanes import Lane

if TYPE_CHECKING:
    from shipshape.executor.crew import Crew

Clock = Callable[[], float]  # monotonic seconds
W = TypeVar("W")
W_contra = TypeVar("W_contra", contravariant=True)
R = TypeVar("R")


@runtime_checkable  # so that shape-checked tests can check it
class Stage(Protocol[W_contra]):
    """One step of the work; it keeps its results in the work item."""

    @property
    def name(self) -> str:
        """The key of this stage's milliseconds."""
        ...

    def run(self, work: W_contra, /) -> None:
        """Do the step."""
        ...


class Rung(Protocol[W_contra]):
    """One way of answering; a cheaper one begins with stages of a dearer one, so that work can change over."""

    @property
    def name(self) -> str:
        """As answers tell it."""
        ...

    @property
    def stages(self) -> Sequence[Stage[W_contra]]:
        """In their order; costs are learned by stage, so each is hashable by identity."""
        ...


@dataclass(frozen=True, slots=True)
class Ended:
    """How a task was computed."""

    rung: str
    why: str  # it is not the top one: a sentence; empty for the top one
    stage_ms: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)  # work items hold arrays: only identity is meant
class Task(Generic[W, R]):
    """Work to be carried through the stages of one rung, then turned into the answer by `finish`."""

    ladder: Sequence[Rung[W]]  # those that the caller accepts, the dearest and best first
    work: W
    finish: Callable[[W, Ended], R]  # runs on the worker
    deadline: float  # on the executor's clock, seconds; an answer after it is worth nothing
    lane: Lane = Lane.TRACKING
    size: float = 0.0  # what the cost of a stage grows with
    crew: "Crew | None" = None  # whose workers alone can carry it; None: threads of this process
    spare: bool = False  # asked for by no caller: counted apart, always admitted, never on a cheaper rung


class Ticket(Generic[R]):
    """The place where a task's answer, or its error, appears exactly once.

    Attributes:
        degraded: Whether the answer is of another rung than the first; known once it is there.
        settled: Whether the answer or an error is there; kept apart, since a future takes its lock to tell.

    Whoever settles first wins: the worker with the answer, the waiter at the deadline, or the caller that
    leaves. A ticket that settled early is the sign to the worker to drop the work at the next stage boundary.
    """

    def __init__(self, deadline: float, clock: Clock) -> None:
        self.deadline = deadline
        self.degraded = False
        self.settled = False
        self.future: Future[R] = Future()
        self._clock = clock

    def remaining(self) -> float:
        """Seconds left until the deadline, never negative."""
        return max(0.0, self.deadline - self._clock())

    def cancel(self) -> None:
        """The caller no longer wants the answer."""
        self.fail(Cancelled("the caller left before the answer was computed"))

    def expire(self) -> None:
        """The deadline has passed."""
        self.fail(DeadlineExceeded("expected an answer before the deadline, got none in time"))

    def result(self) -> R:
        """Wait for the answer, at most until the deadline, however busy the workers are.

        Raises:
            DeadlineExceeded: no answer by the deadline.
            Cancelled: `cancel` was called.
            Exception: whatever a stage raised.
        """
        try:
            return self.future.result(min(self.remaining(), threading.TIMEOUT_MAX))
        except TimeoutError:
            if not self.settled:
                self.expire()
            return self.future.result()

    def succeed(self, answer: R) -> None:
        """Settle with the answer, unless settled already."""
        self.settled = True  # before: the future tells everybody
        with suppress(InvalidStateError):
            self.future.set_result(answer)

    def fail(self, error: Exception) -> None:
        """Settle with an error, unless settled already."""
        self.settled = True
        with suppress(InvalidStateError):
            self.future.set_exception(error)
