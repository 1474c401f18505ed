"""A vessel as the simulator sees it: one watertight-enough triangle mesh in the vessel frame.

Vessel frame: x to the bow, y to port, z up, z = 0 on the waterline, origin under the middle of the
box that the above-water part fills (the *reference box*). Metres.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector


@dataclass(frozen=True)
class Vessel:
    """One hull: its type name, the seed of its variation (None = nominal), and its mesh in the vessel frame."""

    name: str
    mesh: trimesh.Trimesh
    seed: int | None = None

    @property
    def box(self) -> tuple[float, float, float]:
        """Length, beam and air height of the part above the waterline, metres."""
        above = self.mesh.vertices[self.mesh.vertices[:, 2] >= 0.0]
        length, beam = np.ptp(above[:, :2], axis=0)
        return float(length), float(beam), float(above[:, 2].max())

    @cached_property
    def rays(self) -> RayMeshIntersector:
        """Casts rays on the mesh. Unlike `mesh.ray` it goes as soon as the vessel does, and its scene with it.

        The mesh and its own `ray` hold each other until Python next looks for such cycles, and embree crashes
        beyond about a thousand scenes.
        """
        return RayMeshIntersector(self.mesh)
