"""The wetted side of a hull that was cut at the waterline: what rises out of the water when it rolls or heaves."""

import numpy as np
import trimesh
from trimesh.intersections import mesh_plane

from shipshape_lab.simulator.vessel import Vessel

DEPTH = 2.0
CUT_HEIGHT = 1e-3


def with_skirt(vessel: Vessel) -> Vessel:
    """Adds upright walls from the waterline down, so that no ray passes under a hull that a sea has lifted.

    Args:
        vessel: a hull that ends at the waterline, in the vessel frame.

    Returns:
        The same hull with walls to 2 m below the waterline; its box stays as it was.
    """
    # A hair above the waterline, where the plane cannot fall together with a floor.
    edges = mesh_plane(vessel.mesh, [0.0, 0.0, 1.0], [0.0, 0.0, CUT_HEIGHT])
    if len(edges) == 0:
        return vessel
    feet = edges - [0.0, 0.0, DEPTH]
    corners = np.concatenate([edges, feet[:, ::-1]], axis=1).reshape(-1, 3)
    quads = np.arange(len(corners)).reshape(-1, 4)
    walls = trimesh.Trimesh(corners, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), process=False)
    return Vessel(vessel.name, trimesh.util.concatenate([vessel.mesh, walls]), vessel.seed)
