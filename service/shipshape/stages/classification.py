"""Classification: SPD2 images, or logits of several networks, to calibrated probabilities."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32

from shipshape.onnx_model import OnnxModel
from shipshape.softmax import softmax


def mean_confidence(images: Float32[np.ndarray, "k 5 16 32"], model: OnnxModel) -> Float32[np.ndarray, " classes"]:
    """Confidence of each keypoint's SPD2 image, averaged over the keypoints (paper, section 3.3.2)."""
    (logits,) = model.run(images=images)
    confidence: Float32[np.ndarray, " classes"] = softmax(logits).mean(axis=0)
    return confidence


def fuse(
    evidence: Sequence[Float32[np.ndarray, " classes"]], weights: Sequence[float]
) -> Float32[np.ndarray, " classes"]:
    """Log-linear pool p ~ prod_i p_i^w_i of several networks' probabilities; weights fitted on validation."""
    logs = np.log(np.maximum(np.stack(evidence), np.float32(1e-7)))
    return softmax(np.asarray(weights, np.float32) @ logs)


_LONGEST_SISTER = 1.25  # two standard deviations of the length of sister hulls, as the simulator varies them


def rule_out_too_long(
    probabilities: Float32[np.ndarray, " classes"], measured_length: float, longest: float
) -> Float32[np.ndarray, " classes"]:
    """The same, or "unknown" almost for certain when more was measured than any catalogue vessel is long.

    Args:
        probabilities: the last is "unknown".
        measured_length: extent of the measured points along the heading, m.
        longest: length of the longest vessel of the catalogue, m.
    """
    if measured_length <= _LONGEST_SISTER * longest:
        return probabilities
    doubted = probabilities * np.float32(1e-3)
    doubted[-1] = 1.0 - doubted[:-1].sum()
    return doubted
