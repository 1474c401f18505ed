"""Inpainting: the image of what was measured to the image of the whole vessel, in one pass of a network.

Measured cells are never overwritten.
"""

import math

import numpy as np
from jaxtyping import Float32, UInt8

from shipshape import raster
from shipshape.onnx_model import OnnxModel
from shipshape.raster import FilledLayers, Layers
from shipshape.types import Pose


def inpaint_grey(
    before: UInt8[np.ndarray, "64 64 3"], model: OnnxModel, *, empty_below: float
) -> UInt8[np.ndarray, "64 64 3"]:
    """The paper's grey image completed: 0 stays empty, 1..255 from bottom to top of each layer.

    Args:
        before: B G R image of the cluster.
        model: image in [0, 1], channels first -> the same, completed.
        empty_below: grey shares under this are taken as empty; fitted on validation.
    """
    scaled = before.transpose(2, 0, 1)[None].astype(np.float32) / 255
    (filled,) = model.run(image=scaled)
    grey = np.where(filled[0] < empty_below, 0, np.clip(np.rint(filled[0] * 255), 1, 255))
    return np.where(before > 0, before, grey.transpose(1, 2, 0).astype(np.uint8))


def network_inputs(
    layers: Layers, pose: Pose, points: int
) -> tuple[Float32[np.ndarray, "planes rows columns"], Float32[np.ndarray, " features"]]:
    """Planes of the image and of its port/starboard mirror, and (log length, log range, log points)."""
    planes = raster.to_planes(layers)
    range_m = math.hypot(*pose.origin_level[:2])
    features = [math.log(pose.size.length), math.log(max(range_m, 1.0)), math.log(points)]
    return np.concatenate([planes, planes[:, ::-1]]), np.array(features, np.float32)


def inpaint_layers(
    layers: Layers, pose: Pose, points: int, model: OnnxModel
) -> tuple[FilledLayers, Float32[np.ndarray, " classes"]]:
    """The layers of the whole vessel, and the class logits that the network's bottleneck gives beside them.

    Args:
        layers: aligned image of the cluster, bow to the right.
        pose: pose it was taken in.
        points: how many points the cluster has.
        model: planes, features -> occupancy, top, bottom, offset, classes.
    """
    planes, features = network_inputs(layers, pose, points)
    occupancy, top, bottom, offset, classes = model.run(planes=planes[None], features=features[None])
    measured = layers.count > 0
    # In place: the network's outputs are fresh arrays of ours.
    np.maximum(top[0], layers.top, out=top[0], where=measured)
    np.minimum(bottom[0], layers.bottom, out=bottom[0], where=measured)
    np.copyto(offset[0], layers.offset, where=measured)
    return FilledLayers(measured | (occupancy[0] > 0.5), top[0], bottom[0], offset[0]), classes[0]
