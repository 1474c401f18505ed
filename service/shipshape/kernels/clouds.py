"""Where a cloud lies, in one pass over its points."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64

from shipshape.kernels.compiled import compiled


class Extent(NamedTuple):
    """Bounds and mean of a cloud along two horizontal axes and z; not finite if any coordinate is not."""

    lower: Float32[np.ndarray, " 3"]
    upper: Float32[np.ndarray, " 3"]
    mean: Float64[np.ndarray, " 3"]


@compiled
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


Place = tuple[float, float, float]


@compiled
def into_frame(points: Float32[np.ndarray, "n 3"], yaw: float, origin: Place) -> Float32[np.ndarray, "n 3"]:
    """The points as seen in a frame with its origin at `origin`, turned about z by `yaw` radians."""
    cos, sin = np.float32(np.cos(yaw)), np.float32(np.sin(yaw))
    x0, y0, z0 = np.float32(origin[0]), np.float32(origin[1]), np.float32(origin[2])
    seen = np.empty(points.shape, np.float32)
    for i in range(len(points)):
        x, y = points[i, 0] - x0, points[i, 1] - y0  # first: far from the origin, digits are few
        seen[i, 0] = x * cos + y * sin
        seen[i, 1] = y * cos - x * sin
        seen[i, 2] = points[i, 2] - z0
    return seen


@compiled
def out_of_frame(points: Float32[np.ndarray, "n 3"], yaw: float, origin: Place) -> Float32[np.ndarray, "n 3"]:
    """The inverse of `into_frame`."""
    cos, sin = np.float32(np.cos(yaw)), np.float32(np.sin(yaw))
    x0, y0, z0 = np.float32(origin[0]), np.float32(origin[1]), np.float32(origin[2])
    placed = np.empty(points.shape, np.float32)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        placed[i, 0] = x * cos - y * sin + x0
        placed[i, 1] = y * cos + x * sin + y0
        placed[i, 2] = points[i, 2] + z0
    return placed
