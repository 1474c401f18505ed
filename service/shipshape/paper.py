"""Preset `paper`: the paper's method to the letter wherever its text defines it."""

import numpy as np

from shipshape import raster
from shipshape.bundle import Bundle
from shipshape.stages import (
    bow_stern,
    classification,
    heading,
    inpainting,
    keypoints,
    lifting,
    prior,
    projection,
    spd2,
)
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import RestoredCloud
from shipshape.work import Work


class PaperMethod:
    """The stages as the paper does them; the class comes first, everything else leans on its reference box."""

    def __init__(self, bundle: Bundle) -> None:
        self._models = bundle.models
        self._boxes = [vessel.box for vessel in bundle.catalogue]
        self._longest = max(box.length for box in self._boxes)
        self._parameters = bundle.parameters["paper"]
        self._spd2_radius = bundle.parameters["common"]["spd2_radius"]
        self._prior_temperature = bundle.parameters["common"]["prior_temperature"]

    def prior(self, work: Work) -> None:
        """Mean confidence of the SPD2 images of the densest points, in the sight frame."""
        densest = keypoints.select_keypoints(work.points_sight, KeypointParams())
        images = spd2.describe(work.points_sight, densest, self._spd2_radius)
        work.prior = prior.estimate_prior(images, self._models["prior"], temperature=self._prior_temperature)

    def heading(self, work: Work) -> None:
        """Best IoU with the reference box of the prior's class, laid against the visible faces."""
        box = self._boxes[int(np.argmax(work.prior[: len(self._boxes)]))]
        points = work.contact.points_level
        axis = heading.by_area_projection(points, box)
        work.pose = heading.anchor_box(points, axis, box, work.sight.origin_level[2])
        work.heading_std = self._parameters["heading_std"]

    def bow_stern(self, work: Work) -> None:
        """Part labels of the SPD2 images of the densest points."""
        points = work.pose.to_vessel(work.contact.points_level)
        parts = keypoints.select_keypoints(points, KeypointParams(limit=self._parameters["part_keypoints"]))
        images = spd2.describe(points, parts, self._spd2_radius)
        work.pose, work.bow_probability = bow_stern.by_parts(
            images,
            parts[:, 0],
            work.pose,
            self._models["parts"],
            sharpness=self._parameters["part_sharpness"],
        )

    def projection(self, work: Work) -> None:
        """One of the four image methods, scaled by the reference box."""
        work.frame = projection.paper_frame(work.options.image_method, work.pose.size, self._longest)
        work.layers = projection.project(work.contact.points_level, work.pose, work.frame)
        work.before = raster.to_grey(work.layers.count > 0, work.layers.top, work.frame)

    def inpainting(self, work: Work) -> None:
        """Grey image to grey image by the network of that image method."""
        method = work.options.image_method
        work.after = inpainting.inpaint_grey(
            work.before, self._models[f"inpainting_{method}"], empty_below=self._parameters["empty_below"]
        )

    def lifting(self, work: Work) -> None:
        """Every filled pixel becomes a point; a cluster that fell outside the image stays as it came."""
        work.restored = lifting.lift_grey(work.before, work.after, work.pose, work.frame)
        if not len(work.restored.measured):
            points = work.contact.points_level
            work.restored = RestoredCloud(points, np.ones(len(points), np.bool_))

    def classification(self, work: Work) -> None:
        """Mean confidence of the three densest keypoints; the paper knows no "unknown"."""
        confidence = classification.mean_confidence(work.images, self._models[f"spd2_{work.options.image_method}"])
        work.probabilities = np.append(confidence, np.float32(0.0))
