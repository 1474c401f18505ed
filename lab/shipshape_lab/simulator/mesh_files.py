"""Vessels from mesh files: PLY, STL, OBJ, GLB, DAE; in comes a file, out goes a `Vessel` in the vessel frame.

The file's axes must be those of the vessel frame (x to the bow, y to port, z up), except for GLB: glTF fixes
y up and z forward, so its axes are turned. A unit that the file declares (DAE) is brought to metres first.
"""

from pathlib import Path

import numpy as np
import trimesh
from trimesh.units import unit_conversion

from shipshape_lab.simulator.vessel import Vessel

SUFFIXES = (".ply", ".stl", ".obj", ".glb", ".dae")
SHORTEST, LONGEST = 1.0, 500.0

# glTF: x to port, y up, z to the bow.
T_VESSEL_GLTF = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=float)


def load_vessel(
    path: str | Path, *, name: str | None = None, scale: float = 1.0, waterline: float = 0.0
) -> Vessel:
    """Reads a mesh, cuts it at the waterline and puts the origin under the middle of what is left.

    Args:
        path: the file; its suffix says its format.
        name: type name; the file's stem if None.
        scale: factor on the file's size; metres in one unit of a file that declares no unit.
        waterline: height of the waterline in the file's frame after scaling, metres.

    Returns:
        The part above the waterline, in the vessel frame.

    Raises:
        ValueError: if the file cannot be read, is empty, has nothing above the waterline or an absurd size.
    """
    path = Path(path)
    mesh = _read(path)
    mesh.apply_scale(scale)
    mesh.apply_translation([0.0, 0.0, -waterline])
    above = mesh.slice_plane([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    if above is None or len(above.faces) == 0:
        raise ValueError(f"{path} must have a part above the waterline at {waterline} m, but has none")
    _check_size(path, above)
    middle = above.bounds.mean(axis=0)
    above.apply_translation([-middle[0], -middle[1], 0.0])
    return Vessel(name or path.stem, above)


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
    return mesh.apply_transform(T_VESSEL_GLTF) if suffix == ".glb" else mesh


def _check_size(path: Path, mesh: trimesh.Trimesh) -> None:
    length = float(mesh.extents[:2].max())
    if not SHORTEST <= length <= LONGEST:
        raise ValueError(
            f"{path} must be {SHORTEST:.0f} to {LONGEST:.0f} m long, but is {length:.4g} m; give its scale"
        )
