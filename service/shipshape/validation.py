"""Is this one vessel's cluster? Checked once, at the edge of the pipeline."""

from dataclasses import dataclass

import numpy as np

from shipshape.errors import InvalidInput, TooLarge, Unprocessable
from shipshape.types import Contact


@dataclass(frozen=True, slots=True)
class ContactLimits:
    """What a cluster may be."""

    min_points: int = 10  # fewer carry no shape
    max_points: int = 65_536  # bounds the work of one contact
    max_extent: float = 150.0  # m, in any direction; wider is a scene, not a vessel that was trained on
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
        raise TooLarge(f"expected at most {limits.max_points} points in a cluster, got {len(points)}")
    if len(points) < limits.min_points:
        raise Unprocessable(f"expected at least {limits.min_points} points in a cluster, got {len(points)}")
    broken = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
    if broken:
        raise Unprocessable(f"expected finite coordinates, got {broken} points with NaN or infinity")
    _check_numbers(contact)
    _check_extent(points, limits)


def _check_numbers(contact: Contact) -> None:
    height = contact.sensor_height
    if height is not None and not 0.0 < height < 200.0:
        raise Unprocessable(f"expected a sensor height between 0 and 200 m above the water, got {height}")
    top = float(contact.points_level[:, 2].max())
    if height is not None and top < -height:
        raise Unprocessable(
            f"expected points above the water, which is at z = {-height:g} m, "
            f"got a highest point at z = {top:.2f} m"
        )
    own = contact.own_true_heading_deg
    if own is not None and not np.isfinite(own):
        raise Unprocessable(f"expected the own true heading in degrees, got {own}")


def _check_extent(points: np.ndarray, limits: ContactLimits) -> None:
    lower, upper = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    extent = float(np.max(upper - lower))
    if extent > limits.max_extent:
        raise Unprocessable(
            f"expected one vessel's cluster, at most {limits.max_extent:g} m across, got {extent:.1f} m: "
            "split a scan into clusters first"
        )
    across = float(np.max((upper - lower)[:2]))
    if across < limits.min_extent:
        raise Unprocessable(f"expected a cluster at least {limits.min_extent:g} m across, got {across:.2f} m")
    nearest = float(np.hypot(*np.clip(0.0, lower[:2], upper[:2])))
    if nearest == 0.0:
        raise Unprocessable(
            "expected a cluster in the level frame (origin at the LiDAR), got points on all sides of the origin"
        )
    if nearest > limits.max_range:
        raise Unprocessable(f"expected a cluster within {limits.max_range:g} m, got one at {nearest:.0f} m")
