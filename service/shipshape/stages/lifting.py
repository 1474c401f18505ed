"""Lifting: an inpainted image back to 3D, each point measured or inferred (the inverse of projection)."""

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from shipshape import kernels, raster
from shipshape.raster import FilledLayers, ImageFrame, Layers
from shipshape.types import Pose, RestoredCloud


def lift_grey(
    before: UInt8[np.ndarray, "rows columns 3"],
    after: UInt8[np.ndarray, "rows columns 3"],
    pose: Pose,
    frame: ImageFrame,
) -> RestoredCloud:
    """One point in the middle of every filled cell of the paper's image; measured where it was filled before."""
    layer, row, column = np.nonzero(after.transpose(2, 0, 1))
    depth = raster.from_grey(after, frame)[layer, row, column]
    points = raster.to_metres(column.astype(np.float32) + 0.5, row.astype(np.float32) + 0.5, depth, frame)
    return RestoredCloud(pose.to_level(points), before[row, column, layer] > 0)


def lift_layers(
    points_level: Float32[np.ndarray, "n 3"],
    layers: Layers,
    filled: FilledLayers,
    pose: Pose,
    frame: ImageFrame,
) -> RestoredCloud:
    """Every measured point as it came, then points on the inferred surface one pixel apart in depth.

    Args:
        points_level: the cluster, level frame, m.
        layers: what was measured.
        filled: what the network says is there.
        pose: the pose of the image.
        frame: its pixel-to-metre transform.
    """
    surface, seen = (filled.top, filled.bottom), (layers.count, layers.top, layers.bottom)
    step = frame.pixel[0] / frame.depth_range
    lifted = kernels.lift_columns(filled.occupied, surface, seen, filled.offset, step)
    inferred = raster.to_metres(lifted[:, 0], lifted[:, 1], lifted[:, 2], frame)
    inferred_level = pose.to_level(inferred)
    flags: Bool[np.ndarray, " m"] = np.zeros(len(points_level) + len(inferred), np.bool_)
    flags[: len(points_level)] = True
    return RestoredCloud(np.concatenate([points_level, inferred_level]), flags)
