"""Points of the whole outer surface of a vessel above the water: the truth that restoration is held to."""

import numpy as np
import trimesh

from shipshape_lab.simulator.vessel import Vessel

VIEW_AZIMUTHS = 24
VIEW_ELEVATIONS_DEG = (0.0, 15.0, 35.0, 60.0)
VIEW_STRIDE = 37
MAX_ROUNDS = 40


def sample_surface(vessel: Vessel, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points spread evenly over what can be seen of a vessel from outside, above the water.

    A point counts as visible if the straight way from it to one of 97 far viewpoints (rings of azimuths at
    several elevations, and straight above) leaves the hull without meeting it again.

    Args:
        vessel: the hull, in the vessel frame.
        count: how many points.
        rng: the only source of chance.

    Returns:
        Points in the vessel frame, metres, shape (count, 3), float32.

    Raises:
        ValueError: if hardly anything of the hull can be seen from outside.
    """
    kept = np.zeros((0, 3), np.float32)
    drawn = 0
    for _ in range(MAX_ROUNDS):
        share = max(len(kept) / drawn, 0.05) if drawn else 1.0
        draw = int(1.02 * (count - len(kept)) / share) + 10
        points, triangles = trimesh.sample.sample_surface(vessel.mesh, draw, seed=rng)
        dry = points[:, 2] >= 0.0
        points, normals = points[dry], vessel.mesh.face_normals[triangles[dry]]
        kept = np.concatenate([kept, points[_visible(vessel, points, normals)].astype(np.float32)])
        drawn += draw
        if len(kept) >= count:
            return kept[:count]
    raise ValueError(f"hull {vessel.name!r} must show an outer surface above the water, but hardly any was found")


def _visible(vessel: Vessel, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    # Starting a little off the surface keeps a ray from meeting its own triangle; soups may face either way,
    # so the start goes to the viewer's side.
    lift = 1e-4 * float(vessel.mesh.extents.max())
    visible = np.zeros(len(points), dtype=bool)
    for view in _views():
        slopes = normals @ view
        left = np.flatnonzero(~visible & (np.abs(slopes) > 0.05))
        if len(left) == 0:
            continue
        starts = points[left] + lift * np.sign(slopes[left])[:, None] * normals[left]
        blocked = vessel.rays.intersects_any(starts, np.broadcast_to(view, starts.shape))
        visible[left[~blocked]] = True
    return visible


def _views() -> np.ndarray:
    azimuths = np.arange(VIEW_AZIMUTHS) * 2 * np.pi / VIEW_AZIMUTHS
    lifts = np.radians(VIEW_ELEVATIONS_DEG)
    turn, lift = (grid.ravel() for grid in np.meshgrid(azimuths, lifts))
    ring = np.column_stack([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    views = np.vstack([[0.0, 0.0, 1.0], ring])
    # Neighbouring views see much the same, so a stride spreads the first ones all round: most points are
    # settled early and are not cast again.
    return views[np.arange(len(views)) * VIEW_STRIDE % len(views)]
