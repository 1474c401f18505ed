"""The process: bundle -> pipeline -> service -> wait for a signal -> stop. The only place that joins them all."""

import gc
import logging
import math
import queue
import signal
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

from shipshape.errors import BundleError, Cancelled, NotReady, SettingsError
from shipshape.providers import Runtime
from shipshape.serving.compute import in_processes, runtime_of, workers_of
from shipshape.serving.model import Model
from shipshape.serving.remote_model import RemoteModel
from shipshape.serving.service import Addresses, Service
from shipshape.settings import Settings
from shipshape.telemetry import configure_logging

_logger = logging.getLogger(__name__)
OK, FAILED, UNUSABLE = 0, 1, 2  # exit codes, as `cli` lists them
LOOK_S = 0.5  # between two looks for a signal that came an instant too early to end the wait
LEAVE_S = 2.0  # for a warm-up to reach the end of its stage; networks take milliseconds, compiling may take longer

# What ends the wait of the main thread: a signal's number, a door that died (None), or a warm-up that failed.
End = int | Exception | None


def serve(settings: Settings) -> int:
    """Serve until SIGTERM or SIGINT.

    Returns:
        The exit code: 0 after an orderly stop, 2 when the bundle cannot be used, 1 when the start failed otherwise
        or a door died. A failed start says why in one sentence on stderr.
    """
    configure_logging(settings.log_level)
    # Put of a SimpleQueue may interrupt its own get, which an Event's set may not: it is safe in a handler.
    ends: queue.SimpleQueue[End] = queue.SimpleQueue()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, frame: ends.put(received))
    model: Model | None = None
    try:
        runtime = runtime_of(settings)
        load = partial(load_model, settings, runtime)
        model = load(settings.bundle)
        workers = workers_of(settings, runtime.provider)
        service = Service(settings, workers, load=load, on_death=lambda: ends.put(None))
        addresses = service.start()
    except (BundleError, NotReady, SettingsError, OSError) as error:
        if model is not None:
            model.close()
        return _failed(error, str(error))
    _logger.info("live on REST port %d, gRPC port %d", addresses.rest_port, addresses.grpc_port)
    ended_by = _run(service, model, addresses, ends, settings.linger_s)
    if isinstance(ended_by, Exception):
        return _failed(ended_by, _why(ended_by, model))
    _logger.info("stopped")
    return FAILED if ended_by is None else OK


def load_model(settings: Settings, runtime: Runtime, folder: Path) -> Model:
    """The bundle in `folder`, to compute where the settings say; raises BundleError."""
    if in_processes(settings, runtime.provider):
        return RemoteModel(folder, settings.max_points, settings.log_level)
    from shipshape.serving.prepare import load_local  # noqa: PLC0415  # large: only who computes here pays for it

    return load_local(folder, settings.max_points, runtime)


def _why(error: Exception, model: Model) -> str:
    if isinstance(error, BundleError):
        return str(error)
    return f"expected bundle {model.bundle.name} to answer the built-in contact, got {error!r}"


def _run(
    service: Service, model: Model, addresses: Addresses, ends: "queue.SimpleQueue[End]", linger_s: float
) -> End:
    """Ready, then stopped; what it was ended by. The warm-up has its own thread: a signal must not wait for it."""
    opening = threading.Thread(target=_open, args=(service, model, addresses, ends), name="warm-up", daemon=True)
    opening.start()
    try:
        ended_by = _first(ends)
        if isinstance(ended_by, int) and service.leave() and linger_s > 0:
            _logger.info("not ready, requests are still taken for %g s or until another signal", linger_s)
            _first(ends, linger_s)
        return ended_by
    finally:
        service.stop()
        opening.join(LEAVE_S)


def _first(ends: "queue.SimpleQueue[End]", seconds: float = math.inf) -> End:
    """The first end; None also when there is none in time."""
    end = time.monotonic() + seconds
    # Without the timeout, a signal in the instant before the wait would set its flag and wake nobody.
    while (left := end - time.monotonic()) > 0:
        with suppress(queue.Empty):
            return ends.get(timeout=min(LOOK_S, left))
    return None


def _open(service: Service, model: Model, addresses: Addresses, ends: "queue.SimpleQueue[End]") -> None:
    try:
        service.open(model)
        # Nothing that is there by now will be garbage. Looking through it at each full collection would hold all
        # threads up for tens of milliseconds.
        gc.collect()
        gc.freeze()
        _logger.info("ready: %s, bundle %s (%s)", addresses, model.bundle.name, model.bundle.digest)
    except Cancelled:
        _logger.info("stopped before it was ready")
    except Exception as error:
        _logger.exception("the warm-up failed")
        ends.put(error)


def _failed(error: Exception, sentence: str) -> int:
    sys.stderr.write(f"shipshape: {sentence}\n")
    return UNUSABLE if isinstance(error, BundleError | SettingsError) else FAILED
