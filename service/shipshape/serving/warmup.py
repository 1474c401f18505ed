"""One contact through everything a request can ask for, so that no caller pays for the first time."""

from shipshape.sample import sample_contact
from shipshape.serving.core import Model, Render
from shipshape.types import Contact, ImageMethod, Options, Preset, Recognition


def warm_up(model: Model, render: Render) -> None:
    """Run every preset and image method once on the built-in contact; raises whatever they raise."""
    contact = sample_contact()
    recognition = _run(model, contact, Options(preset=Preset.BEST))
    for method in ImageMethod:
        _run(model, contact, Options(preset=Preset.PAPER, image_method=method))
    render(contact, recognition)


def _run(model: Model, contact: Contact, options: Options) -> Recognition:
    work = model.pipeline.begin(contact, options)
    for stage in model.pipeline.stages:
        stage.run(work)
    return model.pipeline.finish(work, {})
