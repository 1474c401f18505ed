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
    from shipshape import kernels  # noqa: PLC0415  # numba is large, and the service computes in other processes

    points_level = np.ascontiguousarray(points_level, np.float32)
    points_vessel: Float32[np.ndarray, "n 3"] = kernels.into_frame(
        points_level, float(heading), _floats(origin_level)
    )
    return points_vessel


def to_level(
    points_vessel: Float32[np.ndarray, "n 3"], heading: float, origin_level: tuple[float, float, float]
) -> Float32[np.ndarray, "n 3"]:
    """The inverse of `to_vessel`."""
    from shipshape import kernels  # noqa: PLC0415  # numba is large, and the service computes in other processes

    points_vessel = np.ascontiguousarray(points_vessel, np.float32)
    points_level: Float32[np.ndarray, "n 3"] = kernels.out_of_frame(
        points_vessel, float(heading), _floats(origin_level)
    )
    return points_level


def _floats(origin: tuple[float, float, float]) -> tuple[float, float, float]:
    # Kernels are compiled anew for each kind of number.
    x, y, z = origin
    return float(x), float(y), float(z)


def aspect_deg(heading: float, origin_level: tuple[float, float, float]) -> float:
    """Angle from the bow to the line of sight back to the sensor: 0 bow-on, 90 abeam, 180 stern-on."""
    to_sensor = math.atan2(-origin_level[1], -origin_level[0])
    return abs(math.degrees(wrap_angle(to_sensor - heading)))


def true_heading_deg(heading: float, own_true_heading_deg: float) -> float:
    """The vessel's heading clockwise from true north, in [0, 360), from the caller's own true heading."""
    clockwise = (own_true_heading_deg - math.degrees(heading)) % 360.0
    return 0.0 if clockwise == 360.0 else clockwise  # the remainder of a tiny negative number rounds up to 360
