"""Neighbourhoods of points on a sphere around them."""

import numpy as np
from jaxtyping import Float32, Int32
from numba import njit

from shipshape.kernels.compiled import compiled


@compiled
def bin_spherically(
    points: Float32[np.ndarray, "n 3"],
    centres: Float32[np.ndarray, "k 3"],
    radius: float,
    shape: tuple[int, int, int],
) -> tuple[
    Int32[np.ndarray, "k strata rows columns"],
    Float32[np.ndarray, "k rows columns"],
    Float32[np.ndarray, "k rows columns"],
]:
    """Neighbours of each centre by shell of distance, elevation and azimuth.

    Args:
        points: (n, 3), any frame with z up.
        centres: the keypoints, same frame.
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
    count = np.zeros((len(centres), strata, rows, columns), np.int32)
    nearest = np.zeros((len(centres), rows, columns), np.float32)
    farthest = np.zeros((len(centres), rows, columns), np.float32)
    limit = np.float32(radius) * np.float32(radius)
    for k in range(len(centres)):
        for i in range(len(points)):
            dx, dy = points[i, 0] - centres[k, 0], points[i, 1] - centres[k, 1]
            dz = points[i, 2] - centres[k, 2]
            squared = dx * dx + dy * dy + dz * dz
            if squared == 0.0 or squared >= limit:
                continue
            distance = np.sqrt(squared)
            row = _elevation_row(dz / distance, sines)
            column = _azimuth_column(dx, dy, tangents)
            count[k, min(int(distance / radius * strata), strata - 1), row, column] += 1
            if nearest[k, row, column] == 0.0 or distance < nearest[k, row, column]:
                nearest[k, row, column] = distance
            farthest[k, row, column] = max(farthest[k, row, column], distance)
    return count, nearest, farthest


@njit(nogil=True, inline="always")
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


@njit(nogil=True, inline="always")
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
