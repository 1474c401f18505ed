"""Hulls lofted from a waterline, a deck edge and the stations between them, open inside down to the deck.

Stations run from the transom (t = 0) to the stem (t = 1). On each, the side rises from the waterline to the
bulwark cap, turns in over the cap, drops to the deck and crosses it. Vessel frame, metres.
"""

from dataclasses import dataclass

import numpy as np

from shipshape_lab.simulator.vessels.parts import grid_faces, tube
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined

_STATIONS = 28
_LEVELS = 7  # from waterline to cap
_LOWEST = 0.35  # t at which the sheer is lowest


@dataclass(frozen=True)
class Hull:
    """Shape parameters of one hull, and where its edge and deck lie."""

    length: float  # m, over all
    beam: float  # m, widest at the cap
    bow_height: float  # m, cap above water at the stem
    mid_height: float  # m, cap above water where the sheer is lowest
    stern_height: float  # m, cap above water at the transom
    bulwark: float  # m, cap above deck
    bow_rake: float  # m, stem head ahead of the stem's waterline
    stern_rake: float = 0.0  # m, transom top abaft its waterline; negative slopes forward
    transom: float = 0.85  # transom breadth over beam, at the cap
    waterline: float = 0.9  # waterline breadth over beam, amidships
    shoulder: float = 0.45  # t from which the cap narrows towards the bow
    fullness: float = 2.2  # exponent of the cap's plan forward: 1.6 fine, 4 full
    entry: float = 1.5  # the same at the waterline
    roundness: float = 1.0  # 1 pointed stem, 0.5 round one
    bow_breadth: float = 0.0  # breadth of a blunt bow over beam; 0 for a stem
    flare: float = 1.4  # exponent of the side's section: 1 straight, 2 hollow

    def x(self, t: float) -> float:
        """Metres along the vessel of share t of the length over all, from the aft end."""
        return self.length * (t - 0.5)

    def cap_height(self, t: np.ndarray | float) -> np.ndarray:
        """Height of the bulwark cap, metres above water, at t."""
        t = np.asarray(t, float)
        aft = (self.stern_height - self.mid_height) * np.clip((_LOWEST - t) / _LOWEST, 0.0, 1.0) ** 2
        rise = (self.bow_height - self.mid_height) * np.clip((t - _LOWEST) / (1.0 - _LOWEST), 0.0, 1.0) ** 2
        return self.mid_height + aft + rise

    def deck(self, t: float) -> float:
        """Height of the deck, metres above water, at t."""
        return float(self.cap_height(t)) - self.bulwark

    def half_beam(self, t: np.ndarray | float) -> np.ndarray:
        """Half breadth at the cap, metres, at t."""
        return self.beam / 2 * _plan(np.asarray(t, float), self, self.transom, self.fullness)

    def skin(self, t: np.ndarray, level: np.ndarray | float) -> np.ndarray:
        """Points (..., 3) of the port side at station t and at a share of its height; the shapes broadcast."""
        t, level = np.broadcast_arrays(np.asarray(t, float), np.asarray(level, float))
        wet = self.beam / 2 * min(self.waterline, 0.99) * _plan(t, self, self.transom * 0.95, self.entry)
        half = wet + (self.half_beam(t) - wet) * level**self.flare
        return np.stack([self._along(t, level), half, self.cap_height(t) * level], axis=-1)

    def reach(self, x: float, z: float) -> float:
        """Half breadth of the outer side at x and z, metres; 0 ahead of the stem."""
        t = np.linspace(0.0, 1.0, 40)
        points = self.skin(t, np.clip(z / self.cap_height(t), 0.0, 1.0))
        return float(np.interp(x, points[:, 0], points[:, 1], right=0.0))

    def edge(self, start: float, end: float, *, count: int = 12, inset: float = 0.0) -> np.ndarray:
        """Points (count, 3) along the port cap from t = start to t = end, `inset` metres inboard."""
        points = self.skin(np.linspace(start, end, count), 1.0)
        points[:, 1] = np.maximum(points[:, 1] - inset, 0.0)
        return points

    def below_edge(self, start: float, end: float, *, drop: float, count: int = 12) -> np.ndarray:
        """Points (count, 3) along the port side, `drop` metres below the cap."""
        t = np.linspace(start, end, count)
        return self.skin(t, np.maximum(1.0 - drop / self.cap_height(t), 0.0))

    def shape(self) -> Shape:
        """The bare hull: sides, transom, cap, inside of the bulwark, deck and a floor on the waterline."""
        sections = self._sections()
        skin = Shape(sections.reshape(-1, 3), grid_faces(len(sections), sections.shape[1]))
        return joined([both_sides(skin), _across(sections[0]), _across(sections[-1])])

    def strake(self, radius: float, *, drop: float = 0.15, end: float = 0.97) -> Shape:
        """A rubbing strake on both sides, `drop` metres below the cap."""
        return both_sides(tube(self.below_edge(0.01, end, drop=drop, count=16), radius, sides=6))

    def raised_deck(self, start: float, *, drop: float = 0.08) -> Shape:
        """A deck from t = start to the stem, `drop` metres below the cap, closed aft down to the main deck."""
        lid = self.edge(start, 1.0, count=14, inset=0.05) - np.array([0.0, 0.0, drop])
        foot = self.below_edge(start, start, drop=self.bulwark, count=1) - np.array([0.0, 0.05, 0.0])
        lid = np.concatenate([np.column_stack([lid[:1, 0], foot[:, 1:]]), lid])
        return _across(lid)

    def _sections(self) -> np.ndarray:
        """Port half sections (stations, points, 3), from the keel line up, over the cap and to the centreline."""
        t = 1.0 - (1.0 - np.linspace(0.0, 1.0, _STATIONS)) ** 1.25  # closer together at the bow, where they bend
        outer = self.skin(t[:, None], np.linspace(0.0, 1.0, _LEVELS))
        return np.concatenate([_flat(outer[:, :1]), outer, self._inside(t)], axis=1)

    def _inside(self, t: np.ndarray) -> np.ndarray:
        """Inner edge of the cap, foot of the bulwark and middle of the deck, (stations, 3, 3)."""
        thick = min(0.12, 0.025 * self.beam)
        t = np.clip(t, thick / self.length, 1.0 - 2.0 * thick / self.length)
        top = self.skin(t, 1.0)
        foot = self.skin(t, np.maximum(1.0 - self.bulwark / top[:, 2], 0.0))  # the side leans in below the cap
        foot[:, 0] = np.clip(foot[:, 0], top[0, 0], top[-1, 0])
        top[:, 1] = np.maximum(top[:, 1] - thick, 0.0)
        foot[:, 1] = np.maximum(np.minimum(foot[:, 1] - thick, top[:, 1]), 0.0)
        return np.stack([top, foot, _flat(foot)], axis=1)

    def _along(self, t: np.ndarray, level: np.ndarray) -> np.ndarray:
        """X of stations t: the ends lean by the rakes, and the hull still spans its length over all."""
        stern = -self.length / 2 + np.where(self.stern_rake > 0, 1.0 - level, level) * abs(self.stern_rake)
        stem = self.length / 2 - (1.0 - level) * self.bow_rake
        return stern + t * (stem - stern)


def _across(points: np.ndarray) -> Shape:
    """The wall between a line of port points and its mirror image: a transom, or a deck."""
    rows = np.stack([points, points * np.array([1.0, -1.0, 1.0])])
    return Shape(rows.reshape(-1, 3), grid_faces(2, len(points)))


def _flat(points: np.ndarray) -> np.ndarray:
    """The same points moved to the centreline."""
    return points * np.array([1.0, 0.0, 1.0])


def _plan(t: np.ndarray, hull: Hull, transom: float, power: float) -> np.ndarray:
    """Half breadth at t over the greatest one: widening from the transom, then closing at the stem."""
    aft = 1.0 - (1.0 - min(transom, 1.0)) * np.clip(1.0 - t / hull.shoulder, 0.0, 1.0) ** 2
    ahead = np.clip((t - hull.shoulder) / (1.0 - hull.shoulder), 0.0, 1.0)
    return aft * (1.0 - (1.0 - min(hull.bow_breadth, 1.0)) * ahead**power) ** hull.roundness
