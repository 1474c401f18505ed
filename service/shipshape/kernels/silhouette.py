"""A cloud as the sensor sees it from the side, in upright columns of equal angle, and what is missing of it."""

import numpy as np
from jaxtyping import Bool, Float32, Int32

from shipshape.kernels.compiled import compiled

_LEAST_HEIGHT = 0.01  # m, of a column that holds anything


@compiled
def _silhouette(
    points: Float32[np.ndarray, "n 3"],
    marked: Bool[np.ndarray, " n"],
    bearing: float,
    count: int,
) -> tuple[Float32[np.ndarray, " columns"], Int32[np.ndarray, " columns"]]:
    """Highest z of each column (-inf where it is empty), and how many of its points are marked.

    Args:
        points: level frame, m, at least one.
        marked: which points to count.
        bearing: of the line of sight, radians; the columns share the angles about it from right to left evenly.
        count: how many columns.
    """
    cos, sin = np.float32(np.cos(bearing)), np.float32(np.sin(bearing))
    angles = np.empty(len(points), np.float32)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        angles[i] = np.arctan2(y * cos - x * sin, x * cos + y * sin)
    right, share = angles.min(), max(angles.max() - angles.min(), np.float32(1e-6))
    top = np.full(count, -np.inf, np.float32)
    found = np.zeros(count, np.int32)
    for i in range(len(points)):
        column = min(int((angles[i] - right) / share * count), count - 1)
        top[column] = max(top[column], points[i, 2])
        found[column] += marked[i]
    return top, found


@compiled
def missing_share(
    points: Float32[np.ndarray, "n 3"],
    measured: Bool[np.ndarray, " n"],
    bearing: float,
    waterline: float,
    count: int,
) -> float:
    """What the columns lack to the median density of those that were measured, weighted by their heights; 0 to 1.

    Args:
        points: Level frame, m, at least one.
        measured: Which of them were.
        bearing: Of the line of sight, radians; the columns share the angles about it from right to left evenly.
        waterline: z of the water, m.
        count: How many columns.
    """
    top, found = _silhouette(points, measured, bearing, count)
    height = np.zeros(count)
    density = np.zeros(count)
    for column in range(count):
        if top[column] > -np.inf:
            height[column] = max(top[column] - waterline, _LEAST_HEIGHT)
            density[column] = found[column] / height[column]
    known = np.sort(density[found > 0])
    if len(known) == 0:
        return 1.0
    usual = (known[(len(known) - 1) // 2] + known[len(known) // 2]) / 2.0
    lack = 0.0
    for column in range(count):
        lack += max(1.0 - density[column] / usual, 0.0) * height[column]
    return lack / float(height.sum())
