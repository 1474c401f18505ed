"""Classification: SPD2 images, or logits of several networks, to calibrated probabilities."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32

from shipshape.onnx_model import OnnxModel


def softmax(logits: Float32[np.ndarray, "... classes"]) -> Float32[np.ndarray, "... classes"]:
    """Probabilities along the last axis."""
    weights = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return weights / weights.sum(axis=-1, keepdims=True)


def mean_confidence(
    images: Float32[np.ndarray, "k 5 16 32"], model: OnnxModel, temperature: float = 1.0
) -> Float32[np.ndarray, " classes"]:
    """Confidence of each keypoint's SPD2 image, averaged over the keypoints (paper, section 3.3.2)."""
    (logits,) = model.run(images=images)
    return softmax(logits / np.float32(temperature)).mean(axis=0)


def fuse(
    evidence: Sequence[Float32[np.ndarray, " classes"]], weights: Sequence[float]
) -> Float32[np.ndarray, " classes"]:
    """Log-linear pool p ~ prod_i p_i^w_i of several networks' probabilities; weights fitted on validation."""
    logs = [np.float32(w) * np.log(np.maximum(p, 1e-7)) for p, w in zip(evidence, weights, strict=True)]
    return softmax(np.sum(logs, axis=0, dtype=np.float32))
