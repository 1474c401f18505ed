"""What one contact carries from stage to stage; each stage fills in its own fields."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32, UInt8

from shipshape.alignment import Look
from shipshape.first_look import FirstLook
from shipshape.raster import FilledLayers, ImageFrame, Layers
from shipshape.sight import SightFrame
from shipshape.types import Contact, Options, Pose, RestoredCloud


@dataclass(slots=True)
class Work:
    """One contact on its way through the pipeline, in the order in which the stages fill it."""

    contact: Contact
    options: Options
    sight: SightFrame
    points_sight: Float32[np.ndarray, "n 3"]

    first: FirstLook = field(init=False)  # preset best: the look along the line of sight
    prior: Float32[np.ndarray, " classes"] = field(init=False)  # of the raw cluster; the last is "unknown"
    pose: Pose = field(init=False)  # after heading: modulo pi; after bow_stern: settled
    look: Look = field(init=False)  # preset best: the aligned looks
    heading_std: float = field(init=False)  # rad
    bow_probability: float = field(init=False)
    frame: ImageFrame = field(init=False)
    layers: Layers = field(init=False)
    before: UInt8[np.ndarray, "rows columns 3"] = field(init=False)
    after: UInt8[np.ndarray, "rows columns 3"] = field(init=False)
    filled: FilledLayers = field(init=False)  # preset best
    bottleneck: Float32[np.ndarray, " classes"] = field(init=False)  # preset best: class logits
    restored: RestoredCloud = field(init=False)
    points_vessel: Float32[np.ndarray, "m 3"] = field(init=False)  # the restored cloud in the vessel frame
    keypoints_vessel: Float32[np.ndarray, "k 3"] = field(init=False)
    images: Float32[np.ndarray, "k 5 16 32"] = field(init=False)  # SPD2, of the keypoints
    probabilities: Float32[np.ndarray, " classes"] = field(init=False)  # the last is "unknown"

    def leave_unrestored(self) -> None:
        """Take what was measured for all there is: no stage restored anything."""
        points = self.contact.points_level
        self.restored = RestoredCloud(points, np.ones(len(points), np.bool_))
        self.keypoints_vessel = np.empty((0, 3), np.float32)
        self.images = np.empty((0, 5, 16, 32), np.float32)
