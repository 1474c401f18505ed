"""Heading modulo pi: which way the vessel's long axis lies, before bow and stern are told apart.

`by_area_projection` is the paper's search (section 3.1.1); `by_network` needs no class: looks in the aligned frame
correct the coarse pose of the first look along the line of sight.
"""

import math

import cv2
import numpy as np
from jaxtyping import Float32

from shipshape import frames
from shipshape.alignment import Look, look
from shipshape.onnx_model import OnnxModel
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


def by_network(points_level: Float32[np.ndarray, "n 3"], pose: Pose, model: OnnxModel, *, looks: int) -> Look:
    """Correct a coarse pose by `looks` looks in the aligned frame, each from where the last one led.

    Every look but the first takes the bow for the stern of the one before: it sees another image of the same
    cluster, so that the mean of what they say of bow and class is better than each alone.
    """
    found = [look(points_level, pose, model)]
    for _ in range(looks - 1):
        found.append(look(points_level, found[-1].pose.turned(math.pi), model))
    last = found[-1]
    flip_logits = (one.flip_logit * (-1.0) ** k for k, one in enumerate(reversed(found)))
    class_logits: Float32[np.ndarray, " classes"] = np.mean([one.class_logits for one in found], axis=0)
    return Look(last.pose, last.heading_std, sum(flip_logits) / looks, class_logits)
