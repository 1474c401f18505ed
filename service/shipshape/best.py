"""Preset `best`: what measured best; class-free pose, occupancy and height apart, all evidence fused."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32

from shipshape import raster
from shipshape.bundle import Bundle
from shipshape.first_look import first_look
from shipshape.softmax import softmax
from shipshape.stages import bow_stern, classification, heading, inpainting, lifting, projection
from shipshape.work import Work


class BestMethod:
    """The stages as they measured best; no stage needs the class, so a wrong class cannot spoil the pose."""

    def __init__(self, bundle: Bundle) -> None:
        self._models = bundle.models
        self._parameters = bundle.parameters["best"]
        self._longest = max(vessel.box.length for vessel in bundle.catalogue)

    def prior(self, work: Work) -> None:
        """The first look at the points; it also gives the heading its start and the bow a witness."""
        work.first = first_look(work.points_sight, work.sight, self._models["points"])
        work.prior = softmax(work.first.class_logits)

    def heading(self, work: Work) -> None:
        """Looks in the aligned frame, from the coarse pose of the first look on."""
        self._look(work, self._parameters["looks"])

    def heading_in_one_look(self, work: Work) -> None:
        """The same in less time, and a little less exact."""
        self._look(work, 1)

    def _look(self, work: Work, looks: int) -> None:
        work.look = heading.by_network(
            work.contact.points_level, work.first.pose, self._models["aligned"], looks=looks
        )
        work.pose = work.look.pose
        power = self._parameters.get("heading_std_power", 1.0)  # older bundles scale alone
        work.heading_std = self._parameters["heading_std_scale"] * work.look.heading_std**power

    def bow_stern(self, work: Work) -> None:
        """All looks saw the bow; their log-odds are weighted as validation says."""
        work.pose, work.bow_probability = bow_stern.by_networks(
            work.look, work.first, weights=self._parameters["bow_weights"]
        )

    def projection(self, work: Work) -> None:
        """Top view scaled by the vessel's own length, occupancy apart from height."""
        work.frame = raster.aligned_frame(work.pose.size.length)
        work.layers = projection.project(work.contact.points_level, work.pose, work.frame)
        work.before = raster.to_grey(work.layers.count > 0, work.layers.top, work.frame)

    def inpainting(self, work: Work) -> None:
        """The layers of the whole vessel; the bottleneck also names the class."""
        work.filled, work.bottleneck = inpainting.inpaint_layers(
            work.layers, work.pose, len(work.contact.points_level), self._models["inpainting"]
        )
        work.after = raster.to_grey(work.filled.occupied, work.filled.top, work.frame)

    def lifting(self, work: Work) -> None:
        """The measured points and the inferred surface."""
        work.restored = lifting.lift_layers(
            work.contact.points_level, work.layers, work.filled, work.pose, work.frame
        )

    def classification(self, work: Work) -> None:
        """Prior, aligned looks, bottleneck and restored cloud, weighted as validation says."""
        restored = classification.mean_confidence(work.images, self._models["spd2"])
        looks = softmax(np.stack([work.look.class_logits, work.bottleneck]))
        evidence = [work.prior, *looks, restored]
        measured_along = work.points_vessel[: len(work.contact.points_level), 0]  # they come first
        self._conclude(work, evidence, self._parameters["fusion_weights"], measured_along)

    def classify_looks(self, work: Work) -> None:
        """Prior and aligned looks alone, without a restored vessel; they share the weight of all evidence."""
        weights = np.array(self._parameters["fusion_weights"])
        evidence = [work.prior, softmax(work.look.class_logits)]
        shared = weights[:2] * weights.sum() / weights[:2].sum()
        self._conclude(work, evidence, shared.tolist(), work.pose.to_vessel(work.contact.points_level)[:, 0])

    def _conclude(
        self,
        work: Work,
        evidence: Sequence[Float32[np.ndarray, " classes"]],
        weights: Sequence[float],
        measured_along: Float32[np.ndarray, " n"],
    ) -> None:
        fused = classification.fuse(evidence, weights)
        work.probabilities = classification.rule_out_too_long(fused, float(np.ptp(measured_along)), self._longest)
