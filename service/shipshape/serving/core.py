"""The one place where recognition happens, whichever door a contact came through.

contact + wishes + deadline -> checks -> executor -> answer
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import wait
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from shipshape.errors import Cancelled, DeadlineExceeded, InvalidInput, NotReady
from shipshape.executor import Executor, Lane, Task, Ticket
from shipshape.serving.age import age_of, time_left
from shipshape.serving.answer_size import check_answer
from shipshape.serving.encoding import Limits, Wishes, check_contacts
from shipshape.serving.faults import Fault, fault_of
from shipshape.serving.model import Encode, Model, Order, Reply
from shipshape.serving.timing import summed
from shipshape.telemetry import DEGRADED, OK, Metrics
from shipshape.types import Contact, Options, Rung

C = TypeVar("C")
WAY_OUT_S = 0.002  # that an answer takes through the door, on a busy machine
Watch = Callable[[Ticket[Any], Contact, Options], None]  # told of each contact that was admitted


@dataclass(frozen=True, slots=True)
class Capacity:
    """What the service would promise now; seconds."""

    promises: Mapping[Rung, float]  # in which a contact would be answered on each rung
    wait_s: float  # of that, until a worker is free
    queue_depth: int
    running: int
    workers: int


class Scan(Generic[C]):
    """The contacts of one scan on their way: each a ticket, or the error that refused it."""

    def __init__(self, entries: Sequence[Ticket[Reply[C]] | Exception]) -> None:
        self.entries = entries
        self.tickets = [entry for entry in entries if isinstance(entry, Ticket)]

    def outcomes(self) -> list[Reply[C] | Exception]:
        """Wait for all, at most until their deadline: a reply or an error for each contact.

        Raises:
            DeadlineExceeded, Cancelled, NotReady: when all that was admitted ended so.
        """
        # For all at once: to be woken by each of them would take more time than all else here.
        if self.tickets:
            patience = min(ticket.remaining() for ticket in self.tickets)
            wait([ticket.future for ticket in self.tickets], min(patience, threading.TIMEOUT_MAX))
        outcomes = [_outcome(entry) for entry in self.entries]
        admitted = [
            outcome for entry, outcome in zip(self.entries, outcomes, strict=True) if isinstance(entry, Ticket)
        ]
        for common in (DeadlineExceeded, Cancelled, NotReady):
            if admitted and all(isinstance(outcome, common) for outcome in admitted):
                raise common(str(admitted[0]))
        return outcomes


def conclude(scan: Scan[C], door: str, metrics: Metrics) -> tuple[list[Reply[C] | Fault], dict[str, float]]:
    """Wait for a scan and count its contacts.

    Returns:
        A reply or a fault for each contact, and the milliseconds of each stage over all of them.

    Raises:
        DeadlineExceeded, Cancelled, NotReady: As `Scan.outcomes`.
    """
    outcomes = [fault_of(end) if isinstance(end, Exception) else end for end in scan.outcomes()]
    metrics.count_contacts(door, (end.kind if isinstance(end, Fault) else outcome_of(end) for end in outcomes))
    return outcomes, summed(end.stage_ms for end in outcomes if not isinstance(end, Fault))


def outcome_of(reply: Reply[Any]) -> str:
    """How metrics call it: ok, or degraded when it is of a lower rung."""
    return OK if reply.rung is Rung.FULL else DEGRADED


class Core:
    """Checks, queues and answers; ready once it has a model, until it is told to stop.

    Args:
        executor: Carries the stages.
        limits: What one request may bring.
        on_age: Told how old the points of a request are, seconds, when the caller says it.
    """

    def __init__(
        self,
        executor: Executor,
        limits: Limits,
        *,
        on_age: Callable[[float], None] = lambda seconds: None,
    ) -> None:
        self.limits = limits
        self._executor = executor
        self._on_age = on_age
        self._model: Model | None = None
        self._watch: Watch | None = None
        self._refusal = "expected a running service, got one that is still starting"

    @property
    def ready(self) -> bool:
        """Whether requests are taken, and computed: no worker is dead or stuck."""
        return self._model is not None and self._executor.sound

    @property
    def places(self) -> int:
        """Contacts that may wait or be computed at a time."""
        return self._executor.queue_limit + self._executor.workers

    def open(self, model: Model) -> None:
        """Take requests from now on, answered by `model`."""
        self._model = model

    def watch(self, watch: Watch | None) -> None:
        """Tell it of each contact that is admitted from now on; None: tell nobody."""
        self._watch = watch

    def close(self) -> None:
        """Take no more requests; those under way go on."""
        self._refusal = "expected a running service, got one that is stopping"
        self._model = None

    def deadline_in(self, seconds: float) -> float:
        """When an answer must be there that its caller wants in `seconds`; `submit` and `submit_scan` take it."""
        return self._executor.clock() + seconds - WAY_OUT_S

    def seconds_until(self, deadline: float) -> float:
        """What is left until a moment from `deadline_in`, never negative."""
        return max(0.0, deadline - self._executor.clock())

    def model(self) -> Model:
        """The running model, for a request to take at its start: what began before a stop is still answered.

        Raises:
            NotReady: The service is starting or stopping.
        """
        if (model := self._model) is None:
            raise NotReady(self._refusal)
        return model

    def capacity(self, points: int, lane: Lane) -> Capacity:
        """What would be promised now to a contact of so many points in this lane; raises as `model` does."""
        ladder = self.model().pipeline.ladder(Options())
        return Capacity(
            {rung.name: self._executor.promise(rung, points, lane) for rung in ladder},
            self._executor.wait(lane),
            self._executor.queue_depth,
            self._executor.running,
            self._executor.workers,
        )

    def load(self) -> float:
        """Contacts that wait or are computed, a worker: over 1, there is a queue."""
        return self._executor.load

    def check(self, lane: Lane, deadline: float) -> None:
        """Raises at once, before anything of a request is read, what even its cheapest contact would be told."""
        self._executor.check(lane, deadline)

    def submit(self, model: Model, order: Order[C], deadline: float) -> Ticket[Reply[C]]:
        """Queue one contact; a ticket for its answer.

        Args:
            model: From `model`.
            order: The contact, how to compute and whether to draw.
            deadline: From `deadline_in`.

        Raises:
            InvalidInput: Another bundle than the running one, or points that cannot be one vessel's cluster.
            Overloaded, DeadlineExceeded, NotReady: No place, no time, or stopped for good.
        """
        deadline = self._check(model, order.wishes, deadline)
        ticket = self._executor.submit(model.task(order, deadline))
        if (watch := self._watch) is not None:
            watch(ticket, order.contact, order.wishes.options)
        return ticket

    def submit_scan(
        self,
        model: Model,
        contacts: Sequence[Contact | InvalidInput],
        wishes: Wishes,
        encode: Encode[C],
        deadline: float,
    ) -> Scan[C]:
        """Queue all acceptable contacts of a scan, or none; the others keep their own error.

        Args:
            model: From `model`.
            contacts: Level frame; an error stands for a contact that could not even be decoded.
            wishes: Hold for all contacts.
            encode: Of each answer.
            deadline: From `deadline_in`, for all contacts.

        Raises:
            InvalidInput, TooLarge, Overloaded, DeadlineExceeded, NotReady: What concerns the scan as a whole.
        """
        check_contacts(len(contacts), self.limits)
        check_answer(contacts, wishes)
        deadline = self._check(model, wishes, deadline)
        entries = [_task(model, contact, wishes, encode, deadline) for contact in contacts]
        tickets = iter(self._executor.submit_all([entry for entry in entries if isinstance(entry, Task)]))
        scan = Scan([next(tickets) if isinstance(entry, Task) else entry for entry in entries])
        if (watch := self._watch) is not None:
            for contact, ticket in zip(contacts, scan.entries, strict=True):
                if isinstance(ticket, Ticket) and isinstance(contact, Contact):
                    watch(ticket, contact, wishes.options)
        return scan

    def _check(self, model: Model, wishes: Wishes, deadline: float) -> float:
        """The moment at which the answer must be there."""
        if wishes.bundle not in ("", model.bundle.name, model.bundle.digest):
            expected = f"{model.bundle.name} ({model.bundle.digest})"
            raise InvalidInput(f"expected bundle {expected}, got {wishes.bundle:.80}")
        if self._executor.clock() >= deadline:
            raise DeadlineExceeded("expected an answer before the deadline, got a request that is already late")
        return self._in_time(wishes, deadline)

    def _in_time(self, wishes: Wishes, deadline: float) -> float:
        """The deadline, or the earlier moment at which what the LiDAR saw will be too old."""
        if (age := age_of(wishes, time.time())) is None:
            return deadline
        self._on_age(age)
        return min(deadline, self._executor.clock() + time_left(age, wishes))


def _task(
    model: Model, contact: Contact | InvalidInput, wishes: Wishes, encode: Encode[C], deadline: float
) -> Task[Any, Reply[C]] | Exception:
    if not isinstance(contact, Contact):
        return contact
    try:
        return model.task(Order(contact, wishes, encode), deadline)
    except Exception as error:  # whatever it is, it is this contact's alone
        return error


def _outcome(entry: Ticket[Reply[C]] | Exception) -> Reply[C] | Exception:
    if isinstance(entry, Exception):
        return entry
    try:
        return entry.result()
    except Exception as error:
        return error
