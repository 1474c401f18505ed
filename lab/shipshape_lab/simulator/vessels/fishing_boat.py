"""Fishing boat, about 16 m: strong sheer, deep bulwarks, wheelhouse amidships, mast, derrick, gallows."""

from dataclasses import dataclass, field, replace

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block, rod
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class FishingBoat:
    """Parameters of a fishing_boat."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=15.8,
            beam=5.2,
            bow_height=3.4,
            mid_height=1.75,
            stern_height=2.05,
            bulwark=0.85,
            bow_rake=1.5,
            stern_rake=0.4,
            transom=0.75,
            waterline=0.92,
            shoulder=0.5,
            fullness=2.6,
            entry=1.8,
            flare=1.3,
        )
    )
    house: House = field(
        default_factory=lambda: House(0.5, 3.4, 3.0, 3.2, front_rake=-0.1, tumblehome=0.08, taper=0.9, facet=0.3)
    )
    trunk: House = field(
        default_factory=lambda: House(0.38, 2.2, 2.6, 1.5, front_rake=0.0, tumblehome=0.05, taper=1.0)
    )
    mast_height: float = 4.6  # m above the wheelhouse roof
    derrick: float = 5.5  # m
    derrick_steep: float = 0.75  # rise of the derrick over its length
    gallows_height: float = 3.2  # m above deck
    gallows_at: float = 0.06  # t
    winch_at: float = 0.31  # t
    hatch: float = 1.5  # m, side of the fish hatch
    has_gallows: bool = True
    has_drum: bool = True  # net drum on the after deck
    has_derrick: bool = True
    has_tyres: bool = False
    boxes: int = 2  # stacks of fish boxes
    crew: int = 1

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        house = self.house.fitted(self.hull, gangway=0.5)
        trunk = replace(self.trunk, width=min(self.trunk.width, house.width - 0.1))
        return replace(self, house=house, trunk=trunk)._assembled()

    def _assembled(self) -> Shape:
        parts = [self.hull.shape(), self.hull.strake(0.09), self.hull.strake(0.07, drop=0.9), *self._houses()]
        parts += [*self._mast(), *self._working_deck(), *self._stern_gear(), *self._bow_gear()]
        return joined(parts)

    def _floor(self) -> float:
        """Deck under the wheelhouse, metres above water."""
        return self.house.foot(self.hull)

    def _houses(self) -> list[Shape]:
        floor = self._floor()
        front = self.house.glazed(sill=0.6, head=0.88, brow=0.2).moved(x=self.hull.x(self.house.aft), z=floor)
        rear = self.trunk.plain().moved(x=self.hull.x(self.house.aft) - self.trunk.length + 0.1, z=floor)
        return [front, rear]

    def _mast(self) -> list[Shape]:
        x, z = self.hull.x(self.house.aft) + 0.5, self._floor() + self.house.height
        top = z + self.mast_height
        parts = [fit.pole_mast(self.mast_height, foot=0.11, spread=0.8).moved(x=x, z=z)]
        parts += [
            both_sides(
                rod(
                    (x, 0.0, top * 0.95),
                    (self.hull.x(0.45), self.hull.beam * 0.46, self.hull.mid_height),
                    0.015,
                    4,
                )
            )
        ]
        parts += [rod((x, 0.0, top * 0.95), (self.hull.x(0.97), 0.0, self.hull.bow_height), 0.015, 4)]
        parts += [fit.open_radar(1.3).moved(x=x + 1.2, z=z + 0.1), fit.whip(3.0).moved(x=x + 0.3, y=1.0, z=z)]
        if self.has_derrick:
            reach = self.derrick * (1.0 - self.derrick_steep**2 * 0.5)
            tip = (x - reach, 0.0, z - 0.6 + self.derrick * self.derrick_steep * 0.7)
            parts += [rod((x - 0.1, 0.0, z - 0.6), tip, 0.08), rod(tip, (x, 0.0, top * 0.97), 0.015, 4)]
        return parts

    def _working_deck(self) -> list[Shape]:
        floor = self.hull.deck(0.3)
        parts = [fit.winch(1.3, 0.4).moved(x=self.hull.x(self.winch_at), z=floor)]
        parts.append(block(self.hatch, self.hatch, 0.55).moved(x=self.hull.x(0.2), z=floor))
        for i in range(self.boxes):
            parts.append(
                block(0.8, 0.6, 0.9 + 0.2 * i).moved(
                    x=self.hull.x(0.13 + 0.05 * i), y=1.3 - 2.6 * (i % 2), z=floor
                )
            )
        for i in range(self.crew):
            parts.append(fit.standing().moved(x=self.hull.x(0.25 - 0.08 * i), y=-1.2 + 2.2 * (i % 2), z=floor))
        return parts

    def _stern_gear(self) -> list[Shape]:
        x, floor = self.hull.x(self.gallows_at), self.hull.deck(0.06)
        parts = []
        if self.has_gallows:
            half, top = self.hull.beam * 0.3, floor + self.gallows_height
            parts.append(both_sides(rod((x, half, floor), (x - 0.3, half * 0.85, top), 0.1)))
            parts.append(rod((x - 0.3, -half, top), (x - 0.3, half, top), 0.1))
        if self.has_drum:
            parts.append(fit.winch(1.8, 0.65).moved(x=x + 0.9, z=floor + 0.3))
        if self.has_tyres:
            parts.append(fit.tyres(self.hull.below_edge(0.1, 0.6, drop=0.6, count=4), 0.35))
        return parts

    def _bow_gear(self) -> list[Shape]:
        floor = self.hull.deck(0.85)
        gear = fit.winch(0.8, 0.3).moved(x=self.hull.x(0.84), z=floor)
        return [
            gear,
            fit.bitts(0.7, 0.5).moved(x=self.hull.x(0.9), z=floor),
            fit.rails(self.hull.edge(0.72, 0.97, count=6, inset=0.08), 0.5, wires=1),
        ]
