"""Heading modulo pi: which way the vessel's long axis lies, before bow and stern are told apart.

`by_area_projection` is the paper's search (section 3.1.1); `by_network` needs no class: one look along the line
of sight for a coarse pose, then looks in the aligned frame that correct it.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32

from shipshape import frames, raster
from shipshape.alignment import Look, look
from shipshape.onnx_model import OnnxModel
from shipshape.sight import SightFrame
from shipshape.types import Pose, ReferenceBox

_STEP_DEG = 0.6  # paper, section 3.1.1
_ANGLES = np.radians(np.arange(0.0, 180.0, _STEP_DEG))
_AXES = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)]).astype(np.float32)


def by_area_projection(points_level: Float32[np.ndarray, "n 3"], box: ReferenceBox) -> float:
    """The heading whose min/max box has the best centred IoU with the reference box (paper, section 3.1.1).

    Args:
        points_level: (n, 3), level frame, m.
        box: length along the heading, beam across.

    Returns:
        Heading modulo pi, radians in (-pi/2, pi/2]; 300 candidates 0.6 degrees apart.
    """
    hull = cv2.convexHull(np.ascontiguousarray(points_level[:, :2]))[:, 0]
    along = np.ptp(hull @ _AXES, axis=0)
    across = np.ptp(hull @ np.stack([-_AXES[1], _AXES[0]]), axis=0)
    overlap = np.minimum(along, box.length) * np.minimum(across, box.beam)
    iou = overlap / (along * across + box.length * box.beam - overlap)
    return frames.wrap_half_turn(float(_ANGLES[np.argmax(iou)]))


def anchor_box(
    points_level: Float32[np.ndarray, "n 3"], heading: float, box: ReferenceBox, waterline: float
) -> Pose:
    """The reference box laid against the faces that the sensor sees; a cluster longer than it is centred.

    Only one side of a vessel is measured, so the middle of the cluster is not the middle of the vessel: along
    each axis the box starts at the face nearer to the sensor and reaches behind it.

    Args:
        points_level: (n, 3), level frame, m.
        heading: radians, bow and stern may be swapped.
        box: the size to lay there.
        waterline: z of the water in the level frame, m.
    """
    rotation = frames.R_level_vessel(heading)
    points = points_level[:, :2].astype(np.float64) @ rotation
    lower, upper = points.min(axis=0), points.max(axis=0)
    size = np.array([box.length, box.beam])
    toward_sensor = np.sign(-(lower + upper))
    hidden = np.maximum(size - (upper - lower), 0.0)
    middle = rotation @ ((lower + upper) / 2 - toward_sensor * hidden / 2)
    return Pose(heading, (float(middle[0]), float(middle[1]), waterline), box)


_SIGHT_PIXELS = 64
_HEIGHT_UNIT = 10.0  # m; keeps heights of vessels near 1 for the network


@dataclass(frozen=True, slots=True)
class SightImage:
    """What the sight network sees: the cluster from above, scaled to its own extent."""

    planes: Float32[np.ndarray, "3 rows columns"]  # log count, top and bottom in units of 10 m
    features: Float32[np.ndarray, " 4"]  # log half extent, log range, log points, whether the water is known
    half_extent: float  # m


def sight_image(points_sight: Float32[np.ndarray, "n 3"], sight: SightFrame) -> SightImage:
    """The sight network's inputs for points in the sight frame."""
    half = 1.05 * max(float(np.abs(points_sight[:, :2]).max()), 0.5)
    frame = raster.ImageFrame(
        axes=(0, 1, 2),
        lower=(-half, -half, 0.0),
        upper=(half, half, _HEIGHT_UNIT),
        shape=(_SIGHT_PIXELS, _SIGHT_PIXELS),
        edges=(0.0, 1.0),
    )
    layers = raster.rasterise(points_sight, frame)
    planes = np.concatenate([np.log1p(layers.count).astype(np.float32) / 3, layers.top, layers.bottom])
    features = [math.log(half), math.log(max(sight.range_m, 1.0)), math.log(len(points_sight))]
    return SightImage(planes, np.array([*features, sight.knows_water], np.float32), half)


def first_pose(points_sight: Float32[np.ndarray, "n 3"], sight: SightFrame, model: OnnxModel) -> Pose:
    """A coarse pose from the look along the line of sight; its bow may point either way."""
    seen = sight_image(points_sight, sight)
    axis, shift, size = model.run(planes=seen.planes[None], features=seen.features[None])
    heading = 0.5 * math.atan2(float(axis[0, 0]), float(axis[0, 1]))
    step = frames.R_level_vessel(sight.bearing) @ (shift[0].astype(np.float64) * seen.half_extent)
    x, y, z = sight.origin_level
    length, beam, height = (float(side) for side in np.exp(size[0]))
    return Pose(
        frames.wrap_angle(sight.bearing + heading),
        (x + float(step[0]), y + float(step[1]), z),
        ReferenceBox(length, beam, height),
    )


def by_network(points_level: Float32[np.ndarray, "n 3"], pose: Pose, model: OnnxModel, *, looks: int) -> Look:
    """Correct a coarse pose by `looks` looks in the aligned frame, each from where the last one led.

    Every look but the first takes the bow for the stern of the one before: it sees another image of the same
    cluster, so that the mean of what they say of bow and class is better than each alone.
    """
    found = [look(points_level, pose, model)]
    for _ in range(looks - 1):
        found.append(look(points_level, found[-1].pose.turned(math.pi), model))
    last = found[-1]
    directions = (-1.0) ** np.arange(looks - 1, -1, -1)
    class_logits: Float32[np.ndarray, " classes"] = np.stack([one.class_logits for one in found]).mean(axis=0)
    return Look(
        pose=last.pose,
        heading_std=last.heading_std,
        flip_logit=float(np.mean(directions * [one.flip_logit for one in found])),
        class_logits=class_logits,
    )
