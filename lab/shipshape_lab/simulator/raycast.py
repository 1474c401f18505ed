"""First hits of rays on a vessel's mesh, through embree.

The embree scene stays with the vessel, so scanning a vessel again costs no new scene. Embree
works in float32; the distances are taken again from the plane of the triangle that was hit, in float64.
"""

from dataclasses import dataclass

import numpy as np

from shipshape_lab.simulator.sensor import MOST_GRAZING_COSINE
from shipshape_lab.simulator.vessel import Vessel


@dataclass(frozen=True)
class Hits:
    """What each ray met, shape (N,): distance in metres (a miss: inf), cosine of incidence (a miss: 0)."""

    ranges: np.ndarray
    cosines: np.ndarray


def cast(vessel: Vessel, T_level_vessel: np.ndarray, directions_level: np.ndarray) -> Hits:
    """First hit of each ray from the sensor on a vessel.

    Args:
        vessel: the mesh, in its own frame.
        T_level_vessel: pose of the vessel, shape (4, 4).
        directions_level: unit vectors from the sensor, level frame, shape (N, 3).

    Returns:
        Ranges and cosines, one for each ray. Hits more grazing than the sensor can see count as misses.
    """
    rotation = T_level_vessel[:3, :3]
    origin = -rotation.T @ T_level_vessel[:3, 3]
    directions = directions_level @ rotation
    ranges, cosines = np.full(len(directions), np.inf), np.zeros(len(directions))
    if len(directions) == 0:
        return Hits(ranges, cosines)
    triangles = vessel.rays.intersects_first(np.broadcast_to(origin, directions.shape), directions)
    hit = np.flatnonzero(triangles >= 0)
    normals = vessel.mesh.face_normals[triangles[hit]]
    slopes = np.einsum("ij,ij->i", directions[hit], normals)
    facing = np.abs(slopes) > MOST_GRAZING_COSINE
    hit, normals, slopes = hit[facing], normals[facing], slopes[facing]
    corners = vessel.mesh.triangles[triangles[hit], 0]
    ranges[hit] = np.einsum("ij,ij->i", corners - origin, normals) / slopes
    cosines[hit] = np.abs(slopes)
    return Hits(ranges, cosines)
