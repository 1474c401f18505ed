"""Outsiders: things that a LiDAR on the water meets and that no model was ever trained on; set U is made of them.

Unlike the strangers, which teach what "unknown" looks like, these are real kinds of things: buoys, piles, quays,
jetties, barges, rocks, pontoons, foundations and towers. Each is parametric; a seed gives one of its kind. All
stand in the vessel frame with their longer side along x, z = 0 on the water, nothing below it.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from trimesh.creation import box, cone, cylinder, icosphere

from shipshape_lab.simulator.vessel import Vessel
from shipshape_lab.simulator.vessels.shape import Shape, above_water

Solid = trimesh.Trimesh
DEEP = 1.0  # m; solids reach below the water and are cut there
SECTIONS = 20


@dataclass(frozen=True)
class Outsider:
    """One kind of thing, built as a catalogue's entries are."""

    name: str

    def build(self, seed: int | None) -> Vessel:
        """One of its kind; None gives the same as seed 0."""
        rng = np.random.default_rng([OUTSIDER_TYPES.index(self.name), seed or 0])
        return Vessel(self.name, _afloat(_BUILDERS[self.name](rng)), seed)


def _afloat(solids: list[Solid]) -> Solid:
    """The solids as one, cut at the water, middle on the origin, longer side along x."""
    whole = trimesh.util.concatenate(solids)
    dry = above_water(Shape(np.asarray(whole.vertices), np.asarray(whole.faces)))
    low, high = dry.vertices.min(axis=0), dry.vertices.max(axis=0)
    vertices = dry.vertices - (low + high) / 2 * [1.0, 1.0, 0.0]
    if high[1] - low[1] > high[0] - low[0]:
        vertices = vertices[:, [1, 0, 2]] * [1.0, -1.0, 1.0]
    return trimesh.Trimesh(vertices, dry.faces, process=False)


def _buoy(rng: np.random.Generator) -> list[Solid]:
    """A navigation buoy: float, tapering lattice cage, topmark."""
    radius, height = rng.uniform(0.9, 1.8), rng.uniform(3.0, 6.5)
    cage = [_bar(0.06, radius * 0.8 * leg, 0.15 * radius * leg, 0.6, height) for leg in _ring(4)]
    rings = [_drum(0.85 * radius * (1.0 - 0.6 * z / height), z, z + 0.12) for z in (0.4 * height, 0.7 * height)]
    topmark = _drum(0.35, height, height + 0.7) if rng.random() < 0.5 else _ball(0.4, height + 0.4)
    panel = _block((0.9 * radius, 0.05, 0.25 * height), z=0.5 * height)
    return [_drum(radius, -DEEP, 0.7), *cage, *rings, panel, topmark]


def _dolphin(rng: np.random.Generator) -> list[Solid]:
    """A mooring dolphin: raking piles under a concrete cap, with bollards and perhaps a ladder platform."""
    spread, top = rng.uniform(1.2, 3.5), rng.uniform(2.5, 5.0)
    piles = [_bar(rng.uniform(0.25, 0.5), spread * 1.3 * leg, spread * 0.8 * leg, -DEEP, top) for leg in _ring(6)]
    cap = _drum(spread, top, top + rng.uniform(0.6, 1.4))
    bollards = [_drum(0.2, top, top + 2.0, x=0.5 * spread * side) for side in (-1.0, 1.0)]
    fender = _block((0.4, 1.2, top), x=spread * 1.1, z=top / 2)
    return [*piles, cap, *bollards, fender]


def _quay(rng: np.random.Generator) -> list[Solid]:
    """A length of quay wall with bollards, fenders and now and then a shed."""
    length, depth, top = rng.uniform(15.0, 40.0), rng.uniform(4.0, 10.0), rng.uniform(1.5, 4.0)
    places = np.arange(-length / 2 + 1.5, length / 2, rng.uniform(4.0, 7.0))
    wall = _block((length, depth, top + DEEP), z=(top - DEEP) / 2)
    bollards = [_drum(0.25, top, top + 0.6, x=x, y=-depth / 2 + 0.6) for x in places]
    fenders = [_block((0.8, 0.5, top), x=x + 1.0, y=-depth / 2 - 0.25, z=top / 2) for x in places]
    house = (rng.uniform(4.0, 0.4 * length), 0.5 * depth, rng.uniform(2.5, 4.0))
    shed = [_block(house, x=rng.uniform(-0.25, 0.25) * length, y=0.15 * depth, z=top + house[2] / 2)]
    return [wall, *bollards, *fenders, *(shed if rng.random() < 0.5 else [])]


def _jetty(rng: np.random.Generator) -> list[Solid]:
    """A jetty on two rows of piles with a railing."""
    length, breadth, top = rng.uniform(10.0, 35.0), rng.uniform(1.8, 4.0), rng.uniform(1.2, 3.0)
    places = np.linspace(-length / 2 + 0.5, length / 2 - 0.5, int(length / rng.uniform(2.5, 4.5)) + 2)
    sides = (-breadth / 2 + 0.2, breadth / 2 - 0.2)
    piles = [_drum(0.16, -DEEP, top, x=x, y=y) for x in places for y in sides]
    posts = [_drum(0.04, top, top + 1.1, x=x, y=sides[0]) for x in places]
    rail = _block((length, 0.06, 0.06), y=sides[0], z=top + 1.1)
    hut = [_block((2.0, 1.6, 2.3), x=0.4 * length, z=top + 1.3)] if rng.random() < 0.4 else []
    return [_block((length, breadth, 0.25), z=top), *piles, *posts, rail, *hut]


