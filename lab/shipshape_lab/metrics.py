"""How good a restored cloud and an estimated heading are, as the literature counts it.

d is the distance of a point to its nearest neighbour in the other cloud (Euclidean, not squared), P the
prediction, G the complete surface. Clouds are normalised first: one scale for both, so that the **complete**
surface's largest extent is 1 (never the partial cloud's: its scale would leak the answer). Definitions as in
PoinTr and PCN; their data lie in about [-0.5, 0.5], which is the same scale. Sets scaled to [-1, 1], such as
ShapeNet-55, give twice the CD-L1, four times the CD-L2 and a far stricter F-score.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

F_THRESHOLD = 0.01  # "F-score@1%": absolute, after normalisation
REPORTED_FACTOR = 1000.0  # tables show Chamfer distances times this


@dataclass(frozen=True)
class Nearest:
    """Distances to the nearest neighbour, both ways, in normalised units.

    Attributes:
        to_surface: of each predicted point to the complete surface, shape (n,).
        to_prediction: of each point of the complete surface to the prediction, shape (m,).
    """

    to_surface: np.ndarray
    to_prediction: np.ndarray


class CompleteSurface:
    """The truth that predictions are held to; its search tree is built once for all of them.

    Args:
        points: complete surface, any frame, metres, shape (m, 3).
        extent: its largest extent, metres: the length that becomes 1.
    """

    def __init__(self, points: np.ndarray, extent: float) -> None:
        self._points, self._extent = points / extent, extent
        self._tree = cKDTree(self._points)

    def nearest(self, prediction: np.ndarray) -> Nearest:
        """Nearest neighbours between a predicted cloud (n, 3), same frame and unit, and this surface.

        Raises:
            ValueError: the prediction is empty; no distance is defined then.
        """
        if len(prediction) == 0:
            raise ValueError("expected at least 1 predicted point, got 0")
        scaled = prediction / self._extent
        return Nearest(self._tree.query(scaled)[0], cKDTree(scaled).query(self._points)[0])


def chamfer_l1(nearest: Nearest) -> float:
    """CD-L1 = (mean_P d + mean_G d) / 2: un-squared, halved; normalised so that the complete extent is 1."""
    return float((nearest.to_surface.mean() + nearest.to_prediction.mean()) / 2)


def chamfer_l2(nearest: Nearest) -> float:
    """CD-L2 = mean_P d^2 + mean_G d^2: a sum, not halved; normalised so that the complete extent is 1."""
    return float(np.mean(nearest.to_surface**2) + np.mean(nearest.to_prediction**2))


def f_score(nearest: Nearest, threshold: float = F_THRESHOLD) -> float:
    """Harmonic mean of the shares with d < threshold (precision over P, recall over G), in [0, 1].

    The threshold is absolute after normalisation: 0.01 is 1 % of the complete surface's largest extent.
    """
    precision = float(np.mean(nearest.to_surface < threshold))
    recall = float(np.mean(nearest.to_prediction < threshold))
    return 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0


def heading_error_deg(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """|estimated - true| modulo pi, radians in, degrees in [0, 90] out: bow and stern count as the same."""
    turned = np.remainder(np.asarray(estimated) - np.asarray(true), np.pi)
    return np.degrees(np.minimum(turned, np.pi - turned))


def bow_right(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Whether the bow points less than 90 degrees off; radians in, false where the estimate is not a number."""
    return np.cos(np.asarray(estimated) - np.asarray(true)) > 0.0


def calibration_error(confidence: np.ndarray, right: np.ndarray, bins: int = 15) -> float:
    """Expected calibration error: sum over equal bins of confidence of |share right - mean confidence| n_b / n.

    Args:
        confidence: probability of the answer given, in [0, 1], shape (n,).
        right: whether that answer was right, shape (n,).
        bins: how many bins of equal width.
    """
    place = np.minimum((confidence * bins).astype(int), bins - 1)
    gaps = np.bincount(place, weights=right.astype(float) - confidence, minlength=bins)
    return float(np.abs(gaps).sum() / len(confidence))
