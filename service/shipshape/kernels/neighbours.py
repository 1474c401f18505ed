"""The densest points of a cloud, spread out."""

import numpy as np
from jaxtyping import Float32, Int32

from shipshape.kernels.clouds import extent
from shipshape.kernels.compiled import compiled

_MOST_SLABS = 1 << 16  # bounds memory; longer clouds get thicker slabs


@compiled
def count_neighbours(points: Float32[np.ndarray, "n 3"], radius: float) -> Int32[np.ndarray, " n"]:
    """How many other points lie within `radius` of each point: n_i = |{j != i: |p_i - p_j| <= r}|.

    Points are sorted into slabs along the cloud's longest axis, each a little thicker than half of `radius`. The
    neighbours of a slab's points are in one run, two slabs to either side: more points to compare than in a finer
    grid, but the compiler compares many at a time and no branch is left to guess.
    """
    start, order = _sort_into_slabs(points, radius)
    x, y, z = points[order, 0], points[order, 1], points[order, 2]
    limit = np.float32(radius) * np.float32(radius)
    counts = np.empty(len(points), np.int32)
    slabs = len(start) - 1
    for slab in range(slabs):
        near = slice(start[max(slab - 2, 0)], start[min(slab + 3, slabs)])
        for i in range(start[slab], start[slab + 1]):
            found = _count_within((x[i], y[i], z[i]), (x[near], y[near], z[near]), limit)
            counts[order[i]] = found - 1  # the point itself
    return counts


@compiled
def _count_within(
    point: tuple[np.float32, np.float32, np.float32],
    near: tuple[Float32[np.ndarray, " n"], Float32[np.ndarray, " n"], Float32[np.ndarray, " n"]],
    limit: np.float32,
) -> np.int32:
    """How many of `near` lie within the distance whose square is `limit`; points by coordinate."""
    x, y, z = near
    found = np.int32(0)
    for i in range(len(x)):
        dx, dy, dz = point[0] - x[i], point[1] - y[i], point[2] - z[i]
        found = np.int32(found + (dx * dx + dy * dy + dz * dz <= limit))  # as wide as the distances
    return found


@compiled
def _sort_into_slabs(
    points: Float32[np.ndarray, "n 3"], radius: float
) -> tuple[Int32[np.ndarray, " slabs+1"], Int32[np.ndarray, " n"]]:
    """Where each slab's points start in the order, and the points in order of slabs."""
    lower, upper, _ = extent(points, 0.0)
    axis = np.argmax(upper - lower)
    length = upper[axis] - lower[axis] if len(points) else 0.0
    # The margin keeps rounding from hiding a neighbour three slabs away.
    thickness = max(0.5005 * radius, length / _MOST_SLABS, 1e-6)
    slab = np.empty(len(points), np.int32)
    start = np.zeros(int(length / thickness) + 2, np.int32)
    for i in range(len(points)):
        slab[i] = int((points[i, axis] - lower[axis]) / thickness)
        start[slab[i] + 1] += 1
    for k in range(1, len(start)):
        start[k] += start[k - 1]
    order, free = np.empty(len(points), np.int32), start.copy()
    for i in range(len(points)):
        order[free[slab[i]]] = i
        free[slab[i]] += 1
    return start, order


@compiled
def select_spread(
    points: Float32[np.ndarray, "n 3"], scores: Int32[np.ndarray, " n"], spacing: float, limit: int
) -> Int32[np.ndarray, " k"]:
    """Indices of the highest scores, greedily, each at least `spacing` from all taken before.

    Ties go to the point that is smaller in (x, y, z), so that the order of the points does not matter.
    """
    chosen = np.empty(limit, np.int32)
    taken = 0
    while taken < limit:
        best = -1
        for i in range(len(points)):
            # Most points score too little, so distances are asked for last.
            if best >= 0 and (scores[i] < scores[best] or not _ranks_before(points, scores, i, best)):
                continue
            if _is_clear(points, i, chosen[:taken], spacing):
                best = i
        if best < 0:
            break
        chosen[taken] = best
        taken += 1
    return chosen[:taken]


@compiled
def _ranks_before(
    points: Float32[np.ndarray, "n 3"], scores: Int32[np.ndarray, " n"], first: int, second: int
) -> bool:
    if scores[first] != scores[second]:
        return bool(scores[first] > scores[second])
    for axis in range(3):
        if points[first, axis] != points[second, axis]:
            return bool(points[first, axis] < points[second, axis])
    return False


@compiled
def _is_clear(points: Float32[np.ndarray, "n 3"], i: int, chosen: Int32[np.ndarray, " k"], spacing: float) -> bool:
    """Whether point i is none of the chosen and at least `spacing` from each."""
    for j in chosen:
        # By coordinate: a difference of rows would allocate an array for every pair.
        dx, dy, dz = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
        if i == j or dx * dx + dy * dy + dz * dz < spacing * spacing:
            return False
    return True
