"""Every metric and the log format; nothing of it leaves the machine unless someone asks for it.

In one place, but for the metrics of a shadow bundle: `serving.shadow_metrics`.
"""

import asyncio
import collections
import json
import logging
import random
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, Protocol, TypeVar

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, Info, ProcessCollector

from shipshape import tracing
from shipshape.budget import WINDOWS, Budget, Level
from shipshape.histogram import BulkHistogram
from shipshape.processes import Processes

# Seconds, but those of requests: shares of the budget.
STAGE_BUCKETS = (5e-5, 1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3, 3.2e-3, 6.4e-3, 12.8e-3, 25e-3, 50e-3, 0.1, 0.4, 1.6)
REQUEST_BUCKETS = (0.02, 0.04, 0.08, 0.16, 0.32, 0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 4.0, 10.0, 20.0, 100.0)
AGE_BUCKETS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 60.0)
OK, DEGRADED, CANCELLED, INTERNAL = "ok", "degraded", "cancelled", "internal"
# What the budget is held to: answers, and what only we are to blame for.
HELD = (OK, DEGRADED, INTERNAL, "overloaded", "deadline_exceeded", "not_ready")
SINGLE, SCAN = "recognise", "recognise_scan"  # the methods whose request is one contact, and many
STREAM = "recognise_stream"  # each of its messages counts as a request of many contacts
INFER = "infer"  # that of the Open Inference Protocol, whose request may be either
RECOGNISING = (SINGLE, SCAN, STREAM, INFER)

M = TypeVar("M", Counter, Gauge, Histogram)
request_id: ContextVar[str] = ContextVar("request_id", default="")
_logger = logging.getLogger(__name__)


def new_request_id(proposed: str = "", traceparent: str = "") -> str:
    """The caller's own id if it is harmless in a log, else a fresh one; set for this context, as is its trace."""
    tracing.follow(traceparent)
    harmless = 0 < len(proposed) <= 64 and all(char.isalnum() or char in "-_.:" for char in proposed)
    # Not the system's random bytes: asking for them hands the interpreter's lock to others, for no gain here.
    chosen = proposed if harmless and proposed.isascii() else f"{random.getrandbits(64):016x}"
    request_id.set(chosen)
    return chosen


@dataclass(slots=True)
class Outcome:
    """How a request ended: "ok", "degraded" or the kind of its error. The door writes it."""

    kind: str = OK
    contacts: int = 0  # that the request brought, as soon as it is known
    urgent: bool = True  # held to the budget, which work of the batch lane is not
    stage_ms: Mapping[str, float] | None = None  # once they are known, over all contacts
    computed_ns: int = 0  # when that was, since 1970

    def computed(self, stage_ms: Mapping[str, float]) -> None:
        """The stages have ended, just now."""
        self.stage_ms, self.computed_ns = stage_ms, time.time_ns()


class Metrics:
    """All metrics of the service, registered in the registry handed in.

    Args:
        registry: Holds them.
        budget: Told of every answer; the buckets of request times lie around it.

    Attributes:
        observe_stage: Told the name of a stage that ran, and its seconds.
        observe_wait: Told the lane of a contact that was taken up, and the seconds that it had waited.
    """

    def __init__(self, registry: CollectorRegistry, budget: Budget) -> None:
        self.registry = registry
        self.budget = budget
        histogram, counter = partial(_children, Histogram, registry), partial(_children, Counter, registry)
        bulk = partial(BulkHistogram, buckets=STAGE_BUCKETS, registry=registry)
        self.observe_stage = bulk("shipshape_stage_seconds", "Time of one stage.", "stage").observe
        self.observe_wait = bulk(
            "shipshape_queue_seconds", "Time that a contact waited for a worker.", "lane"
        ).observe
        self._request = histogram(
            "shipshape_request_seconds",
            "Time of one request at the door, whatever the outcome.",
            ["door", "method", "outcome"],
            buckets=[share * budget.budget_s for share in REQUEST_BUCKETS],
        )
        self._age = Histogram(
            "shipshape_age_seconds",
            "Age of the points when their request came, where the caller tells it.",
            buckets=AGE_BUCKETS,
            registry=registry,
        )
        self._contacts = counter("shipshape_contacts", "Contacts answered or refused.", ["door", "outcome"])
        self._client_refusals = counter(
            "shipshape_client_refusals", "Requests refused for who asks: token, rate or under_way.", ["reason"]
        )
        self._in_flight = _children(Gauge, registry, "shipshape_in_flight", "Requests under way.", ["door"])
        self._ready = Gauge("shipshape_ready", "1 while the service takes requests.", registry=registry)
        self._held = counter(
            "shipshape_budget",
            "Requests held to the latency budget: answered inside it or not. Batch work is not held to it.",
            ["inside"],
        )
        watch_budget(budget, registry)
        self._bundle = Info("shipshape_bundle", "The running model bundle.", registry=registry)
        ProcessCollector(registry=registry)
        registry.register(Processes())

    def count_contacts(self, door: str, outcomes: Iterable[str]) -> None:
        """Contacts of a scan were answered ("ok") or refused (the kind of the error)."""
        for outcome, count in collections.Counter(outcomes).items():
            self._contacts(door, outcome).inc(count)

    def observe_age(self, seconds: float) -> None:
        """The points of a request were this old; seconds."""
        self._age.observe(seconds)

    def count_client_refusal(self, reason: str) -> None:
        """A request was refused for who asks; who that is would be a label without bounds."""
        self._client_refusals(reason).inc()

    def set_ready(self, ready: bool) -> None:
        """Whether the service takes requests."""
        self._ready.set(ready)

    def set_bundle(self, name: str, digest: str) -> None:
        """Which bundle runs."""
        self._bundle.info({"name": name, "digest": digest})

    @contextmanager
    def request(self, door: str, method: str, waited: float = 0.0) -> Iterator[Outcome]:
        """Time one request; its outcome is what the block leaves in the yielded object.

        `waited` is how long ago its first byte came, seconds.

        Contacts of an answered scan are counted one by one, by `count_contacts`; those of a scan that was refused
        as a whole are counted here, each with the kind of the refusal.
        """
        outcome = Outcome(contacts=int(method == SINGLE))
        start = time.perf_counter() - waited
        in_flight = self._in_flight(door)
        in_flight.inc()
        span = tracing.begin(f"{door} {method}")
        try:
            yield outcome
        except BaseException as error:
            if outcome.kind == OK:  # nobody has said how it ended: broken off, or by mistake
                outcome.kind = CANCELLED if isinstance(error, asyncio.CancelledError) else INTERNAL
            raise
        finally:
            seconds = time.perf_counter() - start
            in_flight.dec()
            self._request(door, method, outcome.kind).observe(seconds)
            if outcome.contacts and (method == SINGLE or outcome.kind not in (OK, DEGRADED)):
                self._contacts(door, outcome.kind).inc(outcome.contacts)
            if method in RECOGNISING and outcome.urgent and outcome.kind in HELD:
                inside = self.budget.tell(seconds, answered=outcome.kind in (OK, DEGRADED))
                self._held(str(inside).lower()).inc()
            _tell(door, method, outcome, seconds, span)


