"""Compiled inner loops (numba): they release the GIL, so that worker threads scale with cores.

Compiled code is cached on disk; the first call in a fresh environment compiles, `warm_up` of the pipeline
pays for it before the service is ready.
"""

import numpy as np
from jaxtyping import Float32, Int32
from numba import njit


@njit(cache=True, nogil=True)
def rasterise(
    points: Float32[np.ndarray, "n 3"],
    edges: Float32[np.ndarray, " layers+1"],
    shape: tuple[int, int],
) -> tuple[
    Int32[np.ndarray, "layers rows columns"],
    Float32[np.ndarray, "layers rows columns"],
    Float32[np.ndarray, "layers rows columns"],
    Float32[np.ndarray, "2 layers rows columns"],
]:
    """Count, highest and lowest depth, and mean sub-cell position of the points in each layer and cell.

    Args:
        points: (column, row, depth) coordinates; column and row in pixels, 0 at the image's upper left edge.
        edges: depths at which the layers start and end, ascending; depths outside fall in the outer layers.
        shape: rows and columns.

    Returns:
        Counts; highest and lowest depth (0 where empty); mean offset from the cell's middle along columns and
        rows, in pixels, in [-0.5, 0.5]. Points outside the image are left out.
    """
    rows, columns = shape
    layers = len(edges) - 1
    count = np.zeros((layers, rows, columns), np.int32)
    top = np.zeros((layers, rows, columns), np.float32)
    bottom = np.zeros((layers, rows, columns), np.float32)
    offset = np.zeros((2, layers, rows, columns), np.float32)
    for i in range(len(points)):
        u, v, depth = points[i, 0], points[i, 1], points[i, 2]
        if not (0 <= u < columns and 0 <= v < rows):
            continue
        column, row, layer = int(u), int(v), 0
        while layer < layers - 1 and depth >= edges[layer + 1]:
            layer += 1
        seen = count[layer, row, column]
        if seen == 0 or depth > top[layer, row, column]:
            top[layer, row, column] = depth
        if seen == 0 or depth < bottom[layer, row, column]:
            bottom[layer, row, column] = depth
        count[layer, row, column] = seen + 1
        offset[0, layer, row, column] += (u - column - 0.5 - offset[0, layer, row, column]) / (seen + 1)
        offset[1, layer, row, column] += (v - row - 0.5 - offset[1, layer, row, column]) / (seen + 1)
    return count, top, bottom, offset


@njit(cache=True, nogil=True, inline="always")
def _squared_distance(points: Float32[np.ndarray, "n 3"], i: int, j: int) -> np.float32:
    # By coordinate: a difference of rows would allocate an array for every pair.
    dx, dy, dz = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
    return np.float32(dx * dx + dy * dy + dz * dz)


@njit(cache=True, nogil=True)
def count_neighbours(points: Float32[np.ndarray, "n 3"], radius: float) -> Int32[np.ndarray, " n"]:
    """How many other points lie within `radius` of each point: n_i = |{j != i: |p_i - p_j| <= r}|.

    Points are sorted into cubes a little larger than `radius`. Cubes above one another follow each other, so the
    neighbours of a point lie in nine runs of points, which the compiler compares several at a time.
    """
    cubes, start, order = _sort_into_cubes(points, radius)
    _, deep, high = cubes
    x, y, z = points[order, 0], points[order, 1], points[order, 2]
    limit = np.float32(radius) * np.float32(radius)
    counts = np.empty(len(points), np.int32)
    for cube in range(len(start) - 1):
        if start[cube] == start[cube + 1]:
            continue
        up, beside, ahead = cube % high, cube // high % deep, cube // high // deep
        for i in range(start[cube], start[cube + 1]):
            found = -1  # the point itself
            for nx in range(max(ahead - 1, 0), min(ahead + 2, cubes[0])):
                for ny in range(max(beside - 1, 0), min(beside + 2, deep)):
                    column = (nx * deep + ny) * high
                    for j in range(start[column + max(up - 1, 0)], start[column + min(up + 2, high)]):
                        dx, dy, dz = x[i] - x[j], y[i] - y[j], z[i] - z[j]
                        found += dx * dx + dy * dy + dz * dz <= limit
            counts[order[i]] = found
    return counts


