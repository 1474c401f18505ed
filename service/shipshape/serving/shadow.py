"""A bundle beside the running one: some of the contacts answered are computed by both, and the answers compared.

answered contact --sample--> backlog --where workers are free--> running bundle, shadow --> metrics, log

Nothing is computed before the caller's answer has left, and by one contact at a time, in the batch lane.
"""

import logging
import math
import queue
import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from shipshape.errors import Cancelled, Conflict
from shipshape.executor import Executor, Lane, Ticket
from shipshape.sample import sample_contact
from shipshape.serving.comparison import Difference, Numbers, compare, numbers_of
from shipshape.serving.core import Core
from shipshape.serving.encoding import Wishes
from shipshape.serving.model import Model, Order, Reply
from shipshape.serving.shadow_metrics import ShadowMetrics, Verdict
from shipshape.telemetry import request_id
from shipshape.types import Contact, Options, Rung

BACKLOG = 16  # contacts; each may hold a megabyte
LEFT_S = 0.05  # after which an answer that is there has left
ROOM = 0.5  # contacts a worker: with no more under way, one more takes nobody's
LOOK_S = 0.02  # between two looks for room
PATIENCE_S = 5.0  # for one of the two answers
END_S = 5.0  # for the thread to notice the end

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class _Sample:
    """A contact that was answered."""

    contact: Contact
    options: Options
    request_id: str
    due: float  # monotonic seconds


class Shadow:
    """At most one bundle at a time is the shadow, from `begin` to `end`.

    Args:
        executor: Computes both answers.
        core: Tells of contacts, and which bundle runs.
        share: Of the contacts answered that are compared.
        metrics: Told of every comparison.
    """

    def __init__(self, executor: Executor, core: Core, share: float, metrics: ShadowMetrics) -> None:
        self._executor = executor
        self._core = core
        self._share = share
        self._metrics = metrics
        self._lock = threading.Lock()  # guards what follows
        self._run: _Run | None = None
        self._apart: Model | None = None  # the shadow, unless it is the running one
        self._stopped = False

    def begin(self, model: Model, *, apart: bool) -> None:
        """Compare with this model from now on, and no more with another.

        Args:
            model: Started.
            apart: It is not the running one, so that what becomes of its workers is no matter of the callers.

        Raises:
            Cancelled: `stop` was called.
        """
        with self._lock:
            if self._stopped:
                raise Cancelled("expected a service that takes requests, got a signal to stop")
            self._end()
            if apart:
                self._apart = model
                if (crew := _crew_of(model)) is not None:
                    self._executor.leave(crew)
            self._run = _Run(self._executor, model, self._core.model, self._metrics)
            self._metrics.set_bundle(model.bundle.name, model.bundle.digest)
            self._core.watch(partial(self._run.sample, self._share))

    def end(self, *, promoted: bool = False) -> None:
        """Compare no more.

        Args:
            promoted: The shadow is about to answer callers, and its workers are theirs.

        Raises:
            Conflict: It was to be promoted and lacks workers; nothing has changed.
        """
        with self._lock:
            if promoted and self._apart is not None and (crew := _crew_of(self._apart)) is not None:
                if not crew.whole:
                    raise Conflict("expected a shadow with all its workers, got one that lacks some: ask again")
                self._executor.join(crew)
            self._end()

    def stop(self) -> None:
        """Compare no more and end the shadow's workers: the service stops."""
        with self._lock:
            self._stopped, model = True, self._apart
            self._end()
        if model is not None:
            model.close()

    def counts(self) -> dict[str, int]:
        """How many contacts came to which verdict since `begin`."""
        with self._lock:
            counts = Counter() if self._run is None else self._run.counts.copy()
        return {verdict: counts[verdict] for verdict in Verdict}

    def _end(self) -> None:
        self._core.watch(None)
        self._metrics.no_bundle()
        if self._run is not None:
            self._run.end()
        self._run = self._apart = None


