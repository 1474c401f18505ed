"""The one place where recognition happens, whichever door a contact came through.

contact + wishes + deadline -> checks -> executor -> answer
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

from shipshape.bundle import Bundle
from shipshape.errors import Cancelled, DeadlineExceeded, InvalidInput, NotReady
from shipshape.executor import Ended, Executor, Lane, Stage, Task, Ticket
from shipshape.serving.age import age_of, time_left
from shipshape.serving.encoding import Limits, Wishes, check_contacts
from shipshape.serving.faults import Fault, fault_of
from shipshape.serving.shedding import check_room
from shipshape.serving.timing import summed
from shipshape.telemetry import DEGRADED, OK, Metrics
from shipshape.types import Contact, Options, Recognition, Rung

Render = Callable[[Contact, Recognition], bytes]  # -> PNG


class LadderRung(Protocol):
    """One rung of a pipeline's ladder and its stages."""

    @property
    def name(self) -> Rung:
        """As answers tell it."""
        ...

    @property
    def stages(self) -> Sequence[Stage[Any]]:
        """In their order."""
        ...


@runtime_checkable  # so that shape-checked tests can check it
class PipelineLike(Protocol):
    """What the core needs of a pipeline; `Any` is its work item, which only its own stages read."""

    @property
    def stages(self) -> Sequence[Stage[Any]]:
        """In the order of the data path."""
        ...

    def ladder(self, options: Options) -> Sequence[LadderRung]:
        """The rungs that the caller accepts, the best first."""
        ...

    def begin(self, contact: Contact, options: Options) -> Any:
        """The work item; raises InvalidInput when the points cannot be one vessel's cluster."""
        ...

    def finish(self, work: Any, stage_ms: Mapping[str, float], rung: Rung, rung_reason: str) -> Recognition:
        """The answer, once every stage of the rung ran."""
        ...


@dataclass(frozen=True, slots=True)
class Model:
    """A bundle and the pipeline made of it; replaced as one."""

    bundle: Bundle
    pipeline: PipelineLike


@dataclass(frozen=True, slots=True)
class Answer:
    """One contact's recognition and, if wished, its picture (PNG)."""

    contact: Contact
    recognition: Recognition
    png: bytes | None = None


@dataclass(frozen=True, slots=True)
class Capacity:
    """What the service would promise now; seconds."""

    promises: Mapping[Rung, float]  # in which a contact would be answered on each rung
    wait_s: float  # of that, until a worker is free
    queue_depth: int
    running: int
    workers: int


class Scan:
    """The contacts of one scan on their way: each a ticket, or the error that refused it."""

    def __init__(self, entries: Sequence[Ticket[Answer] | Exception]) -> None:
        self._entries = entries
        self.tickets = [entry for entry in entries if isinstance(entry, Ticket)]

    def outcomes(self) -> list[Answer | Exception]:
        """Wait for all, at most until their deadline: an answer or an error for each contact.

        Raises:
            DeadlineExceeded, Cancelled, NotReady: when all that was admitted ended so.
        """
        outcomes = [_outcome(entry) for entry in self._entries]
        admitted = [
            outcome for entry, outcome in zip(self._entries, outcomes, strict=True) if isinstance(entry, Ticket)
        ]
        for common in (DeadlineExceeded, Cancelled, NotReady):
            if admitted and all(isinstance(outcome, common) for outcome in admitted):
                raise common(str(admitted[0]))
        return outcomes


def conclude(scan: Scan, door: str, metrics: Metrics) -> tuple[list[Answer | Fault], dict[str, float]]:
    """Wait for a scan and count its contacts.

    Returns:
        An answer or a fault for each contact, and the milliseconds of each stage over all of them.

    Raises:
        DeadlineExceeded, Cancelled, NotReady: As `Scan.outcomes`.
    """
    outcomes = [fault_of(end) if isinstance(end, Exception) else end for end in scan.outcomes()]
    metrics.count_contacts(door, (end.kind if isinstance(end, Fault) else outcome_of(end) for end in outcomes))
    return outcomes, summed(end.recognition for end in outcomes if not isinstance(end, Fault))


def outcome_of(answer: Answer) -> str:
    """How metrics call it: ok, or degraded when it is of a lower rung."""
    return OK if answer.recognition.rung is Rung.FULL else DEGRADED


