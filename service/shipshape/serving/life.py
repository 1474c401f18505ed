"""The process: bundle -> pipeline -> service -> wait for a signal -> stop. The only place that joins them all."""

import logging
import queue
import signal
import sys

from shipshape.bundle import load_bundle
from shipshape.errors import BundleError
from shipshape.pipeline import Pipeline
from shipshape.render import render_png
from shipshape.serving.core import Model
from shipshape.serving.service import Service
from shipshape.settings import Settings
from shipshape.telemetry import configure_logging
from shipshape.validation import ContactLimits

_logger = logging.getLogger(__name__)
DIED = 0  # in place of a signal's number


def serve(settings: Settings) -> int:
    """Serve until SIGTERM or SIGINT.

    Returns:
        The exit code: 0 after an orderly stop, 1 when the start failed or a door died. A failed start says why
        in one sentence on stderr.
    """
    configure_logging(settings.log_level)
    # Put of a SimpleQueue may interrupt its own get, which an Event's set may not: it is safe in a handler.
    ends: queue.SimpleQueue[int] = queue.SimpleQueue()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, frame: ends.put(received))
    try:
        bundle = load_bundle(settings.bundle)
        model = Model(bundle, Pipeline(bundle, ContactLimits(max_points=settings.max_points)))
        service = Service(settings, render_png, on_death=lambda: ends.put(DIED))
        addresses = service.start()
    except (BundleError, OSError) as error:
        return _failed(str(error))
    _logger.info("live on REST port %d, gRPC port %d", addresses.rest_port, addresses.grpc_port)
    try:
        service.open(model)
        _logger.info("ready: %s, bundle %s (%s)", addresses, bundle.name, bundle.digest)
        ended_by = ends.get()
    except Exception as error:
        _logger.exception("the warm-up failed")
        return _failed(f"expected bundle {bundle.name} to answer the built-in contact, got {error!r}")
    finally:
        service.stop()
    _logger.info("stopped")
    return 1 if ended_by == DIED else 0


def _failed(sentence: str) -> int:
    sys.stderr.write(f"shipshape: {sentence}\n")
    return 1
