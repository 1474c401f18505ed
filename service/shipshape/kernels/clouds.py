"""Where a cloud lies, in one pass over its points."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64
from numba import njit


class Extent(NamedTuple):
    """Bounds and mean of a cloud along two horizontal axes and z; not finite if any coordinate is not."""

    lower: Float32[np.ndarray, " 3"]
    upper: Float32[np.ndarray, " 3"]
    mean: Float64[np.ndarray, " 3"]


@njit(cache=True, nogil=True)
def extent(points: Float32[np.ndarray, "n 3"], bearing: float) -> Extent:
    """Extent along the horizontal axis at `bearing` (radians from +x), across it to the left, and along z."""
    cos, sin = np.float32(np.cos(bearing)), np.float32(np.sin(bearing))
    lower = np.full(3, np.inf, np.float32)
    upper = np.full(3, -np.inf, np.float32)
    total = np.zeros(3)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for axis, value in enumerate((x * cos + y * sin, y * cos - x * sin, z)):
            lower[axis] = min(lower[axis], value)
            upper[axis] = max(upper[axis], value)
            total[axis] += value
    return Extent(lower, upper, total / len(points))
