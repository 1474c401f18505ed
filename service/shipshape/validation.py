"""Is this one vessel's cluster? Checked once, at the edge of the pipeline."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32

from shipshape import kernels
from shipshape.errors import InvalidInput, TooLarge, Unprocessable
from shipshape.types import Contact

_TOUCHING = 1e-3  # m; rounding puts a hull through the sensor a little to either side of it
_ANGLES = np.linspace(-np.pi, np.pi, 256, endpoint=False)
_DIRECTIONS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])


@dataclass(frozen=True, slots=True)
class ContactLimits:
    """What a cluster may be."""

    min_points: int = 10  # fewer carry no shape
    max_points: int = 65_536  # bounds the work of one contact
    max_extent: float = 150.0  # m, between any two points; wider is a scene, not a vessel that was trained on
    min_extent: float = 0.5  # m, horizontally; smaller is spray or a buoy
    max_range: float = 1_000.0  # m; beyond every marine LiDAR


def check_contact(contact: Contact, limits: ContactLimits) -> None:
    """Refuse what cannot be one vessel's cluster in the level frame.

    Raises:
        InvalidInput: the array is not (n, 3).
        TooLarge: more points than the limit.
        Unprocessable: too few points, not finite, too wide or too small, too far, or around the sensor.
    """
    points = contact.points_level
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidInput(f"expected points of shape (n, 3), got {points.shape}")
    if len(points) > limits.max_points:
        raise TooLarge(
            f"expected at most {limits.max_points} points in a cluster, got {len(points)}: "
            "split a scan into clusters first"
        )
    if len(points) < limits.min_points:
        raise Unprocessable(f"expected at least {limits.min_points} points in a cluster, got {len(points)}")
    extent = kernels.extent(points, 0.0)
    if not np.isfinite(extent.mean).all():
        broken = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
        raise Unprocessable(f"expected finite coordinates, got {broken} points with NaN or infinity")
    _check_numbers(contact, float(extent.upper[2]))
    if not _box_is_enough(extent, limits):
        _check_hull(points, limits)


def _check_numbers(contact: Contact, top: float) -> None:
    height = contact.sensor_height
    if height is not None and not 0.0 < height < 200.0:
        raise Unprocessable(f"expected a sensor height between 0 and 200 m above the water, got {height}")
    if height is not None and top < -height:
        raise Unprocessable(
            f"expected points above the water, which is at z = {-height:g} m, "
            f"got a highest point at z = {top:.2f} m"
        )
    own = contact.own_true_heading_deg
    if own is not None and not np.isfinite(own):
        raise Unprocessable(f"expected the own true heading in degrees, got {own}")


def _box_is_enough(extent: kernels.Extent, limits: ContactLimits) -> bool:
    """Whether the box along x, y and z already shows what `_check_hull` asks; it does of nearly every cluster."""
    (left, near, low), (right, far, high) = extent.lower.tolist(), extent.upper.tolist()
    across = math.hypot(right - left, far - near)  # no two points are farther apart
    nearest = math.hypot(max(left, -right, 0.0), max(near, -far, 0.0))
    farthest = math.hypot(max(-left, right), max(-near, far))
    return (
        max(across, high - low) <= limits.max_extent
        and max(right - left, far - near) >= limits.min_extent
        and nearest >= _TOUCHING
        and farthest <= limits.max_range
    )


def _check_hull(points: Float32[np.ndarray, "n 3"], limits: ContactLimits) -> None:
    hull = cv2.convexHull(
        np.ascontiguousarray(points[:, :2])
    )  # unlike a box along x and y, it turns with the world
    across, tall = _diameter(hull[:, 0]), float(np.ptp(points[:, 2].astype(np.float64)))
    extent = max(across, tall)
    if extent > limits.max_extent:
        raise Unprocessable(
            f"expected one vessel's cluster, at most {limits.max_extent:g} m across, got {extent:.1f} m: "
            "split a scan into clusters first"
        )
    if across < limits.min_extent:
        raise Unprocessable(f"expected a cluster at least {limits.min_extent:g} m across, got {across:.2f} m")
    nearest = -cv2.pointPolygonTest(hull, (0.0, 0.0), measureDist=True)
    if nearest < _TOUCHING:
        raise Unprocessable(
            "expected a cluster in the level frame (origin at the LiDAR), got points on all sides of the origin: "
            "split a scan into clusters first, and do not centre them"
        )
    if nearest > limits.max_range:
        raise Unprocessable(f"expected a cluster within {limits.max_range:g} m, got one at {nearest:.0f} m")


def _diameter(hull: Float32[np.ndarray, "corners 2"]) -> float:
    """Largest distance between two corners; of a hull of very many corners only the outermost are compared."""
    corners = hull.astype(np.float64)
    if len(corners) > len(_DIRECTIONS):
        corners = corners[np.unique((_DIRECTIONS @ corners.T).argmax(axis=1))]
    between = corners[:, None] - corners
    return float(np.hypot(between[..., 0], between[..., 1]).max())
