"""Points that stand for a cloud, and the neighbours of each."""

import numpy as np
from jaxtyping import Float32, Int64

from shipshape.kernels.compiled import compiled


@compiled
def farthest_points(points: Float32[np.ndarray, "n 3"], most: int) -> Int64[np.ndarray, " c"]:
    """Farthest point sampling: each index is of the point farthest from all that were taken before it.

    The first is point 0. All points are taken, in that order, when there are no more than `most`.
    """
    taken = min(len(points), most)
    chosen = np.zeros(taken, np.int64)
    x, y, z = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    nearest = np.full(len(points), np.float32(np.inf))
    for k in range(1, taken):
        latest = chosen[k - 1]
        px, py, pz = x[latest], y[latest], z[latest]
        for i in range(len(points)):
            dx, dy, dz = x[i] - px, y[i] - py, z[i] - pz
            nearest[i] = min(nearest[i], dx * dx + dy * dy + dz * dz)
        nearest[latest] = -1.0  # never again, even where points coincide
        chosen[k] = np.argmax(nearest)
    return chosen


@compiled
def in_ball(
    points: Float32[np.ndarray, "n 3"], centres: Float32[np.ndarray, "c 3"], radius: float, most: int
) -> Int64[np.ndarray, "c k"]:
    """Ball query: `most` of the points within `radius` of each centre, spread evenly over them in their order.

    Where the ball holds fewer, some come again. Centres must be points themselves: no ball is empty.
    """
    members = np.empty((len(centres), most), np.int64)
    inside = np.empty(len(points), np.int64)
    limit = np.float32(radius) * np.float32(radius)
    for c in range(len(centres)):
        x, y, z = centres[c, 0], centres[c, 1], centres[c, 2]
        found = 0
        for i in range(len(points)):
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            inside[found] = i
            found += dx * dx + dy * dy + dz * dz <= limit
        for k in range(most):
            members[c, k] = inside[k * found // most]
    return members


@compiled
def describe_groups(
    points: Float32[np.ndarray, "n 3"],
    centres: Float32[np.ndarray, "c 3"],
    members: Int64[np.ndarray, "c k"],
    scales: tuple[float, float],
) -> Float32[np.ndarray, "6 c k"]:
    """Of each member the offset from its centre divided by the first scale, and the place by the second."""
    planes = np.empty((6, *members.shape), np.float32)
    near, far = np.float32(1.0 / scales[0]), np.float32(1.0 / scales[1])
    for axis in range(3):
        for c in range(len(centres)):
            for k in range(members.shape[1]):
                value = points[members[c, k], axis]
                planes[axis, c, k] = (value - centres[c, axis]) * near
                planes[3 + axis, c, k] = value * far
    return planes
