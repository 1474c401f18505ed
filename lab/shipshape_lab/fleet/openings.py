"""How much of a hull can be seen from both of its sides: a closed one shows its outside alone."""

import numpy as np
import trimesh

from shipshape_lab.simulator.vessel import Vessel

SAMPLES = 1500
AZIMUTHS = 16
ELEVATIONS_DEG = (0.0, 10.0)  # as a LiDAR looks; from higher up one sees into every open boat
UPRIGHT = 0.7  # |cosine| to the vertical under which a triangle counts as a wall


def seen_through(vessel: Vessel) -> float:
    """Share, 0 to 1, of the walls visible from around that show both of their sides.

    Sheets that stand free, such as sails, count too: to a LiDAR they are no different.
    """
    points, triangles = trimesh.sample.sample_surface(vessel.mesh, SAMPLES, seed=0)
    normals = vessel.mesh.face_normals[triangles]
    walls = (np.abs(normals[:, 2]) < UPRIGHT) & (points[:, 2] > 0.0)
    points, normals = np.asarray(points)[walls], normals[walls]
    lift = 1e-4 * float(vessel.mesh.extents.max())
    seen = np.zeros((len(points), 2), dtype=bool)
    for view in _views():
        slopes = normals @ view
        facing = np.flatnonzero(np.abs(slopes) > 0.05)
        sides = np.sign(slopes[facing])
        starts = points[facing] + lift * sides[:, None] * normals[facing]
        free = ~vessel.rays.intersects_any(starts, np.broadcast_to(view, starts.shape))
        seen[facing[free], (sides[free] > 0).astype(int)] = True
    return float(seen.all(axis=1).sum() / max(seen.any(axis=1).sum(), 1))


def _views() -> np.ndarray:
    azimuths = np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS
    turn, lift = (grid.ravel() for grid in np.meshgrid(azimuths, np.radians(ELEVATIONS_DEG)))
    return np.column_stack([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
