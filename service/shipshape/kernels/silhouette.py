"""A cloud as the sensor sees it from the side: upright columns of equal angle."""

import numpy as np
from jaxtyping import Bool, Float32, Int32
from numba import njit


@njit(cache=True, nogil=True)
def silhouette(
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
