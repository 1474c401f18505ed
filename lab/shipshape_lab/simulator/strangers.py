"""Strangers: hulls and things of no catalogue, drawn at random, which teach a model what "unknown" looks like.

The types that a catalogue leaves out are few, and a network that knows only them takes everything else for a
vessel of the catalogue. A `stray_hull` is a vessel of the generator stretched far out of its own size; a
`stray_thing` is a heap of simple solids: a quay, a pile, a stack of boxes.
"""

import numpy as np
import trimesh

from shipshape_lab.simulator.vessel import Vessel
from shipshape_lab.simulator.vessels import VESSEL_TYPES, build_vessel
from shipshape_lab.simulator.vessels.shape import Shape, above_water

STRANGER_TYPES = ("stray_hull", "stray_thing")
LENGTHS = (3.0, 90.0)  # m; strangers are drawn again until they fit
LEAST_STRETCH = 0.35  # |log(length / own length)|: beyond what a sister hull's 12 % can reach
MOST_STRETCH = 1.2


def build_stranger(name: str, seed: int) -> Vessel:
    """One stranger, cut at the waterline, in the vessel frame, metres; its longer side lies along x.

    Args:
        name: one of `STRANGER_TYPES`.
        seed: which one; hulls of two seeds are stretched from sisters of different seeds too.

    Raises:
        ValueError: the name is not a stranger's.
    """
    if name not in STRANGER_TYPES:
        raise ValueError(f"Unknown stranger {name!r}: expected one of {', '.join(STRANGER_TYPES)}.")
    rng = np.random.default_rng([len(VESSEL_TYPES) + STRANGER_TYPES.index(name), seed])
    draw = _stray_hull if name == "stray_hull" else _stray_thing
    while True:
        mesh = draw(seed, rng)
        if LENGTHS[0] <= float(np.ptp(mesh.vertices[:, 0])) <= LENGTHS[1]:
            return Vessel(name, mesh, seed)


def _stray_hull(seed: int, rng: np.random.Generator) -> trimesh.Trimesh:
    own = build_vessel(str(rng.choice(VESSEL_TYPES)), seed).mesh
    stretch = rng.choice([-1.0, 1.0]) * rng.uniform(LEAST_STRETCH, MOST_STRETCH)
    # Longer vessels are slimmer and lower for their length, with much chance on top.
    factors = np.exp([stretch, rng.normal(0.7 * stretch, 0.2), rng.normal(0.6 * stretch, 0.3)])
    return trimesh.Trimesh(own.vertices * factors, own.faces, process=False)


def _stray_thing(seed: int, rng: np.random.Generator) -> trimesh.Trimesh:
    size = np.exp(rng.uniform(np.log(3.0), np.log(40.0)))
    parts = [_solid(size, rng) for _ in range(rng.integers(1, 7))]
    whole = trimesh.util.concatenate(parts)
    dry = above_water(Shape(np.asarray(whole.vertices), np.asarray(whole.faces)))
    low, high = dry.vertices.min(axis=0), dry.vertices.max(axis=0)
    vertices = dry.vertices - (low + high) / 2 * np.array([1.0, 1.0, 0.0])
    if high[1] - low[1] > high[0] - low[0]:
        vertices = vertices @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return trimesh.Trimesh(vertices, dry.faces, process=False)


def _solid(size: float, rng: np.random.Generator) -> trimesh.Trimesh:
    length, breadth = size * rng.uniform(0.1, 1.0), size * rng.uniform(0.05, 0.6)
    height = min(rng.uniform(0.5, 6.0) * rng.choice([1.0, 2.0]), 1.2 * size)
    kind = rng.choice(["box", "cylinder", "cone", "ball"])
    if kind == "box":
        solid = trimesh.creation.box([length, breadth, height])
    elif kind == "cylinder":
        solid = trimesh.creation.cylinder(radius=breadth / 2, height=height, sections=16)
    elif kind == "cone":
        solid = trimesh.creation.cone(radius=breadth / 2, height=height, sections=16)
    else:
        solid = trimesh.creation.icosphere(subdivisions=2, radius=min(breadth, 2 * height) / 2)
    solid.apply_transform(trimesh.transformations.rotation_matrix(rng.uniform(0, np.pi), [0, 0, 1]))
    x, y = size * rng.uniform(-0.3, 0.3, 2)
    # Every solid stands in the water or up to two metres above it, as a deck on another one would.
    solid.apply_translation([x, y, rng.choice([0.0, rng.uniform(0.0, 2.0)]) - solid.bounds[0, 2] - 0.05])
    return solid
