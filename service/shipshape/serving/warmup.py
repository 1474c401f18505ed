"""One contact through everything a request can ask for: no caller pays for the first time, none gets NaN."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from shipshape.errors import BundleError, Cancelled
from shipshape.sample import sample_contact
from shipshape.serving.model import PipelineLike, Render
from shipshape.types import Contact, ImageMethod, Options, Preset, Recognition, Rung


def warm_up(pipeline: PipelineLike, render: Render, stopping: Callable[[], bool]) -> None:
    """Run every preset and image method once on the built-in contact.

    Raises:
        Cancelled: `stopping` said so before a stage.
        BundleError: A number of an answer is not finite.
        Exception: Whatever a stage raises.
    """
    contact = sample_contact()
    recognition = _run(pipeline, contact, Options(preset=Preset.BEST), stopping)
    for method in ImageMethod:
        _run(pipeline, contact, Options(preset=Preset.PAPER, image_method=method), stopping)
    render(contact, recognition)


def _run(pipeline: PipelineLike, contact: Contact, options: Options, stopping: Callable[[], bool]) -> Recognition:
    work = pipeline.begin(contact, options)
    for stage in pipeline.stages:
        if stopping():
            raise Cancelled("expected to end the warm-up, got a signal to stop")
        stage.run(work)
    recognition = pipeline.finish(work, {}, Rung.FULL, "")
    _check_finite(recognition, options)
    return recognition


def _check_finite(found: Recognition, options: Options) -> None:
    numbers: dict[str, ArrayLike] = {
        "probabilities": [*found.probabilities.values()],
        "heading": [found.heading, found.heading_std, found.bow_probability, found.aspect_deg],
        "box": [*found.box.center_level, found.box.size.length, found.box.size.beam, found.box.size.height],
        "restored": found.restored.points_level,
        "keypoints": found.keypoints_level,
    }
    for name, values in numbers.items():
        if not np.isfinite(values).all():
            raise BundleError(
                f"expected finite numbers from the bundle for the built-in contact, got NaN or infinity in {name} "
                f"with preset {options.preset}"
            )
