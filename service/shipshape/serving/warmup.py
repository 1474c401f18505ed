"""One contact through everything a request can ask for, so that no caller pays for the first time."""

from collections.abc import Callable

from shipshape.errors import Cancelled
from shipshape.sample import sample_contact
from shipshape.serving.core import Model, Render
from shipshape.types import Contact, ImageMethod, Options, Preset, Recognition, Rung


def warm_up(model: Model, render: Render, stopping: Callable[[], bool]) -> None:
    """Run every preset and image method once on the built-in contact.

    Raises:
        Cancelled: `stopping` said so before a stage.
        Exception: Whatever a stage raises.
    """
    contact = sample_contact()
    recognition = _run(model, contact, Options(preset=Preset.BEST), stopping)
    for method in ImageMethod:
        _run(model, contact, Options(preset=Preset.PAPER, image_method=method), stopping)
    render(contact, recognition)


def _run(model: Model, contact: Contact, options: Options, stopping: Callable[[], bool]) -> Recognition:
    work = model.pipeline.begin(contact, options)
    for stage in model.pipeline.stages:
        if stopping():
            raise Cancelled("expected to end the warm-up, got a signal to stop")
        stage.run(work)
    return model.pipeline.finish(work, {}, Rung.FULL, "")
