"""The sight frame: a cluster as seen along the line of sight, before anything is known of its heading.

Origin on the waterline under the middle of the cluster, x away from the sensor, y to the left, z up. A cluster
looks the same in it from whatever bearing it was seen, and what is hidden always lies toward +x.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from shipshape import frames, kernels
from shipshape.types import Contact


@dataclass(frozen=True, slots=True)
class SightFrame:
    """Where the sight frame lies in the level frame."""

    bearing: float  # of the line of sight, rad, counter-clockwise from +x of the level frame
    origin_level: tuple[float, float, float]  # m
    knows_water: bool  # false: the lowest point stands in for the waterline

    @property
    def range_m(self) -> float:
        """Horizontal distance from the sensor to the middle of the cluster, metres."""
        return math.hypot(*self.origin_level[:2])


def sight_frame(contact: Contact) -> SightFrame:
    """The sight frame of a contact's cluster."""
    mean = kernels.extent(contact.points_level, 0.0).mean
    bearing = math.atan2(mean[1], mean[0])
    lower, upper, _ = kernels.extent(contact.points_level, bearing)
    middle = frames.R_level_vessel(bearing) @ (lower[:2] + upper[:2]) / 2
    water = float(lower[2]) if contact.sensor_height is None else -contact.sensor_height
    origin = (float(middle[0]), float(middle[1]), water)
    return SightFrame(bearing, origin, contact.sensor_height is not None)


def to_sight(points_level: Float32[np.ndarray, "n 3"], sight: SightFrame) -> Float32[np.ndarray, "n 3"]:
    """Level-frame points in the sight frame."""
    return frames.to_vessel(points_level, sight.bearing, sight.origin_level)
