"""Every metric and the log format, in one place; nothing of it leaves the machine unless someone asks for it."""

import asyncio
import collections
import json
import logging
import sys
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, Info, ProcessCollector

# Seconds. Stages lie between 10 us and the budget; answers around the budget of 50 ms.
STAGE_BUCKETS = (5e-5, 1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3, 3.2e-3, 6.4e-3, 12.8e-3, 25e-3, 50e-3, 0.1, 0.4, 1.6)
REQUEST_BUCKETS = (1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 25e-3, 35e-3, 50e-3, 70e-3, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
OK, CANCELLED, INTERNAL = "ok", "cancelled", "internal"
SINGLE, SCAN = "recognise", "recognise_scan"  # the methods whose request is one contact, and many
STREAM = "recognise_stream"  # each of its messages counts as a request of many contacts

request_id: ContextVar[str] = ContextVar("request_id", default="")
_logger = logging.getLogger(__name__)


def new_request_id(proposed: str = "") -> str:
    """The caller's own id if it is harmless in a log, else a fresh one; set for the current context."""
    harmless = 0 < len(proposed) <= 64 and all(char.isalnum() or char in "-_.:" for char in proposed)
    chosen = proposed if harmless and proposed.isascii() else uuid.uuid4().hex[:16]
    request_id.set(chosen)
    return chosen


@dataclass(slots=True)
class Outcome:
    """How a request ended: "ok" or the kind of its error. The door writes it."""

    kind: str = OK
    contacts: int = 0  # that the request brought, as soon as it is known


class Metrics:
    """All metrics of the service, registered in the registry handed in."""

    def __init__(self, registry: CollectorRegistry) -> None:
        self.registry = registry
        self._stage = Histogram(
            "shipshape_stage_seconds", "Time of one stage.", ["stage"], buckets=STAGE_BUCKETS, registry=registry
        )
        self._request = Histogram(
            "shipshape_request_seconds",
            "Time of one request at the door, whatever the outcome.",
            ["door", "method", "outcome"],
            buckets=REQUEST_BUCKETS,
            registry=registry,
        )
        self._contacts = Counter(
            "shipshape_contacts", "Contacts answered or refused.", ["door", "outcome"], registry=registry
        )
        self._in_flight = Gauge("shipshape_in_flight", "Requests under way.", ["door"], registry=registry)
        self._queue = Gauge("shipshape_queue_depth", "Contacts that wait for a worker.", registry=registry)
        self._running = Gauge("shipshape_running", "Contacts being computed.", registry=registry)
        self._ready = Gauge("shipshape_ready", "1 while the service takes requests.", registry=registry)
        self._bundle = Info("shipshape_bundle", "The running model bundle.", registry=registry)
        ProcessCollector(registry=registry)

    def observe_stage(self, stage: str, seconds: float) -> None:
        """One stage ran; seconds."""
        self._stage.labels(stage).observe(seconds)

    def count_contacts(self, door: str, outcomes: Iterable[str]) -> None:
        """Contacts of a scan were answered ("ok") or refused (the kind of the error)."""
        for outcome, count in collections.Counter(outcomes).items():
            self._contacts.labels(door, outcome).inc(count)

    def watch_queue(self, depth: Callable[[], float], running: Callable[[], float]) -> None:
        """Read both gauges from the executor whenever somebody scrapes."""
        self._queue.set_function(depth)
        self._running.set_function(running)

    def set_ready(self, ready: bool) -> None:
        """Whether the service takes requests."""
        self._ready.set(ready)

    def set_bundle(self, name: str, digest: str) -> None:
        """Which bundle runs."""
        self._bundle.info({"name": name, "digest": digest})

    @contextmanager
    def request(self, door: str, method: str) -> Iterator[Outcome]:
        """Time one request; its outcome is what the block leaves in the yielded object.

        Contacts of an answered scan are counted one by one, by `count_contacts`; those of a scan that was refused
        as a whole are counted here, each with the kind of the refusal.
        """
        outcome = Outcome(contacts=int(method == SINGLE))
        start = time.perf_counter()
        in_flight = self._in_flight.labels(door)
        in_flight.inc()
        try:
            yield outcome
        except BaseException as error:
            if outcome.kind == OK:  # nobody has said how it ended: broken off, or by mistake
                outcome.kind = CANCELLED if isinstance(error, asyncio.CancelledError) else INTERNAL
            raise
        finally:
            seconds = time.perf_counter() - start
            in_flight.dec()
            self._request.labels(door, method, outcome.kind).observe(seconds)
            if method == SINGLE or outcome.kind != OK:
                self.count_contacts(door, [outcome.kind] * outcome.contacts)
            _logger.debug("%s %s %s %.2f ms", door, method, outcome.kind, seconds * 1e3)


class JsonLines(logging.Formatter):
    """One JSON object a line: time (UTC), level, logger, message, request_id, traceback."""

    converter = staticmethod(time.gmtime)

    def format(self, record: logging.LogRecord) -> str:
        """The record as one line of JSON."""
        line = {
            "time": f"{self.formatTime(record, '%Y-%m-%dT%H:%M:%S')}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if request_id.get():
            line["request_id"] = request_id.get()
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False)


def configure_logging(level: str) -> None:
    """Send every log line of `level` and above to stderr as JSON."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
