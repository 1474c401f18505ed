"""A bundle that is still being trained: the networks that exist so far, and parameters before calibration.

Later networks are trained on what the earlier stages of the service make of the training set; this gives them
the service's own pipeline, stopped where its networks end.
"""

from collections.abc import Sequence
from pathlib import Path

from shipshape.bundle import Bundle, CatalogueVessel
from shipshape.onnx_model import OnnxModel
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Options
from shipshape.work import Work

UNCALIBRATED = {
    "common": {"spd2_radius": 8.0, "prior_temperature": 1.0, "unknown_above": 0.5},
    "paper": {"heading_std": 0.2, "part_keypoints": 8, "part_sharpness": 1.0, "empty_below": 0.1},
    "best": {
        "looks": 2,
        "heading_std_scale": 1.0,
        "bow_weights": [0.5, 0.5],
        "fusion_weights": [0.25, 0.25, 0.25, 0.25],
    },
}


def partial_bundle(folder: Path, catalogue: Sequence[CatalogueVessel], parameters: dict = UNCALIBRATED) -> Bundle:
    """The networks in `folder` as a bundle, whichever exist."""
    models = {path.stem: OnnxModel(path) for path in sorted(folder.glob("*.onnx"))}
    return Bundle("partial", "", tuple(catalogue), models, parameters, {}, {})


def run_until(pipeline: Pipeline, contact: Contact, options: Options, last: str) -> Work:
    """The work of a contact after every stage up to and including `last`."""
    work = pipeline.begin(contact, options)
    for stage in pipeline.stages:
        stage.run(work)
        if stage.name == last:
            break
    return work
