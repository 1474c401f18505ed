"""Sailing yacht under bare poles, about 11 m: fine hull, coachroof, cockpit, mast, boom, rigging, pulpits."""

from dataclasses import dataclass, field, replace

import numpy as np

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block, cone, rod, rods, tube
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class SailingYacht:
    """Parameters of a sailing_yacht."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=11.5,
            beam=3.5,
            bow_height=1.4,
            mid_height=1.1,
            stern_height=1.12,
            bulwark=0.06,
            bow_rake=1.0,
            stern_rake=-0.6,
            transom=0.7,
            waterline=0.78,
            shoulder=0.4,
            fullness=2.0,
            entry=1.5,
            flare=1.2,
        )
    )
    coachroof: House = field(
        default_factory=lambda: House(0.38, 4.4, 1.9, 0.42, front_rake=1.5, taper=0.55, tumblehome=0.2)
    )
    mast_at: float = 0.58  # t
    mast_height: float = 14.0  # m above deck
    boom: float = 4.2  # m
    boom_height: float = 1.5  # m above deck
    coaming: float = 0.35  # m, cockpit sides above deck
    rail_height: float = 0.62  # m
    spray_hood: bool = True
    bimini: bool = False  # sun roof over the cockpit
    furled_jib: bool = True
    stowed_main: bool = True  # sail along the boom
    crew: int = 2

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        return replace(self, coachroof=self.coachroof.fitted(self.hull, gangway=0.4))._assembled()

    def _assembled(self) -> Shape:
        roof = self.coachroof.plain().moved(x=self.hull.x(self.coachroof.aft), z=self.coachroof.foot(self.hull))
        lifelines = fit.rails(self.hull.edge(0.03, 0.97, count=11, inset=0.1), self.rail_height, wires=2)
        return joined([self.hull.shape(), roof, lifelines, *self._rig(), *self._cockpit(), *self._covers()])

    def _rig(self) -> list[Shape]:
        x, z, top = self.hull.x(self.mast_at), self.hull.deck(self.mast_at), self.mast_height
        gooseneck = z + self.boom_height
        mast = cone(0.1, 0.07, top, sides=8).moved(x=x, z=z)
        boom = rod((x, 0.0, gooseneck), (x - self.boom, 0.0, gooseneck + 0.1), 0.09, 8)
        head, stem = (x, 0.0, z + top * 0.97), (self.hull.x(0.985), 0.0, self.hull.bow_height)
        chain = (x - 0.2, float(self.hull.half_beam(self.mast_at)) - 0.1, z)
        spreader = (x - 0.15, 0.9, z + 0.5 * top)
        stays = [(head, (self.hull.x(0.01), 0.0, self.hull.stern_height)), (head, stem)]
        shrouds = [(chain, spreader), (spreader, head), ((x, 0.0, z + 0.5 * top), spreader)]
        parts = [mast, boom, rods(np.array(stays), 0.012), both_sides(rods(np.array(shrouds), 0.012))]
        if self.furled_jib:
            parts.append(rod(stem, tuple(np.array(stem) + 0.93 * (np.array(head) - stem)), 0.06, 6))
        if self.stowed_main:
            sail = np.array([[x - 0.2, 0.0, gooseneck + 0.25], [x - self.boom + 0.2, 0.0, gooseneck + 0.2]])
            parts.append(tube(sail, np.array([0.2, 0.12])))
        return parts

    def _cockpit(self) -> list[Shape]:
        x, z = self.hull.x(0.2), self.hull.deck(0.2)
        side = self.hull.beam * 0.27
        coaming = both_sides(block(3.2, 0.25, self.coaming, chamfer=0.05).moved(x=x, y=side, z=z))
        wheel = rod((x - 0.8, 0.0, z + 0.6), (x - 0.75, 0.0, z + 0.6), 0.45, 12)
        people = [
            fit.seated(1.2)
            .turned(1.57 - 3.14 * (i % 2))
            .moved(x=x + 0.7 * (i // 2), y=side * (-1 + 2 * (i % 2)), z=z)
            for i in range(self.crew)
        ]
        return [coaming, wheel, cone(0.12, 0.1, 0.8).moved(x=x - 0.6, z=z), *people]

    def _covers(self) -> list[Shape]:
        parts = []
        if self.spray_hood:
            hood = House(0.0, 1.3, 1.9, 0.85, front_rake=0.8, tumblehome=0.2).plain()
            parts.append(hood.moved(x=self.hull.x(self.coachroof.aft) - 0.3, z=self.hull.deck(0.4) + 0.2))
        if self.bimini:
            x, z = self.hull.x(0.18), self.hull.deck(0.18)
            parts.append(block(1.9, 2.0, 0.08, chamfer=0.05).moved(x=x, z=z + 1.95))
            parts.append(both_sides(rods([[[x + e, 1.0, z], [x + e, 0.95, z + 1.95]] for e in (-0.8, 0.8)], 0.02)))
        return parts
