"""What the process that forks workers does before: bundle -> pipeline -> tried out -> told to the service."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2

from shipshape.bundle import load_bundle
from shipshape.errors import BundleError
from shipshape.executor import Costs, Prepared, Task, rehearse
from shipshape.pipeline import Pipeline
from shipshape.providers import PROCESSOR, Runtime
from shipshape.render import render_png
from shipshape.sample import sample_contact
from shipshape.serving.description import Description
from shipshape.serving.grpc import convert
from shipshape.serving.local_model import LocalModel
from shipshape.serving.oip import results
from shipshape.serving.order_wire import Wire, from_wire
from shipshape.serving.rest import answers
from shipshape.telemetry import configure_logging
from shipshape.types import Options, Preset
from shipshape.validation import ContactLimits

# Of all doors: the first request must not pay for their import.
ENCODERS = (
    answers.encode,
    convert.encode_single,
    convert.encode_in_scan,
    convert.encode_in_stream,
    results.encode,
)


def load_local(folder: Path, max_points: int, runtime: Runtime = PROCESSOR) -> LocalModel:
    """The bundle in `folder` and a pipeline for contacts of at most `max_points`; raises BundleError."""
    cv2.setNumThreads(1)  # the workers are the parallelism; a pool in each of them only adds latency
    bundle = load_bundle(folder, runtime)
    return LocalModel(bundle, Pipeline(bundle, ContactLimits(max_points=max_points)), render_png)


def prepare(loaded: Callable[[], None], folder: Path, digest: str, max_points: int, log_level: str) -> Prepared:
    """Load a bundle and try it out.

    Args:
        loaded: Called when the bundle is read and verified.
        folder: Of the bundle.
        digest: That it must have: it may have been changed since the service looked.
        max_points: Of one contact.
        log_level: As in the settings.

    Raises:
        BundleError: It cannot be used.
        Exception: Whatever a stage raises.
    """
    configure_logging(log_level)
    model = load_local(folder, max_points)
    if model.bundle.digest != digest:
        raise BundleError(f"expected the bundle {digest}, got {model.bundle.digest}: it was changed meanwhile")
    loaded()
    costs = Costs()
    model.try_out(lambda task: rehearse(task, costs, time.monotonic), lambda: False, ENCODERS)

    def make(order: Wire, deadline: float) -> Task[Any, Any]:
        """What the service ordered."""
        return model.task(from_wire(order), deadline)

    return Prepared(_describe(model, costs), make, costs)


def _describe(model: LocalModel, costs: Costs) -> Description:
    size = len(sample_contact().points_level)
    ladders = [(preset, rung) for preset in Preset for rung in model.pipeline.ladder(Options(preset=preset))]
    return Description(
        tuple(stage.name for stage in model.pipeline.stages),
        tuple((preset, rung.name, sum(costs.each([*rung.stages, rung], size))) for preset, rung in ladders),
        size,
    )