_MOST_CUBES = 1 << 20  # bounds memory; wider clouds get larger cubes


@njit(cache=True, nogil=True)
def _sort_into_cubes(
    points: Float32[np.ndarray, "n 3"], radius: float
) -> tuple[tuple[int, int, int], Int32[np.ndarray, " cubes+1"], Int32[np.ndarray, " n"]]:
    """Cubes along each axis, where each cube's points start in the order, and the points in order of cubes."""
    lower, extent = np.empty(3, np.float32), np.empty(3, np.float32)
    for axis in range(3):
        lower[axis] = points[:, axis].min() if len(points) else 0.0
        extent[axis] = points[:, axis].max() - lower[axis] if len(points) else 0.0
    edge = max(1.001 * radius, 1e-6)  # the margin keeps rounding from hiding a neighbour two cubes away
    while (extent[0] / edge + 1) * (extent[1] / edge + 1) * (extent[2] / edge + 1) > _MOST_CUBES:
        edge *= 2
    cubes = (int(extent[0] / edge) + 1, int(extent[1] / edge) + 1, int(extent[2] / edge) + 1)
    cube = np.empty(len(points), np.int32)
    start = np.zeros(cubes[0] * cubes[1] * cubes[2] + 1, np.int32)
    for i in range(len(points)):
        x = int((points[i, 0] - lower[0]) / edge)
        y = int((points[i, 1] - lower[1]) / edge)
        z = int((points[i, 2] - lower[2]) / edge)
        cube[i] = (x * cubes[1] + y) * cubes[2] + z
        start[cube[i] + 1] += 1
    for k in range(1, len(start)):
        start[k] += start[k - 1]
    order, free = np.empty(len(points), np.int32), start.copy()
    for i in range(len(points)):
        order[free[cube[i]]] = i
        free[cube[i]] += 1
    return cubes, start, order


@njit(cache=True, nogil=True)
def select_spread(
    points: Float32[np.ndarray, "n 3"], scores: Int32[np.ndarray, " n"], spacing: float, limit: int
) -> Int32[np.ndarray, " k"]:
    """Indices of the highest scores, greedily, each at least `spacing` from all taken before.

    Ties go to the point that is smaller in (x, y, z), so that the order of the points does not matter.
    """
    free = np.ones(len(points), np.bool_)
    chosen = np.empty(limit, np.int32)
    taken = 0
    while taken < limit:
        best = -1
        for i in range(len(points)):
            if free[i] and (best < 0 or _ranks_before(points, scores, i, best)):
                best = i
        if best < 0:
            break
        chosen[taken] = best
        taken += 1
        for i in range(len(points)):
            if _squared_distance(points, i, best) < spacing * spacing:
                free[i] = False
        free[best] = False
    return chosen[:taken]


@njit(cache=True, nogil=True)
def _ranks_before(
    points: Float32[np.ndarray, "n 3"], scores: Int32[np.ndarray, " n"], first: int, second: int
) -> bool:
    if scores[first] != scores[second]:
        return bool(scores[first] > scores[second])
    for axis in range(3):
        if points[first, axis] != points[second, axis]:
            return bool(points[first, axis] < points[second, axis])
    return False