def _tell(door: str, method: str, outcome: Outcome, seconds: float, span: tracing.Span | None) -> None:
    """One line in the log, if it takes any so fine, and the end of the span, if there is one."""
    if span is None and not _logger.isEnabledFor(logging.DEBUG):
        return
    fields = {"door": door, "method": method, "outcome": str(outcome.kind), "contacts": outcome.contacts}
    text = "%s %s %s %.2f ms"
    extra = {"fields": {**fields, "ms": round(seconds * 1e3, 3)}}
    _logger.debug(text, door, method, outcome.kind, seconds * 1e3, extra=extra)
    if span is not None:
        attributes = {f"shipshape.{name}": value for name, value in fields.items()}
        attributes["shipshape.request_id"] = request_id.get()
        failed = outcome.kind == INTERNAL
        span.end(attributes, outcome.stage_ms or {}, outcome.computed_ns, failed=failed)


def _children(
    kind: type[M], registry: CollectorRegistry, name: str, text: str, labels: Sequence[str], **more: Any
) -> Callable[..., M]:
    """A metric's child by the values of its labels; kept, for the metric itself takes a lock to find it."""
    return cache(kind(name, text, labels, registry=registry, **more).labels)


class Workers(Protocol):
    """What gauges are read from whenever somebody scrapes."""

    @property
    def workers(self) -> int:
        """Threads that compute."""
        ...

    @property
    def running(self) -> int:
        """Contacts being computed."""
        ...

    @property
    def queue_depth(self) -> int:
        """Contacts that wait."""
        ...

    @property
    def queue_age(self) -> float:
        """Seconds that the oldest of them has waited."""
        ...


def watch_workers(workers: Workers, registry: CollectorRegistry) -> None:
    """Gauges of the workers and their queue."""
    gauges: dict[str, tuple[str, Callable[[], float]]] = {
        "shipshape_workers": ("Threads that compute.", lambda: workers.workers),
        "shipshape_running": ("Contacts being computed.", lambda: workers.running),
        "shipshape_queue_depth": ("Contacts that wait for a worker.", lambda: workers.queue_depth),
        "shipshape_queue_age_seconds": ("How long the oldest of them has waited.", lambda: workers.queue_age),
    }
    for name, (text, read) in gauges.items():
        Gauge(name, text, registry=registry).set_function(read)


def watch_budget(budget: Budget, registry: CollectorRegistry) -> None:
    """Gauges of the budget, read whenever somebody scrapes."""
    size = Gauge("shipshape_budget_seconds", "Time that an answer may take.", registry=registry)
    size.set(budget.budget_s)
    level = Gauge("shipshape_budget_level", "0 held, 1 warning, 2 error.", registry=registry)
    level.set_function(lambda: list(Level).index(budget.report().level))
    burn = Gauge(
        "shipshape_error_budget_burn",
        "How fast the share of answers that may be bad is used up; 1 is as fast as allowed.",
        ["window"],
        registry=registry,
    )
    for window in WINDOWS:
        burn.labels(window).set_function(partial(_burn, budget, window))


def _burn(budget: Budget, window: str) -> float:
    return budget.report().burn[window]


class JsonLines(logging.Formatter):
    """One JSON object a line: time (UTC), level, logger, message, request_id, trace_id, more, traceback.

    What more there is of a request: door, method, outcome, contacts, ms.
    """

    converter = staticmethod(time.gmtime)

    def format(self, record: logging.LogRecord) -> str:
        """The record as one line of JSON."""
        line: dict[str, Any] = {
            "time": f"{self.formatTime(record, '%Y-%m-%dT%H:%M:%S')}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if request_id.get():
            line["request_id"] = request_id.get()
        if tracing.trace_id.get():
            line["trace_id"] = tracing.trace_id.get()
        line |= getattr(record, "fields", {})
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False)


def configure_logging(level: str) -> None:
    """Send every log line of `level` and above to stderr as JSON."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
