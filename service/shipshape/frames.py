"""Angles and rotations about the vertical axis; every transform names both its frames."""

import math

import numpy as np
from jaxtyping import Float32, Float64


def wrap_angle(angle: float) -> float:
    """The same angle in (-pi, pi], radians."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def wrap_half_turn(angle: float) -> float:
    """The same axis (angle modulo pi) in (-pi/2, pi/2], radians."""
    wrapped = math.remainder(angle, math.pi)
    return math.pi / 2 if wrapped == -math.pi / 2 else wrapped


def R_level_vessel(heading: float) -> Float64[np.ndarray, "2 2"]:
    """Rotation of horizontal coordinates from the vessel frame to the level frame."""
    cos, sin = math.cos(heading), math.sin(heading)
    return np.array([[cos, -sin], [sin, cos]])


def to_vessel(
    points_level: Float32[np.ndarray, "n 3"], heading: float, origin_level: tuple[float, float, float]
) -> Float32[np.ndarray, "n 3"]:
    """Level-frame points expressed in the frame with yaw `heading` and its origin at `origin_level`."""
    centred = points_level - np.asarray(
        origin_level, dtype=np.float32
    )  # first: far from the origin, digits are few
    points_vessel: Float32[np.ndarray, "n 3"] = centred @ _about_z(heading)
    return points_vessel


def to_level(
    points_vessel: Float32[np.ndarray, "n 3"], heading: float, origin_level: tuple[float, float, float]
) -> Float32[np.ndarray, "n 3"]:
    """The inverse of `to_vessel`."""
    turned: Float32[np.ndarray, "n 3"] = points_vessel @ _about_z(heading).T
    turned += np.asarray(origin_level, dtype=np.float32)
    return turned


def _about_z(heading: float) -> Float32[np.ndarray, "3 3"]:
    """Rotation from the vessel frame to the level frame; times a row of points from the right, its inverse."""
    cos, sin = math.cos(heading), math.sin(heading)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]], np.float32)


def aspect_deg(heading: float, origin_level: tuple[float, float, float]) -> float:
    """Angle from the bow to the line of sight back to the sensor: 0 bow-on, 90 abeam, 180 stern-on."""
    to_sensor = math.atan2(-origin_level[1], -origin_level[0])
    return abs(math.degrees(wrap_angle(to_sensor - heading)))


def true_heading_deg(heading: float, own_true_heading_deg: float) -> float:
    """The vessel's heading clockwise from true north, in [0, 360), from the caller's own true heading."""
    clockwise = (own_true_heading_deg - math.degrees(heading)) % 360.0
    return 0.0 if clockwise == 360.0 else clockwise  # the remainder of a tiny negative number rounds up to 360
