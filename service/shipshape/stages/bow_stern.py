"""Bow or stern: which of the two opposite headings is right, with its probability; 0 and 180 are never averaged.

`by_parts` is the paper's way (section 3.1.2): SPD2 images of keypoints are labelled bow, middle or stern part;
`by_networks` asks the networks that look at the points along the line of sight and at the aligned image.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32

from shipshape.alignment import Look
from shipshape.first_look import FirstLook
from shipshape.onnx_model import OnnxModel
from shipshape.softmax import softmax
from shipshape.types import Pose

PARTS = ("bow", "middle", "stern")  # thirds of the length


def part_votes(
    points_along: Float32[np.ndarray, " k"], probabilities: Float32[np.ndarray, "k 3"], length: float
) -> float:
    """Agreement of labelled parts with where they lie: positive when bow parts lie toward +x.

    score = sum_k (p_bow - p_stern)_k 2 x_k / length, over keypoints at x_k along the assumed heading.
    """
    direction = probabilities[:, 0] - probabilities[:, 2]
    return float(np.sum(direction * points_along) * 2.0 / length)


def by_parts(
    images: Float32[np.ndarray, "k 5 16 32"],
    points_along: Float32[np.ndarray, " k"],
    pose: Pose,
    model: OnnxModel,
    *,
    sharpness: float,
) -> tuple[Pose, float]:
    """Pose with the bow the way the labelled parts point, and the probability of that (paper, section 3.1.2).

    Args:
        images: SPD2 images of the keypoints in the vessel frame of `pose`.
        points_along: x of the same keypoints in that frame, m.
        pose: heading modulo pi.
        model: SPD2 image -> logits of PARTS.
        sharpness: log-odds for a unit of `part_votes`, fitted on validation.
    """
    (logits,) = model.run(images=images)
    votes = part_votes(points_along, softmax(logits), pose.size.length)
    return _settle(pose, flip_logit=-sharpness * votes)


def by_networks(found: Look, first: FirstLook, *, weights: Sequence[float]) -> tuple[Pose, float]:
    """Pose with the bow the way all looks see it, and the calibrated probability of that.

    Args:
        found: the aligned looks.
        first: the look along the line of sight.
        weights: of the log-odds of either, fitted on validation.
    """
    return _settle(found.pose, flip_logit=float(np.dot(weights, [found.flip_logit, first.flip_logit(found.pose)])))


def _settle(pose: Pose, *, flip_logit: float) -> tuple[Pose, float]:
    certainty = 1.0 / (1.0 + math.exp(-min(abs(flip_logit), 30.0)))
    return (pose.turned(math.pi) if flip_logit > 0 else pose), certainty
