"""Landing craft, about 18 m: square bow closed by a ramp, high side walls about an open well, house aft."""

from dataclasses import dataclass, field, replace

import numpy as np

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block, loft, rod
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class LandingCraft:
    """Parameters of a landing_craft."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=18.0,
            beam=5.4,
            bow_height=2.3,
            mid_height=1.8,
            stern_height=1.8,
            bulwark=1.15,
            bow_rake=1.3,
            stern_rake=-0.2,
            transom=0.96,
            waterline=0.96,
            shoulder=0.7,
            fullness=2.0,
            entry=2.0,
            bow_breadth=0.8,
            flare=1.0,
        )
    )
    house: House = field(
        default_factory=lambda: House(0.06, 2.6, 3.2, 2.7, front_rake=0.1, tumblehome=0.08, taper=1.0, facet=0.05)
    )
    engine_deck: float = 4.6  # m, length of the raised deck aft
    ramp_height: float = 2.9  # m above water
    ramp_lean: float = 0.5  # m, ramp's top ahead of its foot
    mast_height: float = 2.4  # m above the roof
    side_wall: float = 0.45  # m, breadth of the hollow side walls
    cargo_at: float = 0.6  # t
    cargo_length: float = 4.4  # m
    cargo_height: float = 1.6  # m
    cargo: bool = False  # a vehicle in the well
    crates: int = 1
    radar: bool = True
    rail_height: float = 0.9  # m

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        return replace(self, house=self.house.fitted(self.hull))._assembled()

    def _assembled(self) -> Shape:
        hull = [
            self.hull.shape(),
            self.hull.strake(0.1, drop=0.3, end=0.99),
            self._side_walls(),
            self._ramp(),
        ]
        return joined([*hull, *self._after_part(), *self._mast(), *self._load()])

    def _side_walls(self) -> Shape:
        """Box-like sides: their inner faces stand `side_wall` metres inside the cap, down to the deck."""
        cap = self.hull.edge(0.02, 0.97, count=10)
        cap[:, 1] -= 0.01
        foot = self.hull.below_edge(0.02, 0.97, drop=self.hull.bulwark, count=10)
        foot[:, 1] -= 0.05
        inner = cap.copy()
        inner[:, 1] = np.minimum(cap[:, 1], foot[:, 1]) - self.side_wall
        inner_foot = np.column_stack([inner[:, :2], foot[:, 2]])
        return both_sides(loft(np.stack([cap, foot, inner_foot, inner], axis=1)))

    def _ramp(self) -> Shape:
        x, half = self.hull.x(1.0) - 0.2, self.hull.beam * min(self.hull.bow_breadth, 1.0) / 2
        foot = np.array([[0.0, half], [-0.15, half], [-0.15, -half], [0.0, -half]])
        low = np.column_stack([foot[:, 0] + x - self.hull.bow_rake * 0.6, foot[:, 1], np.full(4, 0.5)])
        high = np.column_stack([foot[:, 0] + x + self.ramp_lean, foot[:, 1] * 0.95, np.full(4, self.ramp_height)])
        post = rod((x - 0.6, half, 1.0), (x - 0.6, half, self.ramp_height + 0.1), 0.15)
        return joined([loft(np.stack([low, high])), both_sides(post)])

    def _after_part(self) -> list[Shape]:
        height = self.hull.bulwark
        x, floor = self.hull.x(0.015) + self.engine_deck / 2, self.hull.deck(0.1)
        half = min(self.hull.reach(self.hull.x(0.03), floor), float(self.hull.half_beam(0.0))) - 0.1
        deck = block(self.engine_deck, 2.0 * half, height).moved(x=x, z=floor)
        house = self.house.glazed(sill=0.55, head=0.87, brow=0.15)
        path = self.hull.edge(0.01, 0.27, count=6, inset=0.1)
        return [
            deck,
            house.moved(x=self.hull.x(self.house.aft), z=floor + height),
            fit.rails(path, self.rail_height),
        ]

    def _mast(self) -> list[Shape]:
        x, z = self.hull.x(self.house.aft) + 0.9, self.hull.deck(0.1) + self.hull.bulwark + self.house.height
        parts = [
            fit.pole_mast(self.mast_height, spread=0.6).moved(x=x, z=z),
            fit.whip(2.5).moved(x=x, y=1.0, z=z),
        ]
        if self.radar:
            parts.append(fit.open_radar(1.2).moved(x=x + 0.7, z=z + 0.1))
        return parts

    def _load(self) -> list[Shape]:
        floor = self.hull.deck(0.5)
        x = self.hull.x(self.cargo_at)
        parts = []
        if self.cargo:
            body = block(self.cargo_length, 1.9, self.cargo_height * 0.55).moved(x=x, z=floor + 0.4)
            cab = block(self.cargo_length * 0.45, 1.8, self.cargo_height * 0.6, chamfer=0.25)
            parts += [body, cab.moved(x=x - 0.2, z=floor + 0.4 + self.cargo_height * 0.55)]
        for i in range(self.crates):
            parts.append(
                block(1.2, 1.0, 1.0).moved(x=self.hull.x(0.36 + 0.08 * (i // 2)), y=0.9 - 1.8 * (i % 2), z=floor)
            )
        return parts
