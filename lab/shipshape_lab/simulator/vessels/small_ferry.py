"""Small passenger ferry, about 20 m: long two-deck cabin with rows of windows, wheelhouse forward on top."""

from dataclasses import dataclass, field, replace

import numpy as np

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block, rods
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class SmallFerry:
    """Parameters of a small_ferry."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=20.5,
            beam=6.2,
            bow_height=2.3,
            mid_height=1.6,
            stern_height=1.6,
            bulwark=0.5,
            bow_rake=1.3,
            stern_rake=0.3,
            transom=0.88,
            waterline=0.92,
            shoulder=0.55,
            fullness=2.8,
            entry=1.9,
            flare=1.3,
        )
    )
    cabin: House = field(
        default_factory=lambda: House(
            0.12, 13.2, 5.2, 2.6, front_rake=0.8, aft_rake=0.1, tumblehome=0.1, taper=0.85, facet=0.5
        )
    )
    bridge: House = field(
        default_factory=lambda: House(
            0.54, 3.2, 3.4, 2.3, front_rake=0.3, aft_rake=0.1, tumblehome=0.15, taper=0.9, facet=0.35
        )
    )
    awning: float = 6.6  # m, length of the roof over the upper deck
    awning_height: float = 2.2  # m above the upper deck
    mast_height: float = 2.2  # m above the wheelhouse roof
    rail_height: float = 1.05  # m
    funnel_height: float = 1.8  # m above the upper deck
    has_awning: bool = True
    has_funnel: bool = True
    benches: int = 4
    rafts: int = 2
    passengers: int = 3

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        cabin = self.cabin.fitted(self.hull, gangway=0.35)
        return replace(self, cabin=cabin, bridge=self.bridge.carried(cabin, self.hull))._assembled()

    def _assembled(self) -> Shape:
        hull = [self.hull.shape(), self.hull.strake(0.12, drop=0.45)]
        return joined(
            [*hull, *self._houses(), *self._upper_deck(), *self._awning(), *self._mast(), *self._rails()]
        )

    def _upper(self) -> float:
        """Height of the upper deck, metres above water."""
        return self.cabin.foot(self.hull) + self.cabin.height + 0.1

    def _houses(self) -> list[Shape]:
        cabin = self.cabin.glazed(sill=0.45, head=0.82, brow=0.1)
        bridge = self.bridge.glazed(sill=0.45, head=0.87, brow=0.15)
        x = self.hull.x(self.cabin.aft)
        pillars = np.linspace(0.12, 0.88, 7) * self.cabin.length
        half = self.cabin.width / 2 * (1.0 - (1.0 - self.cabin.taper) * pillars / self.cabin.length) - 0.1
        feet = np.column_stack(
            [pillars + x, half, np.full(7, self.cabin.foot(self.hull) + 0.4 * self.cabin.height)]
        )
        posts = both_sides(_upright(feet, 0.45 * self.cabin.height, 0.09))
        return [
            cabin.moved(x=x, z=self.cabin.foot(self.hull)),
            posts,
            bridge.moved(x=self.hull.x(self.bridge.aft), z=self._upper()),
        ]

    def _upper_deck(self) -> list[Shape]:
        x, z, step = self.hull.x(self.cabin.aft), self._upper(), 1.3
        parts = []
        for i in range(self.benches):
            parts.append(both_sides(block(0.45, 1.5, 0.45).moved(x=x + 2.6 + step * i, y=1.15, z=z)))
            parts.append(both_sides(block(0.08, 1.5, 0.9).moved(x=x + 2.35 + step * i, y=1.15, z=z)))
        for i in range(self.passengers):
            parts.append(fit.seated(1.3).moved(x=x + 2.6 + step * (i % 4), y=1.4 - 2.4 * (i % 2), z=z))
        for i in range(self.rafts):
            parts.append(fit.raft_canister().moved(x=x + 0.9, y=1.8 - 3.6 * (i % 2), z=z))
        if self.has_funnel:
            parts.append(fit.stack(self.funnel_height, length=1.2, width=0.9).moved(x=x + 0.9, z=z))
        return parts

    def _awning(self) -> list[Shape]:
        if not self.has_awning:
            return []
        front, z, half = self.hull.x(self.bridge.aft), self._upper(), self.cabin.width * 0.43
        length = min(self.awning, front - self.hull.x(self.cabin.aft) - 0.3)  # it stands on the cabin roof
        x = front - length
        roof = block(length, 2 * half, 0.1, chamfer=0.05).moved(x=x + length / 2, z=z + self.awning_height)
        along = np.linspace(0.1, length - 0.1, 4) + x
        feet = np.column_stack([along, np.full(4, half - 0.1), np.full(4, z)])
        posts = _upright(feet, self.awning_height, 0.035)
        return [roof, both_sides(posts)]

    def _mast(self) -> list[Shape]:
        x, z = self.hull.x(self.bridge.aft) + 0.8, self._upper() + self.bridge.height
        radar = fit.open_radar(1.2).moved(x=x + 0.8, z=z + 0.1)
        return [
            fit.pole_mast(self.mast_height, spread=0.6).moved(x=x, z=z),
            radar,
            fit.whip(2.0).moved(x=x, y=1.0, z=z),
        ]

    def _rails(self) -> list[Shape]:
        ring = self.cabin.ring(1.0, inset=0.1, rise=0.1)
        corner = np.array([self.hull.x(self.cabin.aft), 0.0, self.cabin.foot(self.hull)])
        side = np.linspace(ring[0], ring[5] - np.array([0.3, 0.0, 0.0]), 9) + corner
        bow = fit.rails(self.hull.edge(0.78, 0.97, count=6, inset=0.1), self.rail_height * 0.6, wires=2)
        across = np.stack([side[0], side[0] * [1.0, -1.0, 1.0]])
        return [fit.rails(side, self.rail_height, wires=3), fit.rail(across, self.rail_height, wires=3), bow]


def _upright(feet: np.ndarray, height: float, radius: float) -> Shape:
    """Posts of a height and radius in metres on feet (n, 3)."""
    return rods(np.stack([feet, feet + np.array([0.0, 0.0, height])], axis=1), radius)