@njit(cache=True, nogil=True)
def bin_spherically(
    points: Float32[np.ndarray, "n 3"],
    centre: Float32[np.ndarray, " 3"],
    radius: float,
    shape: tuple[int, int, int],
) -> tuple[
    Int32[np.ndarray, "strata rows columns"],
    Float32[np.ndarray, "rows columns"],
    Float32[np.ndarray, "rows columns"],
]:
    """Neighbours of `centre` by shell of distance, elevation and azimuth.

    Args:
        points: (n, 3), any frame with z up.
        centre: the keypoint, same frame.
        radius: outer radius of the neighbourhood, m.
        shape: strata (equal shells of distance), rows (elevation, zenith first), columns (azimuth from -pi; a
            multiple of 4).

    Returns:
        Counts by stratum and direction; nearest and farthest distance by direction (0 where empty), m.
    """
    strata, rows, columns = shape
    # Bounds of rows and columns as sines and tangents: comparing with them is far cheaper than an inverse.
    sines = np.sin((0.5 - np.arange(1, rows) / rows) * np.pi).astype(np.float32)
    tangents = np.tan(np.arange(1, columns // 4) * (2 * np.pi / columns)).astype(np.float32)
    count = np.zeros((strata, rows, columns), np.int32)
    nearest = np.zeros((rows, columns), np.float32)
    farthest = np.zeros((rows, columns), np.float32)
    limit = np.float32(radius) * np.float32(radius)
    for i in range(len(points)):
        dx, dy, dz = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        squared = dx * dx + dy * dy + dz * dz
        if squared == 0.0 or squared >= limit:
            continue
        distance = np.sqrt(squared)
        row = _elevation_row(dz / distance, sines)
        column = _azimuth_column(dx, dy, tangents)
        count[min(int(distance / radius * strata), strata - 1), row, column] += 1
        if nearest[row, column] == 0.0 or distance < nearest[row, column]:
            nearest[row, column] = distance
        farthest[row, column] = max(farthest[row, column], distance)
    return count, nearest, farthest


@njit(cache=True, nogil=True, inline="always")
def _elevation_row(sine: float, sines: Float32[np.ndarray, " edges"]) -> int:
    """How many of the descending `sines` are above `sine`: the row, zenith first."""
    low, high = 0, len(sines)
    while low < high:
        middle = (low + high) // 2
        if sine < sines[middle]:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True, nogil=True, inline="always")
def _azimuth_column(dx: float, dy: float, tangents: Float32[np.ndarray, " edges"]) -> int:
    """Column of the azimuth of (dx, dy), from -pi, with `edges` + 1 columns in each quarter turn."""
    quarter = len(tangents) + 1
    if dx == 0.0 and dy == 0.0:  # straight above or below: by convention azimuth 0
        return 2 * quarter
    if dy < 0:  # columns of -pi to 0
        along, across, first = (-dx, -dy, 0) if dx < 0 else (-dy, dx, quarter)
    else:
        along, across, first = (dx, dy, 2 * quarter) if dx > 0 else (dy, -dx, 3 * quarter)
    step = 0
    while step < len(tangents) and across >= along * tangents[step]:
        step += 1
    return first + step


@njit(cache=True, nogil=True)
def lift_columns(
    occupied: np.ndarray,  # bool (layers, rows, columns): cells to lift
    bounds: Float32[np.ndarray, "4 layers rows columns"],
    offset: Float32[np.ndarray, "2 layers rows columns"],
    step: float,
) -> Float32[np.ndarray, "n 3"]:
    """Points every `step` of depth from bottom to top of each occupied cell, but not where it was measured.

    Args:
        occupied: (layers, rows, columns) bool.
        bounds: top and bottom to fill, then top and bottom that were measured (top < bottom: nothing was);
            shares of the depth range.
        offset: where in the cell the surface lies, pixels from its middle.
        step: spacing in depth, same unit as `bounds`.

    Returns:
        (column, row, depth) coordinates; column and row in pixels, 0 at the image's upper left edge.
    """
    layers, rows, columns = occupied.shape
    limit = 0
    for pass_number in range(2):
        lifted = np.empty((limit, 3), np.float32)
        taken = 0
        for layer in range(layers):
            for row in range(rows):
                for column in range(columns):
                    if not occupied[layer, row, column]:
                        continue
                    top, bottom = bounds[0, layer, row, column], bounds[1, layer, row, column]
                    seen_top, seen_bottom = bounds[2, layer, row, column], bounds[3, layer, row, column]
                    levels = 1 + max(0, int(np.ceil((top - bottom) / step - 0.5)))
                    for level in range(levels):
                        depth = bottom + (top - bottom) * (level + 0.5) / levels
                        if levels == 1:
                            depth = top
                        if seen_bottom - step / 2 <= depth <= seen_top + step / 2:
                            continue
                        if pass_number == 1:
                            lifted[taken, 0] = column + 0.5 + offset[0, layer, row, column]
                            lifted[taken, 1] = row + 0.5 + offset[1, layer, row, column]
                            lifted[taken, 2] = depth
                        taken += 1
        limit = taken
    return lifted