class Core:
    """Checks, queues and answers; ready once it has a model, until it is told to stop.

    Args:
        executor: Carries the stages.
        limits: What one request may bring.
        render: Draws the picture of an answer.
        on_age: Told how old the points of a request are, seconds, when the caller says it.
    """

    def __init__(
        self,
        executor: Executor,
        limits: Limits,
        render: Render,
        *,
        on_age: Callable[[float], None] = lambda seconds: None,
    ) -> None:
        self.limits = limits
        self._executor = executor
        self._render = render
        self._on_age = on_age
        self._model: Model | None = None
        self._refusal = "expected a running service, got one that is still starting"

    @property
    def ready(self) -> bool:
        """Whether requests are taken, and computed: no worker is dead or stuck."""
        return self._model is not None and self._executor.sound

    def open(self, model: Model) -> None:
        """Take requests from now on, answered by `model`."""
        self._model = model

    def rehearse(self, model: Model, contact: Contact) -> None:
        """Run a contact on every rung, for their costs to be known before the first request; raises as they do."""
        for rung in (*Rung, *Rung):
            wishes = Wishes(Options(lowest_rung=rung))
            task = self._task(model, contact, wishes, math.inf)
            self._executor.rehearse(replace(task, ladder=task.ladder[-1:]))

    def close(self) -> None:
        """Take no more requests; those under way go on."""
        self._refusal = "expected a running service, got one that is stopping"
        self._model = None

    def deadline_in(self, seconds: float) -> float:
        """The moment `seconds` from now on the executor's clock, as `submit` and `submit_scan` take it."""
        return self._executor.clock() + seconds

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
        return (self._executor.queue_depth + self._executor.running) / self._executor.workers

    def sheds(self, lane: Lane, deadline: float) -> None:
        """Raises at once what admission would say to even the cheapest contact of this lane; see `shedding`."""
        check_room(self._executor, lane, deadline)

    def submit(self, model: Model, contact: Contact, wishes: Wishes, deadline: float) -> Ticket[Answer]:
        """Queue one contact; a ticket for its answer.

        Args:
            model: From `model`.
            contact: Level frame.
            wishes: How to compute, and whether to draw.
            deadline: From `deadline_in`.

        Raises:
            InvalidInput: Another bundle than the running one, or points that cannot be one vessel's cluster.
            Overloaded, DeadlineExceeded, NotReady: No place, no time, or stopped for good.
        """
        deadline = self._check(model, wishes, deadline)
        return self._executor.submit(self._task(model, contact, wishes, deadline))

    def submit_scan(
        self, model: Model, contacts: Sequence[Contact | InvalidInput], wishes: Wishes, deadline: float
    ) -> Scan:
        """Queue all acceptable contacts of a scan, or none; the others keep their own error.

        Args:
            model: From `model`.
            contacts: Level frame; an error stands for a contact that could not even be decoded.
            wishes: Hold for all contacts.
            deadline: From `deadline_in`, for all contacts.

        Raises:
            InvalidInput, Overloaded, DeadlineExceeded, NotReady: What concerns the scan as a whole.
        """
        check_contacts(len(contacts), self.limits)
        deadline = self._check(model, wishes, deadline)
        entries: list[Task[Any, Answer] | Exception] = []
        for contact in contacts:
            try:
                entries.append(
                    self._task(model, contact, wishes, deadline) if isinstance(contact, Contact) else contact
                )
            except Exception as error:  # whatever it is, it is this contact's alone
                entries.append(error)
        tickets = iter(self._executor.submit_all([entry for entry in entries if isinstance(entry, Task)]))
        return Scan([next(tickets) if isinstance(entry, Task) else entry for entry in entries])

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

    def _task(self, model: Model, contact: Contact, wishes: Wishes, deadline: float) -> Task[Any, Answer]:
        def finish(work: Any, ended: Ended) -> Answer:
            """On the worker: drawing a picture takes as long as the recognition."""
            recognition = model.pipeline.finish(work, ended.stage_ms, Rung(ended.rung), ended.why)
            png = self._render(contact, recognition) if wishes.png else None
            return Answer(contact, recognition, png)

        return Task(
            model.pipeline.ladder(wishes.options),
            model.pipeline.begin(contact, wishes.options),
            finish,
            deadline,
            wishes.lane,
            size=len(contact.points_level),
        )


def _outcome(entry: Ticket[Answer] | Exception) -> Answer | Exception:
    if isinstance(entry, Exception):
        return entry
    try:
        return entry.result()
    except Exception as error:
        return error
