"""A network's look at the cluster in a roughly aligned vessel frame.

`look` sees an image of it and says what to correct: each call turns, shifts and rescales the pose, so that the
next one sees the vessel better aligned. It also says where the bow is and which vessel it might be.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape import frames, raster
from shipshape.onnx_model import OnnxModel
from shipshape.types import Pose, ReferenceBox


@dataclass(frozen=True, slots=True)
class Look:
    """What one look found, relative to the pose it was taken in."""

    pose: Pose  # corrected; its bow still points as in the pose given
    heading_std: float  # rad
    flip_logit: float  # log-odds that the bow points the opposite way
    class_logits: Float32[np.ndarray, " classes"]


def look_inputs(
    points_level: Float32[np.ndarray, "n 3"], pose: Pose
) -> tuple[Float32[np.ndarray, "planes rows columns"], Float32[np.ndarray, " features"]]:
    """The network's inputs: planes of the aligned image, and (log length, log range, log points)."""
    points = pose.to_vessel(points_level)
    layers = raster.rasterise(points, raster.aligned_frame(pose.size.length))
    range_m = math.hypot(*pose.origin_level[:2])
    features = [math.log(pose.size.length), math.log(max(range_m, 1.0)), math.log(len(points))]
    return raster.to_planes(layers), np.array(features, np.float32)


def look(points_level: Float32[np.ndarray, "n 3"], pose: Pose, model: OnnxModel) -> Look:
    """Take one look at the cluster in the frame of `pose` (heading in either direction)."""
    planes, features = look_inputs(points_level, pose)
    turn, flip, shift, size, classes = model.run(planes=planes[None], features=features[None])
    return Look(
        pose=correct(pose, turn=float(turn[0, 0]), shift=shift[0], size=size[0]),
        heading_std=math.exp(float(turn[0, 1])),
        flip_logit=float(flip[0, 0]),
        class_logits=classes[0],
    )


def correct(pose: Pose, *, turn: float, shift: Float32[np.ndarray, " 3"], size: Float32[np.ndarray, " 3"]) -> Pose:
    """The pose turned by `turn` radians and shifted, both in its own frame; shift and size as length shares.

    `size` holds log(length / pose length), log(beam / pose length) and log(height / pose length).
    """
    length, (ahead, aside, up) = pose.size.length, shift.tolist()
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    x, y, z = pose.origin_level
    origin = (
        x + (ahead * cos - aside * sin) * length,
        y + (ahead * sin + aside * cos) * length,
        z + up * length,
    )
    new_length, beam, height = (length * math.exp(side) for side in size.tolist())
    return Pose(frames.wrap_angle(pose.heading + turn), origin, ReferenceBox(new_length, beam, height))
