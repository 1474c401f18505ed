"""What the mesh of a vessel may have wrong, found before anything is trained; every finding says what to do.

The thresholds were set on twelve real meshes and the ten types of the generator, all of them sound.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from shipshape_lab.fleet.openings import seen_through
from shipshape_lab.simulator.catalogue import MeshVessel
from shipshape_lab.simulator.mesh_files import MOST_TRIANGLES, above_water, read_placed, thinned
from shipshape_lab.simulator.vessel import Vessel

SHORTEST, LONGEST = 2.0, 150.0  # m; the service takes no wider contact
UNITS = (
    (0.001, "millimetres"),
    (0.01, "centimetres"),
    (0.0254, "inches"),
    (0.3048, "feet"),
    (1000.0, "kilometres"),
)
SAMPLES = 3000  # points on the surface that the axes are judged by
CLEARLY_MORE_ALIKE = 0.75  # the beam's axis mirrors this much better than any other does
CLEARLY_LONGER = 1.2
WIDER_BOW = 1.1  # of the stern's breadth; double-ended hulls come to 1.0
END = 0.15  # share of the length that counts as an end
AFLOAT = 0.02  # of the length: a keel this far above the waterline is no rounding
DEEPEST = 0.5  # share of the height that may lie under water
MOST_SEEN_THROUGH = 0.12  # sound hulls come to 0.08, sails and nets included


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong or odd: which vessel, what and what to do, and whether it stops the work."""

    vessel: str
    text: str
    stops: bool = False

    def __str__(self) -> str:
        return f"{'error' if self.stops else 'warning'}: {self.vessel} {self.text}"


def check_mesh(entry: MeshVessel) -> tuple[list[Finding], Vessel | None]:
    """What is wrong with one vessel's mesh, and its hull above the water where nothing stops the work."""
    try:
        mesh = read_placed(entry.mesh, entry.placing)
        found = [*_size(entry, mesh)] or [*_axes(entry, mesh)] or [*_waterline(entry, mesh)]
        if any(finding.stops for finding in found):
            return found, None
        vessel = above_water(entry.mesh, mesh, name=entry.name)
    except ValueError as error:
        return [Finding(entry.name, f"cannot be used: {error}", stops=True)], None
    return [*found, *_bow(entry, vessel), *_holes(vessel), *_triangles(entry, mesh)], vessel


def _size(entry: MeshVessel, mesh: trimesh.Trimesh) -> Iterator[Finding]:
    length = float(mesh.extents.max())
    if np.any(mesh.extents < 1e-3 * length):
        sides = " x ".join(f"{side:.4g}" for side in mesh.extents)
        yield Finding(entry.name, f"is flat ({sides} m): export the whole hull, not a drawing of it", stops=True)
    elif not SHORTEST <= length <= LONGEST:
        fitting = [
            f"scale = {entry.placing.scale * factor:.6g} if its unit is {unit}"
            for factor, unit in UNITS
            if SHORTEST <= length * factor <= LONGEST
        ]
        advice = f"give {', or '.join(fitting)}" if fitting else "check its scale"
        text = f"is {length:.5g} m long, expected {SHORTEST:g} to {LONGEST:g} m: {advice}"
        yield Finding(entry.name, text, stops=True)


def _axes(entry: MeshVessel, mesh: trimesh.Trimesh) -> Iterator[Finding]:
    across, along = _across_and_along(mesh)
    if (across, along) == (1, 0):
        return
    up = 3 - across - along
    rotation = entry.placing.rotation(entry.mesh.suffix.lower())
    bow, top = (_file_axis(rotation[axis]) for axis in (along, up))
    what = "does not have z up" if up != 2 else "lies along y"
    text = f'{what}: its mirror plane and its length say bow = "{bow}" and up = "{top}" (or the opposite signs)'
    yield Finding(entry.name, text, stops=True)


def _across_and_along(mesh: trimesh.Trimesh) -> tuple[int, int]:
    """Axes of beam and length, 0 to 2: a vessel mirrors itself across its beam and is longest along its length."""
    points = np.asarray(trimesh.sample.sample_surface(mesh, SAMPLES, seed=0)[0])
    mirrored = np.array([_mirror_error(points, axis) for axis in range(3)])
    best = int(mirrored.argmin())
    across = best if mirrored[best] < CLEARLY_MORE_ALIKE * mirrored[1] else 1
    spread = points.std(axis=0)
    first, second = (axis for axis in range(3) if axis != across)
    return across, second if spread[second] > CLEARLY_LONGER * spread[first] else first


def _mirror_error(points: np.ndarray, axis: int) -> float:
    mirrored = points.copy()
    mirrored[:, axis] = points[:, axis].min() + points[:, axis].max() - points[:, axis]
    return float(cKDTree(points).query(mirrored)[0].mean())


def _file_axis(direction: np.ndarray) -> str:
    axis = int(np.abs(direction).argmax())
    return ("-" if direction[axis] < 0 else "") + "xyz"[axis]


def _waterline(entry: MeshVessel, mesh: trimesh.Trimesh) -> Iterator[Finding]:
    (_, _, low), (_, _, high) = mesh.bounds
    own, length = entry.placing.waterline, float(mesh.extents.max())
    span = f"expected between {low + own:.2f} and {high + own:.2f} m"
    if low > AFLOAT * length or high <= 0.0:
        where = "above" if low > 0.0 else "below"
        text = (
            f"lies wholly {where} its waterline of {own:g} m, {span}: give its waterline, in metres after scaling"
        )
        yield Finding(entry.name, text, stops=True)
    elif -low > DEEPEST * (high - low):
        share = -low / (high - low)
        text = f"has {share:.0%} of its height under water: check its waterline of {own:g} m, {span}"
        yield Finding(entry.name, text)


def _bow(entry: MeshVessel, vessel: Vessel) -> Iterator[Finding]:
    points = np.asarray(trimesh.sample.sample_surface(vessel.mesh, SAMPLES, seed=0)[0])
    length, _, height = vessel.box
    hull = points[points[:, 2] < height / 2]
    ends = [hull[side * hull[:, 0] > (0.5 - END) * length, 1] for side in (1.0, -1.0)]
    if min(map(len, ends)) < 10:
        return
    bow, stern = (float(np.quantile(np.abs(y), 0.9)) for y in ends)
    if bow > WIDER_BOW * stern:
        other = _file_axis(-entry.placing.rotation(entry.mesh.suffix.lower())[0])
        what = f"is {bow / stern:.1f} times as broad at its bow as at its stern"
        yield Finding(vessel.name, f'{what}: if it is turned round, give bow = "{other}"')


def _holes(vessel: Vessel) -> Iterator[Finding]:
    share = seen_through(vessel)
    if share > MOST_SEEN_THROUGH:
        text = (
            f"shows {share:.0%} of its surface from inside too: close its holes, or a LiDAR will look through it"
        )
        yield Finding(vessel.name, text)


def _triangles(entry: MeshVessel, mesh: trimesh.Trimesh) -> Iterator[Finding]:
    if len(mesh.faces) > 2 * MOST_TRIANGLES:
        small, cell = thinned(mesh)
        what = f"has {len(mesh.faces):,} triangles, more than a LiDAR can tell"
        yield Finding(entry.name, f"{what}: {len(small.faces):,} are used, on a grid of {100 * cell:g} cm")