class _Run:
    """One bundle being the shadow; its thread compares one contact after the other.

    Attributes:
        counts: Contacts by verdict.
    """

    def __init__(
        self, executor: Executor, model: Model, running: Callable[[], Model], metrics: ShadowMetrics
    ) -> None:
        self.counts = Counter(dict.fromkeys(Verdict, 0))
        self._counting = threading.Lock()
        self._executor = executor
        self._model: Model | None = model
        self._running = running
        self._metrics = metrics
        self._backlog: queue.SimpleQueue[_Sample | None] = queue.SimpleQueue()
        self._ended = threading.Event()
        self._under_way: Ticket[Any] | None = None
        self._thread = threading.Thread(target=self._work, name="shadow", daemon=True)
        self._thread.start()

    def sample(self, share: float, ticket: Ticket[Any], contact: Contact, options: Options) -> None:
        """A contact was admitted; called before its caller waits for it."""
        if random.random() < share:
            ticket.future.add_done_callback(partial(self._settled, contact, options, request_id.get()))

    def end(self) -> None:
        """Wait for nothing; let go of the model."""
        self._ended.set()
        self._backlog.put(None)
        if (ticket := self._under_way) is not None:
            ticket.cancel()
        self._thread.join(END_S)
        self._model = None  # callers that still wait for their answers know this object

    def _settled(self, contact: Contact, options: Options, whose: str, future: Future[Reply[Any]]) -> None:
        """Called on the thread that has the answer: no more than note it down."""
        if self._ended.is_set() or future.cancelled() or future.exception() is not None:
            return
        if future.result().rung is not Rung.FULL:
            return  # such an answer says more of the moment than of the bundle
        if self._backlog.qsize() >= BACKLOG:
            self._tell(Verdict.DROPPED)
        else:
            self._backlog.put(_Sample(contact, options, whose, time.monotonic() + LEFT_S))

    def _work(self) -> None:
        while (sample := self._backlog.get()) is not None and self._has_room(sample.due):
            request_id.set(sample.request_id)
            self._compare(sample)
            del sample  # a waiting thread must not keep the last cluster alive

    def _has_room(self, due: float) -> bool:
        """Wait until workers are free; False at the end."""
        patience = max(0.0, due - time.monotonic())
        while not self._ended.wait(patience):
            if self._executor.load <= ROOM:
                return True
            patience = LOOK_S
        return False

    def _compare(self, sample: _Sample) -> None:
        try:
            expected = self._numbers(self._running(), sample)
        except Exception:  # it was answered once: now the service stops, or has no room
            self._tell(Verdict.DROPPED)
            return
        try:
            found = compare(expected, self._numbers(self._model, sample))
        except Cancelled:
            self._tell(Verdict.DROPPED)
        except Exception as error:
            _logger.info("the shadow has no answer: %s: %.200s", type(error).__name__, error)
            self._tell(Verdict.FAILED)
        else:
            self._tell(Verdict.SAME if found.same else Verdict.DIFFERS, found)

    def _numbers(self, model: Model | None, sample: _Sample) -> Numbers:
        if model is None:
            raise Cancelled("expected a shadow, got its end")
        wishes = Wishes(replace(sample.options, lowest_rung=Rung.FULL), Lane.BATCH)
        task = model.task(Order(sample.contact, wishes, numbers_of), math.inf)
        self._under_way = ticket = self._executor.submit(replace(task, spare=True))
        try:
            if not self._ended.is_set():
                wait([ticket.future], PATIENCE_S)
            ticket.cancel()  # does nothing to one that is settled
            return ticket.future.result().content
        finally:
            self._under_way = None  # it knows the model, and with it its workers
            del model, task, ticket  # else an error would know them, as they know the error

    def _tell(self, verdict: Verdict, found: Difference | None = None) -> None:
        with self._counting:
            self.counts[verdict] += 1
        self._metrics.count(verdict)
        if found is None:
            return
        self._metrics.observe(found)
        if not found.same:
            running, shadow = found.vessels
            fields = {"running": running, "shadow": shadow}
            _logger.info("the shadow says %s, the running bundle %s", shadow, running, extra={"fields": fields})


def _crew_of(model: Model) -> Any:
    """The workers that a model has for itself; None where threads of the service carry it."""
    return model.task(Order(sample_contact(), Wishes(), numbers_of), math.inf).crew
