"""A whole scan -> clusters: without the water and one's own vessel, what lies together from above is one vessel.

Level frame, metres. Seen from above, since the channels of a LiDAR lie far apart in height and close along the
horizon; the connected areas of an occupancy grid, since they cost the same whatever the scan holds.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int32

from shipshape.batch.method import Segmentation

CELLS_A_GAP = 8  # side of a cell of the grid: an eighth of the gap, by which it is wrong at most
WATER_SHARE = 0.01  # of the points may lie below the water: reflections
MOST_CELLS, MOST_SIDE = 2**25, 2**20  # of the grid, which is coarser where a scan is wider than any LiDAR sees


def segment(
    points_level: Float32[np.ndarray, "n 3"], how: Segmentation, sensor_height: float | None
) -> tuple[list[Float32[np.ndarray, "_ 3"]], float | None]:
    """The clusters of a scan in a fixed order, and the height of the LiDAR above the water, metres.

    Args:
        points_level: A scan, level frame.
        how: What is removed and what belongs together.
        sensor_height: Of the LiDAR above the water; None: it is taken from the lowest points that remain once
            one's own vessel is removed, and is None again when they are not below the LiDAR.
    """
    points = points_level[np.isfinite(points_level).all(axis=1)]
    points = points[~_own(points, how)]
    if not len(points):
        return [], sensor_height
    water = float(np.quantile(points[:, 2], WATER_SHARE)) if sensor_height is None else -sensor_height
    points = points[points[:, 2] >= water + how.water_band]
    labels = _labels(points, how.gap)
    order = np.argsort(labels, kind="stable")
    parts = np.split(points[order], np.cumsum(np.bincount(labels))[:-1]) if len(points) else []
    return [part for part in parts if len(part) >= how.min_points], -water if water < 0 else None


def _own(points: Float32[np.ndarray, "n 3"], how: Segmentation) -> Bool[np.ndarray, " n"]:
    inside: Bool[np.ndarray, " n"] = (np.abs(points[:, 0]) < how.own_length / 2) & (
        np.abs(points[:, 1]) < how.own_beam / 2
    )
    return inside


def _labels(points: Float32[np.ndarray, "n 3"], gap: float) -> Int32[np.ndarray, " n"]:
    """The connected area that each point lies in; two points at most about `gap` apart from above share one."""
    if not len(points):
        return np.empty(0, np.int32)
    low = points[:, :2].min(axis=0)
    span = (points[:, :2].max(axis=0) - low).astype(np.float64)
    cell = max(gap / CELLS_A_GAP, float(np.sqrt(span.prod() / MOST_CELLS)), float(span.max()) / MOST_SIDE)
    columns, rows = np.ceil(span / cell).astype(np.int64) + 1 + 2 * CELLS_A_GAP
    at = ((points[:, :2] - low) / cell).astype(np.int64) + CELLS_A_GAP
    grid = np.zeros((rows, columns), np.uint8)
    grid[at[:, 1], at[:, 0]] = 1
    reach = max(1, round(gap / cell / 2))  # each point grows by half the gap
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    _, areas = cv2.connectedComponents(cv2.dilate(grid, disc), connectivity=8)
    found: Int32[np.ndarray, " n"] = np.asarray(areas[at[:, 1], at[:, 0]] - 1, np.int32)
    return found
