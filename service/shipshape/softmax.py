"""Logits to probabilities."""

import numpy as np
from jaxtyping import Float32


def softmax(logits: Float32[np.ndarray, "... classes"]) -> Float32[np.ndarray, "... classes"]:
    """Probabilities along the last axis: p_i = exp(z_i) / sum_j exp(z_j)."""
    weights: Float32[np.ndarray, "... classes"] = np.exp(logits - logits.max(axis=-1, keepdims=True))
    weights /= weights.sum(axis=-1, keepdims=True)
    return weights
