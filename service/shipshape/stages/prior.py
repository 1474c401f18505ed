"""Prior: class probabilities of the raw cluster, before its heading is known (paper, section 3.1).

The SPD2 images are taken in the sight frame. The prior gives the reference box that the paper's heading search
needs. Preset `best` takes its prior from the first look at the points instead (`shipshape.first_look`).
"""

import numpy as np
from jaxtyping import Float32

from shipshape.onnx_model import OnnxModel
from shipshape.softmax import softmax


def estimate_prior(
    images: Float32[np.ndarray, "k 5 16 32"], model: OnnxModel, *, temperature: float
) -> Float32[np.ndarray, " classes"]:
    """Mean calibrated confidence over the keypoints' SPD2 images; the last class is "unknown"."""
    (logits,) = model.run(images=images)
    confidence: Float32[np.ndarray, " classes"] = softmax(logits / np.float32(temperature)).mean(axis=0)
    return confidence
