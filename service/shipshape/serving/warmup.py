"""One synthetic contact through everything a request can ask for, so that no caller pays for the first time."""

import numpy as np
from jaxtyping import Float32

from shipshape.serving.core import Model, Render
from shipshape.types import Contact, ImageMethod, Options, Preset, Recognition

RANGE, LENGTH, BEAM, HEIGHT = 40.0, 10.0, 3.0, 2.0  # metres
SENSOR_HEIGHT = 3.0  # metres


def warm_up(model: Model, render: Render) -> None:
    """Run every preset and image method once; raises whatever they raise."""
    contact = synthetic_contact()
    recognition = _run(model, contact, Options(preset=Preset.BEST))
    for method in ImageMethod:
        _run(model, contact, Options(preset=Preset.PAPER, image_method=method))
    render(contact, recognition)


def synthetic_contact() -> Contact:
    """The near side and the stern of a box hull, 40 m ahead and crossing to port, as a LiDAR would sample them."""
    return Contact(_box_hull(), contact_id="warm-up", sensor_height=SENSOR_HEIGHT)


def _run(model: Model, contact: Contact, options: Options) -> Recognition:
    work = model.pipeline.begin(contact, options)
    for stage in model.pipeline.stages:
        stage.run(work)
    return model.pipeline.finish(work, {})


def _box_hull() -> Float32[np.ndarray, "n 3"]:
    along, up = np.meshgrid(np.linspace(-LENGTH / 2, LENGTH / 2, 60), np.linspace(0, HEIGHT, 8))
    side = np.stack([np.full(along.size, RANGE), along.ravel(), up.ravel() - SENSOR_HEIGHT], axis=1)
    across, up = np.meshgrid(np.linspace(0, BEAM, 18), np.linspace(0, HEIGHT, 8))
    stern = np.stack(
        [RANGE + across.ravel(), np.full(across.size, -LENGTH / 2), up.ravel() - SENSOR_HEIGHT], axis=1
    )
    return np.concatenate([side, stern]).astype(np.float32)
