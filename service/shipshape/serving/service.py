"""Both doors on one core, from live to ready to stopped; knows the parts only by what they do.

live: the doors listen and refuse -> ready: every stage is warm -> stopping: no new requests, those under way end
"""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import cv2
from prometheus_client import CollectorRegistry

from shipshape.budget import Budget
from shipshape.errors import Cancelled
from shipshape.executor import Executor, usable_cores
from shipshape.sample import sample_contact
from shipshape.serving.core import Core, Model, Render
from shipshape.serving.encoding import Limits
from shipshape.serving.grpc.server import GrpcDoor
from shipshape.serving.rest.app import build_app
from shipshape.serving.rest.server import RestDoor
from shipshape.serving.timing import Timeouts
from shipshape.serving.warmup import warm_up
from shipshape.settings import Settings
from shipshape.telemetry import Metrics, watch_workers

LAST_WORDS_S = 0.5  # to write the answers that the drained work gave

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Addresses:
    """Where the doors really listen."""

    host: str
    rest_port: int
    grpc_port: int

    def __str__(self) -> str:
        return f"REST http://{self.host}:{self.rest_port}, gRPC {self.host}:{self.grpc_port}"


class Service:
    """A service that `start` makes live, `open` makes ready, and `stop` ends without dropping what arrived.

    A REST request counts as arrived with its headers, a gRPC request with its whole message.

    Args:
        settings: See there.
        render: Draws the picture of an answer.
        on_death: Called when a door ends without having been asked to.
    """

    def __init__(self, settings: Settings, render: Render, *, on_death: Callable[[], None]) -> None:
        cv2.setNumThreads(1)  # the workers are the parallelism; a pool in each of them only adds latency
        workers = settings.workers or usable_cores()
        limits = Limits(settings.max_body_bytes, settings.max_points, settings.max_contacts)
        timeouts = Timeouts(settings.default_timeout_ms, settings.budget_ms)
        self._settings = settings
        self._turn = threading.Lock()  # to ready, or to stopping
        self._stopping = False
        self._render = render
        self._metrics = Metrics(CollectorRegistry(), Budget(settings.budget_ms / 1e3))
        self.executor = Executor(
            workers,
            settings.queue_limit,
            on_stage=self._metrics.observe_stage,
            on_wait=self._metrics.observe_wait,
        )
        watch_workers(self.executor, self._metrics.registry)
        self._core = Core(self.executor, limits, render, on_age=self._metrics.observe_age)
        self._grpc = GrpcDoor(self._core, self._metrics, timeouts, waiting=settings.queue_limit + workers)
        self._rest = RestDoor(build_app(self._core, self._metrics, timeouts), on_death=on_death)

    def start(self) -> Addresses:
        """Listen and refuse; raises OSError, with nothing left open, when an address cannot be bound."""
        host = self._settings.host
        try:
            rest_port = self._rest.start(host, self._settings.rest_port)
            return Addresses(host, rest_port, grpc_port=self._grpc.start(host, self._settings.grpc_port))
        except OSError:
            self.stop()
            raise

    def open(self, model: Model) -> None:
        """Warm `model` up, then take requests.

        Raises:
            Cancelled: `stop` was called before the service was ready.
            Exception: Whatever the warm-up raises.
        """
        warm_up(model, self._render, lambda: self._stopping)
        self._core.rehearse(model, sample_contact())
        with self._turn:
            if self._stopping:
                raise Cancelled("expected to take requests after the warm-up, got a signal to stop")
            self._metrics.set_bundle(model.bundle.name, model.bundle.digest)
            self._core.open(model)
            self._grpc.open()
            self._metrics.set_ready(True)

    def stop(self) -> None:
        """Not ready, accept no more, let what is under way end, for up to `drain_s` seconds."""
        with self._turn:
            self._stopping = True
            self._core.close()
            self._grpc.close()
            self._metrics.set_ready(False)
        end = time.monotonic() + self._settings.drain_s
        self._grpc.begin_stop(self._settings.drain_s)  # both doors drain at the same time
        self._rest.stop(self._settings.drain_s)
        if not self.executor.stop(max(0.0, end - time.monotonic())):
            _logger.warning("work was still under way after %s s and was dropped", self._settings.drain_s)
        # All answers are known; what still hangs on are watchers of health, who would stay for ever.
        self._grpc.begin_stop(LAST_WORDS_S).wait()
