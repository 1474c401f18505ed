"""Vessels from mesh files: PLY, STL, OBJ, GLB, DAE; in comes a file, out goes a `Vessel` in the vessel frame.

The file's axes are those of the vessel frame (x to the bow, y to port, z up), or in a GLB those that glTF fixes
(z to the bow, y up), unless the caller says where bow and up are. A unit that the file declares (DAE) is brought
to metres first.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from trimesh.units import unit_conversion

from shipshape_lab.simulator.vessel import Vessel

SUFFIXES = (".ply", ".stl", ".obj", ".glb", ".dae")
SHORTEST, LONGEST = 1.0, 500.0
MOST_TRIANGLES = 60_000  # more tell a LiDAR nothing, and cost 0.3 MB a thousand for every sister hull
FINEST_CELL = 0.01  # m

AXES = {sign + name: (-1.0 if sign else 1.0) * np.eye(3)[i] for i, name in enumerate("xyz") for sign in ("", "-")}


@dataclass(frozen=True)
class Placing:
    """How a file's mesh lies in the water.

    Attributes:
        scale: factor on the file's size; metres in one unit of a file that declares no unit.
        waterline: height of the waterline above the file's origin after scaling, metres.
        bow: the file's axis that points to the bow, one of `AXES`; None for the format's own.
        up: the file's axis that points up; None for the format's own.
    """

    scale: float = 1.0
    waterline: float = 0.0
    bow: str | None = None
    up: str | None = None

    def rotation(self, suffix: str) -> np.ndarray:
        """R_vessel_file of a file with this suffix, shape (3, 3).

        Raises:
            ValueError: bow and up lie along one axis.
        """
        own_bow, own_up = ("z", "y") if suffix == ".glb" else ("x", "z")
        bow, up = self.bow or own_bow, self.up or own_up
        if bow[-1] == up[-1]:
            raise ValueError(f"expected bow and up along two different axes, got {bow} and {up}")
        return np.stack([AXES[bow], np.cross(AXES[up], AXES[bow]), AXES[up]])


def load_vessel(
    path: str | Path, *, name: str | None = None, scale: float = 1.0, waterline: float = 0.0
) -> Vessel:
    """A mesh whose axes are its format's own, cut at the waterline; see `Placing` and `above_water`."""
    path = Path(path)
    return above_water(path, read_placed(path, Placing(scale, waterline)), name=name)


def read_placed(path: Path, placing: Placing) -> trimesh.Trimesh:
    """A whole mesh with the vessel's axes, in metres, z = 0 on the waterline, its middle where the file has it.

    Raises:
        ValueError: if the file cannot be read or is empty, or bow and up lie along one axis.
    """
    mesh = _read(path)
    T_vessel_file = np.eye(4)
    T_vessel_file[:3, :3] = placing.scale * placing.rotation(path.suffix.lower())
    T_vessel_file[2, 3] = -placing.waterline
    return mesh.apply_transform(T_vessel_file)


def above_water(path: Path, mesh: trimesh.Trimesh, *, name: str | None = None) -> Vessel:
    """The part of a placed mesh above the waterline, thinned out, the origin under the middle of it.

    Args:
        path: the file it came from, for the errors.
        mesh: as `read_placed` gives it.
        name: type name; the file's stem if None.

    Raises:
        ValueError: if it has nothing above the waterline or an absurd size.
    """
    above = mesh.slice_plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    if above is None or len(above.faces) == 0:
        raise ValueError(f"{path} must have a part above the waterline, but its highest point is below it")
    _check_size(path, above)
    above, _ = thinned(above)
    middle = above.bounds.mean(axis=0)
    above.apply_translation([-middle[0], -middle[1], 0.0])
    return Vessel(name or path.stem, above)


def thinned(mesh: trimesh.Trimesh, most: int = MOST_TRIANGLES) -> tuple[trimesh.Trimesh, float]:
    """A mesh of at most `most` triangles, by joining the vertices of each cell of a cubic grid.

    Returns:
        The mesh, and the edge of a cell in metres: no vertex moved further than its diagonal. 0 for a mesh that
        was small enough already.
    """
    cell, joined = 0.0, mesh
    while len(joined.faces) > most:
        cell = max(2.0 * cell, FINEST_CELL)
        joined = _joined(mesh, cell)
    return joined, cell


def _joined(mesh: trimesh.Trimesh, cell: float) -> trimesh.Trimesh:
    cells = np.floor(mesh.vertices / cell).astype(np.int64)
    _, first, vertex = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = vertex.reshape(-1)[mesh.faces]
    corners = np.sort(faces, axis=1)
    flat = (corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2])
    _, kept = np.unique(corners[~flat], axis=0, return_index=True)
    return trimesh.Trimesh(mesh.vertices[first], faces[~flat][kept], process=False)


def _read(path: Path) -> trimesh.Trimesh:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{path} must end in one of {', '.join(SUFFIXES)}")
    try:
        scene = trimesh.load_scene(path, file_type=suffix[1:])
        mesh = scene.to_mesh()
        mesh.apply_scale(unit_conversion(scene.units, "meters") if scene.units else 1.0)
    except Exception as error:  # the readers of five formats raise whatever they like on a broken file
        raise ValueError(f"{path} could not be read as a {suffix[1:].upper()} mesh: {error}") from error
    if len(mesh.faces) == 0:
        raise ValueError(f"{path} must hold triangles, but holds none")
    if not np.isfinite(mesh.vertices).all():
        raise ValueError(f"{path} must hold finite vertices, but some are not")
    if mesh.extents.max() == 0.0:
        raise ValueError(f"{path} must have an extent, but all of its vertices coincide (Draco is not supported)")
    return mesh


def _check_size(path: Path, mesh: trimesh.Trimesh) -> None:
    length = float(mesh.extents[:2].max())
    if not SHORTEST <= length <= LONGEST:
        raise ValueError(
            f"{path} must be {SHORTEST:.0f} to {LONGEST:.0f} m long, but is {length:.4g} m; give its scale"
        )
