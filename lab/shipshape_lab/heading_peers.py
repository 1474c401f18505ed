"""Headings that need neither a class nor training: what a user would take instead of this product.

Each lays a rectangle or an axis through the cluster seen from above and calls the longer side the vessel's axis.
An end-on view shows only the width of the vessel, so it can be taken for the length: the answer is then 90 degrees
off. None of them tells bow from stern.
"""

import math

import cv2
import numpy as np

from shipshape import frames

STEP_DEG = 0.6  # as the paper's search, so that all searches are equally fine
CLOSEST = 0.1  # m; of 0.01, 0.03, 0.1 and 0.3 the smallest median error on validation
_ANGLES = np.radians(np.arange(0.0, 90.0, STEP_DEG))
_AXES = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)]).astype(np.float32)
_ACROSS = np.stack([-_AXES[1], _AXES[0]])


def by_min_area(points_level: np.ndarray) -> float:
    """The longer side of the rectangle of least area around the cluster.

    Args:
        points_level: (n, 3) float32, level frame, m.

    Returns:
        Heading modulo pi, radians in (-pi/2, pi/2].
    """
    corners = cv2.boxPoints(cv2.minAreaRect(np.ascontiguousarray(points_level[:, :2])))
    sides = corners[1:3] - corners[:2]
    x, y = sides[np.argmax(np.linalg.norm(sides, axis=1))]
    return frames.wrap_half_turn(math.atan2(y, x))


def by_principal_axis(points_level: np.ndarray) -> float:
    """The direction of greatest variance (PCA); arguments and result as in `by_min_area`."""
    _, vectors = np.linalg.eigh(np.cov(points_level[:, :2], rowvar=False))
    x, y = vectors[:, -1]
    return frames.wrap_half_turn(math.atan2(y, x))


def by_l_shape(points_level: np.ndarray, closest: float = CLOSEST) -> float:
    """The longer side of the rectangle whose two visible edges the points lie closest to.

    Zhang et al., "Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners", IEEE IV 2017, closeness
    criterion: sum over points of 1 / max(d, closest), d the distance to the nearer of the two edges.

    Args:
        points_level: (n, 3) float32, level frame, m.
        closest: distances below it count as this, m; else one point on an edge would outweigh all others.

    Returns:
        Heading modulo pi, radians in (-pi/2, pi/2]; candidates are STEP_DEG apart.
    """
    # From the middle: float32 holds millimetres there, but not at the end of a long line of sight.
    points = points_level[:, :2] - points_level[:, :2].mean(axis=0)
    along, across = points @ _AXES, points @ _ACROSS
    distance = np.minimum(_to_edge(along), _to_edge(across))
    best = np.argmax((1.0 / np.maximum(distance, closest)).sum(axis=0))
    turned = 0.0 if np.ptp(along[:, best]) >= np.ptp(across[:, best]) else math.pi / 2
    return frames.wrap_half_turn(float(_ANGLES[best]) + turned)


def _to_edge(positions: np.ndarray) -> np.ndarray:
    """Distances (n, angles) to the end of the positions that the points as a whole are nearer to."""
    from_low, to_high = positions - positions.min(axis=0), positions.max(axis=0) - positions
    return np.where((from_low**2).sum(axis=0) <= (to_high**2).sum(axis=0), from_low, to_high)
