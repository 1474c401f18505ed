"""Mirrored cloud + SPD2: the symmetry of vessels in place of learned restoration.

The cluster and its mirror image about the vessel's centre plane, in the pose that preset `best` estimates, go
through the same keypoints, SPD2 images and network as everything else here that is classified by SPD2.
"""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from shipshape.bundle import CatalogueVessel
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Options, Preset
from shipshape_lab.training.examples import Example
from shipshape_lab.training.partial import partial_bundle
from shipshape_lab.training.train_spd2 import Described, describe_densest

POSE_NETWORKS = ("points.onnx", "aligned.onnx")
_POSE_STAGES = ("prior", "heading", "bow_stern")
_TO_OTHER_SIDE = np.array([1.0, -1.0, 1.0], np.float32)


def keep_pose_networks(bundle: Path, folder: Path) -> None:
    """Copy the networks that estimate the pose, so that the peer goes on with those it was trained with."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in POSE_NETWORKS:
        shutil.copyfile(bundle / name, folder / name)


def pose_pipeline(folder: Path, catalogue: Sequence[CatalogueVessel]) -> Pipeline:
    """The service's stages as far as the pose, with the networks kept in `folder`."""
    return Pipeline(partial_bundle(folder, catalogue))


def mirrored_cloud(pipeline: Pipeline, contact: Contact) -> np.ndarray:
    """The cluster and its mirror image, (2n, 3) metres, vessel frame as estimated.

    Raises:
        InvalidInput: the contact cannot be one vessel's cluster.
    """
    work = pipeline.begin(contact, Options(Preset.BEST))
    for stage in pipeline.stages:
        if stage.name in _POSE_STAGES:
            stage.run(work)
    points = work.pose.to_vessel(contact.points_level)
    return np.concatenate([points, points * _TO_OTHER_SIDE])


def describe_with(pipeline: Pipeline) -> Callable[[Example, np.random.Generator], Described]:
    """How training describes an example: SPD2 images of its mirrored cloud, none if it is refused."""

    def describe(example: Example, rng: np.random.Generator) -> Described:
        try:
            cloud = mirrored_cloud(pipeline, example.contact)
        except InvalidInput:
            return np.empty((0, 5, 16, 32), np.float32), np.empty(0, np.int64)
        _, images = describe_densest(cloud)
        return images, np.full(len(images), example.label)

    return describe