def _barge(rng: np.random.Generator) -> list[Solid]:
    """A dumb barge with stacks of containers, no wheelhouse."""
    length, breadth, side = rng.uniform(18.0, 45.0), rng.uniform(6.0, 10.0), rng.uniform(0.8, 2.2)
    bays, rows = int((length - 3.0) // 6.6), int((breadth - 0.6) // 2.5)
    stacks = rng.integers(0, 4, (bays, rows))
    boxes = [
        _block(
            (6.1, 2.44, 2.6), x=(i - (bays - 1) / 2) * 6.6, y=(j - (rows - 1) / 2) * 2.5, z=side + 1.3 + 2.6 * tier
        )
        for i in range(bays)
        for j in range(rows)
        for tier in range(stacks[i, j])
    ]
    return [_block((length, breadth, side + DEEP), z=(side - DEEP) / 2), *boxes]


def _rock(rng: np.random.Generator) -> list[Solid]:
    """One to four boulders that stick out of the water."""
    return [_boulder(rng) for _ in range(rng.integers(1, 5))]


def _boulder(rng: np.random.Generator) -> Solid:
    ball = icosphere(subdivisions=3, radius=1.0)
    waves, phases = rng.normal(0.0, 2.0, (6, 3)), rng.uniform(0.0, 2 * np.pi, 6)
    bumps = 1.0 + 0.11 * np.sin(ball.vertices @ waves.T + phases).sum(axis=1)
    ball.vertices *= bumps[:, None] * rng.uniform([2.0, 1.5, 1.0], [6.0, 4.0, 4.0])
    ball.apply_translation([rng.uniform(-4.0, 4.0), rng.uniform(-2.0, 2.0), rng.uniform(-0.5, 0.3)])
    return ball


def _pontoon(rng: np.random.Generator) -> list[Solid]:
    """A moored pontoon between guide piles, with a cabin or a crane mast, and a gangway."""
    length, breadth, side = rng.uniform(8.0, 25.0), rng.uniform(3.0, 8.0), rng.uniform(0.5, 1.2)
    piles = [
        _drum(0.25, -DEEP, rng.uniform(3.0, 6.0), x=x, y=breadth / 2 + 0.4) for x in (-length / 3, length / 3)
    ]
    cabin = _block((rng.uniform(2.5, 4.0), 2.3, 2.6), x=rng.uniform(-0.3, 0.3) * length, z=side + 1.3)
    crane = _drum(0.3, side, side + rng.uniform(4.0, 8.0), x=0.35 * length)
    gangway = _block((0.6 * length, 1.0, 0.2), x=-0.2 * length, y=-breadth / 2 - 0.5, z=side + 0.8)
    deck = _block((length, breadth, side + DEEP), z=(side - DEEP) / 2)
    return [deck, *piles, cabin if rng.random() < 0.6 else crane, gangway]


def _monopile(rng: np.random.Generator) -> list[Solid]:
    """The foundation of an offshore turbine: transition piece, working platform, tower, boat landing."""
    radius, deck, top = rng.uniform(2.0, 3.5), rng.uniform(8.0, 13.0), rng.uniform(20.0, 40.0)
    tower = cone(radius=0.85 * radius, height=2.5 * (top - deck), sections=SECTIONS)
    tower.apply_translation([0.0, 0.0, deck])
    landing = [_drum(0.2, -DEEP, 0.7 * deck, x=radius + 0.8, y=y) for y in (-0.8, 0.8)]
    return [_drum(radius, -DEEP, deck), _drum(1.7 * radius, deck, deck + 0.4), tower, *landing]


def _tower(rng: np.random.Generator) -> list[Solid]:
    """A lattice tower: four legs that lean in, braces, a platform with a box."""
    half, height = rng.uniform(2.0, 4.5), rng.uniform(8.0, 18.0)
    levels = np.linspace(0.0, 1.0, rng.integers(3, 6))
    legs = [_bar(0.2, half * leg, 0.5 * half * leg, -DEEP, height) for leg in _ring(4)]
    frames = [
        _block((2 * wide, 0.15, 0.15), y=side * wide, z=share * height)
        for share in levels
        for wide in [half * 0.7 * (1.0 - 0.5 * share)]
        for side in (-1.0, 1.0)
    ]
    deck = _block((1.6 * half, 1.6 * half, 0.3), z=height)
    return [*legs, *frames, deck, _block((half, half, 2.5), z=height + 1.3)]


_BUILDERS = {
    "buoy": _buoy,
    "dolphin": _dolphin,
    "quay": _quay,
    "jetty": _jetty,
    "container_barge": _barge,
    "rock": _rock,
    "pontoon": _pontoon,
    "monopile": _monopile,
    "lattice_tower": _tower,
}
OUTSIDER_TYPES = tuple(_BUILDERS)


def _ring(count: int) -> np.ndarray:
    """Unit vectors (count, 2) all round, the first one halfway between two axes."""
    turns = (np.arange(count) + 0.5) * 2 * np.pi / count
    return np.column_stack([np.cos(turns), np.sin(turns)])


def _block(size: tuple[float, float, float], *, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
    solid = box(size)
    solid.apply_translation([x, y, z])
    return solid


def _drum(radius: float, low: float, high: float, *, x: float = 0.0, y: float = 0.0) -> Solid:
    solid = cylinder(radius=radius, height=high - low, sections=SECTIONS)
    solid.apply_translation([x, y, (low + high) / 2])
    return solid


def _bar(radius: float, foot: np.ndarray, head: np.ndarray, low: float, high: float) -> Solid:
    """A round bar from (*foot, low) to (*head, high)."""
    return cylinder(radius=radius, segment=np.array([[*foot, low], [*head, high]]), sections=8)


def _ball(radius: float, z: float) -> Solid:
    solid = icosphere(subdivisions=2, radius=radius)
    solid.apply_translation([0.0, 0.0, z])
    return solid
