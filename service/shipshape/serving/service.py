"""All doors on one core, from live to ready to stopped; knows the parts only by what they do. States: `health`."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from prometheus_client import CollectorRegistry

from shipshape.budget import Budget
from shipshape.errors import Cancelled
from shipshape.executor import Executor
from shipshape.serving.access import load_access
from shipshape.serving.admin.control import Control
from shipshape.serving.core import Core
from shipshape.serving.encoding import Limits
from shipshape.serving.grpc.server import GrpcDoor
from shipshape.serving.health import Health, State
from shipshape.serving.model import Model
from shipshape.serving.models import Load, Models, Placed
from shipshape.serving.operators import OperatorDoors
from shipshape.serving.rest.app import build_app
from shipshape.serving.rest.server import RestDoor
from shipshape.serving.shadow import Shadow
from shipshape.serving.shadow_metrics import ShadowMetrics
from shipshape.serving.timing import Timeouts
from shipshape.settings import Settings
from shipshape.telemetry import Metrics, watch_workers

LAST_CALL_S = 0.2  # requests on their way meet a refusal that says why, not a connection that is closed
LAST_WORDS_S = 0.5  # to write the answers that the drained work gave
PULSE_S = 0.25  # between two looks at the workers

_logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Addresses:
    """Where the doors really listen; no port is one that is off."""

    host: str
    rest_port: int
    grpc_port: int
    health_port: int | None = None
    admin_port: int | None = None

    def __str__(self) -> str:
        doors = f"REST http://{self.host}:{self.rest_port}, gRPC {self.host}:{self.grpc_port}"
        others = {"health": self.health_port, "admin": self.admin_port}
        return doors + "".join(f", {name} port {port}" for name, port in others.items() if port is not None)


class Service:
    """A service that `start` makes live, `open` makes ready, and `stop` ends without dropping what arrived.

    A REST request counts as arrived with its headers, a gRPC request with its whole message.

    Args:
        settings: See there.
        workers: What computes, processes or threads.
        load: Reads a bundle, for a swap.
        on_death: Called when a door ends without having been asked to.

    Raises:
        SettingsError: A file of certificates or tokens cannot be used.
    """

    def __init__(self, settings: Settings, workers: int, *, load: Load, on_death: Callable[[], None]) -> None:
        limits = Limits(settings.max_body_bytes, settings.max_points, settings.max_contacts)
        timeouts = Timeouts(settings.default_timeout_ms, settings.budget_ms)
        self._settings = settings
        self._turn = threading.Lock()  # to let a model answer, or to leave
        self._leaving = threading.Event()
        self._stopped = threading.Event()
        self._metrics = metrics = Metrics(CollectorRegistry(), Budget(settings.budget_ms / 1e3))
        self.executor = Executor(
            workers, settings.queue_limit, on_stage=metrics.observe_stage, on_wait=metrics.observe_wait
        )
        watch_workers(self.executor, metrics.registry)
        self._core = Core(self.executor, limits, on_age=metrics.observe_age)
        self.health = Health(self.executor)
        compared = ShadowMetrics(metrics.registry)
        self._shadow = Shadow(self.executor, self._core, settings.shadow_share, compared)
        self.models = Models(load, self._try_out, self._publish, self._shadow)
        access = load_access(settings, metrics.count_client_refusal)
        self._grpc = GrpcDoor(
            self._core,
            metrics,
            timeouts,
            access,
            self.health,
            shared=settings.share_ports,
        )
        app = build_app(self._core, metrics, timeouts, access, self.health)
        self._rest = RestDoor(app, access.tls, on_death=on_death, shared=settings.share_ports)
        root = settings.bundle_root or settings.bundle.absolute().parent
        self._operators = OperatorDoors(
            settings,
            health=self.health,
            registry=metrics.registry,
            control=Control(self.health, self.models, self.executor, root),
            on_death=on_death,
        )
        self.health.watch(self._tell)

    def start(self) -> Addresses:
        """Listen and refuse; raises OSError, with nothing left open, when an address cannot be bound."""
        host = self._settings.host
        try:
            health_port, admin_port = self._operators.start()
            rest_port = self._rest.start(host, self._settings.rest_port)
            grpc_port = self._grpc.start(host, self._settings.grpc_port)
        except OSError:
            self.stop()
            raise
        self.health.move_to(State.WARMING)
        threading.Thread(target=self._pulse, name="pulse", daemon=True).start()
        return Addresses(host, rest_port, grpc_port, health_port, admin_port)

    def open(self, model: Model) -> None:
        """Warm `model` up, then take requests.

        Raises:
            Cancelled: `leave` or `stop` was called before the service was ready.
            Exception: Whatever the warm-up raises.
        """
        self.models.open(Placed(self._settings.bundle, model))

    def leave(self) -> bool:
        """Not ready from now on, so that requests go elsewhere; those that come are still answered.

        Returns:
            Whether there is a model to answer them.
        """
        with self._turn:
            self._leaving.set()
            self.health.move_to(State.STOPPING)
            return self.models.running is not None

    def stop(self) -> None:
        """Not ready, refuse, accept no more, let what is under way end, for up to `drain_s` seconds."""
        answering = self.leave()
        self._core.close()
        self._shadow.stop()
        if answering:
            time.sleep(LAST_CALL_S)
        end = time.monotonic() + self._settings.drain_s
        self._grpc.begin_stop(self._settings.drain_s)  # both doors drain at the same time
        self._rest.stop(self._settings.drain_s)
        if not self.executor.stop(max(0.0, end - time.monotonic())):
            _logger.warning("work was still under way after %s s and was dropped", self._settings.drain_s)
        # All answers are known; what still hangs on are watchers of health, who would stay for ever.
        self._grpc.begin_stop(LAST_WORDS_S).wait()
        self._operators.stop()  # last: a probe must not take a service that drains for a dead one
        self._stopped.set()

    def _try_out(self, model: Model) -> None:
        model.start(self.executor, self._leaving.is_set)

    def _publish(self, model: Model) -> None:
        with self._turn:
            if self._leaving.is_set():
                raise Cancelled("expected a service that takes requests, got a signal to stop")
            self._metrics.set_bundle(model.bundle.name, model.bundle.digest)
            self._core.open(model)
            self.health.move_to(State.READY)

    def _tell(self, live: bool, ready: bool) -> None:
        self._grpc.tell(live=live, ready=ready)
        self._metrics.set_ready(ready)

    def _pulse(self) -> None:
        while not self._stopped.wait(PULSE_S):
            self.health.refresh()
