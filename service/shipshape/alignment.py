"""Two networks' looks at the cluster in a roughly aligned vessel frame.

`look` sees an image of it and says what to correct: each call turns, shifts and rescales the pose, so that the
next one sees the vessel better aligned. `look_at_points` sees the points themselves, metric and unrounded. Both
say where the bow is and which vessel it might be.
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
    length = pose.size.length
    step = frames.R_level_vessel(pose.heading) @ (shift[:2].astype(np.float64) * length)
    x, y, z = pose.origin_level
    origin = (x + float(step[0]), y + float(step[1]), z + float(shift[2]) * length)
    new_length, beam, height = (float(side) for side in length * np.exp(size))
    return Pose(frames.wrap_angle(pose.heading + turn), origin, ReferenceBox(new_length, beam, height))


_MOST_POINTS = 256  # more add nothing that the network can use, and time
_METRES = 10.0  # brings metres near 1


def point_inputs(
    points_level: Float32[np.ndarray, "n 3"], pose: Pose
) -> tuple[Float32[np.ndarray, "6 1 k"], Float32[np.ndarray, " features"]]:
    """The inputs of the network that sees points: an even share of them in the vessel frame, k <= 256.

    Each point comes in units of 10 m and of the vessel's length; the features are the logarithms of length, beam,
    height, range and number of points.
    """
    chosen = points_level[:: -(-len(points_level) // _MOST_POINTS)]
    points = pose.to_vessel(chosen).T
    planes = np.concatenate([points / np.float32(_METRES), points / np.float32(pose.size.length)])
    range_m = math.hypot(*pose.origin_level[:2])
    size = pose.size
    features = np.log([size.length, size.beam, size.height, max(range_m, 1.0), len(points_level)])
    return np.ascontiguousarray(planes[:, None, :]), features.astype(np.float32)


@dataclass(frozen=True, slots=True)
class PointsLook:
    """What the points themselves say, relative to the pose they were seen in."""

    flip_logit: float  # log-odds that the bow points the opposite way
    class_logits: Float32[np.ndarray, " classes"]


def look_at_points(points_level: Float32[np.ndarray, "n 3"], pose: Pose, model: OnnxModel) -> PointsLook:
    """Show the network the points in the frame of `pose`."""
    points, features = point_inputs(points_level, pose)
    flip, classes = model.run(points=points[None], features=features[None])
    return PointsLook(float(flip[0, 0]), classes[0])
