"""Patrol boat, about 27 m: long fine hull, raked bridge, lattice mast, gun forward, tender aft."""

from dataclasses import dataclass, field, replace

import numpy as np

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block, cone, rod, tube
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class PatrolBoat:
    """Parameters of a patrol_boat."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=27.5,
            beam=5.9,
            bow_height=3.5,
            mid_height=2.2,
            stern_height=2.1,
            bulwark=0.1,
            bow_rake=3.0,
            stern_rake=-0.3,
            transom=0.85,
            waterline=0.86,
            shoulder=0.4,
            fullness=2.0,
            entry=1.4,
            flare=1.7,
        )
    )
    lower: House = field(
        default_factory=lambda: House(
            0.28, 11.5, 4.3, 2.3, front_rake=1.1, aft_rake=0.2, tumblehome=0.35, taper=0.75, facet=0.4
        )
    )
    bridge: House = field(
        default_factory=lambda: House(
            0.41, 5.6, 3.6, 2.3, front_rake=1.0, aft_rake=0.3, tumblehome=0.3, taper=0.85, facet=0.4
        )
    )
    mast_height: float = 4.8  # m above the bridge roof
    mast_at: float = 0.3  # share of the bridge's length from aft
    gun_at: float = 0.8  # t
    gun_reach: float = 1.8  # m, barrel
    tender_length: float = 4.6  # m
    tender_at: float = 0.14  # t
    rail_height: float = 1.0  # m
    crane_height: float = 2.6  # m above deck
    has_gun: bool = True
    has_tender: bool = True
    has_crane: bool = True
    has_dome: bool = True  # satellite dome abaft the mast
    rafts: int = 2

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        lower = self.lower.fitted(self.hull, gangway=0.5)
        return replace(self, lower=lower, bridge=self.bridge.carried(lower, self.hull))._assembled()

    def _assembled(self) -> Shape:
        hull = [self.hull.shape(), self.hull.strake(0.07, drop=0.25)]
        return joined(
            [*hull, *self._houses(), *self._mast(), *self._rails(), *self._fore_deck(), *self._after_deck()]
        )

    def _floors(self) -> tuple[float, float]:
        """Floors of the lower house and of the bridge, metres above water."""
        low = self.lower.foot(self.hull)
        return low, low + self.lower.height

    def _houses(self) -> list[Shape]:
        low, high = self._floors()
        lower = self.lower.plain().moved(x=self.hull.x(self.lower.aft), z=low)
        bridge = self.bridge.glazed(sill=0.45, head=0.85, brow=0.15).moved(x=self.hull.x(self.bridge.aft), z=high)
        return [lower, bridge]

    def _mast(self) -> list[Shape]:
        z = self._floors()[1] + self.bridge.height
        x = self.hull.x(self.bridge.aft) + self.mast_at * self.bridge.length
        parts = [fit.lattice_mast(self.mast_height, stance=1.3, lean=0.9).moved(x=x, z=z)]
        parts.append(fit.open_radar(2.0).moved(x=x - 0.9, z=z + 0.81 * self.mast_height))
        parts.append(fit.dome(0.35).moved(x=x + 1.3, z=z + 0.1))
        parts += [fit.whip(3.5, lean=0.2).moved(x=x - 0.3, y=y, z=z) for y in (1.2, -1.2)]
        if self.has_dome:
            parts.append(fit.dome(0.5).moved(x=x - 3.0, z=self._floors()[1]))
        return parts

    def _rails(self) -> list[Shape]:
        bow = fit.rails(self.hull.edge(0.6, 0.98, count=10, inset=0.1), self.rail_height, wires=3)
        return [bow, fit.rails(self.hull.edge(0.0, 0.58, count=14, inset=0.1), self.rail_height, wires=2)]

    def _fore_deck(self) -> list[Shape]:
        x, z = self.hull.x(self.gun_at), self.hull.deck(self.gun_at)
        parts = [fit.winch(0.7, 0.3).moved(x=self.hull.x(0.9), z=self.hull.deck(0.9))]
        if self.has_gun:
            parts += [
                cone(0.6, 0.5, 0.5).moved(x=x, z=z),
                block(1.1, 0.9, 0.7, chamfer=0.15).moved(x=x, z=z + 0.5),
            ]
            parts.append(rod((x + 0.4, 0.0, z + 0.9), (x + 0.4 + self.gun_reach, 0.0, z + 1.05), 0.06))
        return parts

    def _after_deck(self) -> list[Shape]:
        x, z = self.hull.x(self.tender_at), self.hull.deck(0.12)
        parts = [
            fit.raft_canister().moved(
                x=self.hull.x(self.lower.aft) + 0.8 + 1.3 * (i // 2), y=1.3 - 2.6 * (i % 2), z=self._floors()[1]
            )
            for i in range(self.rafts)
        ]
        if self.has_tender:
            half = self.tender_length / 2
            side = tube(self._tender_edge(), 0.22, sides=6)
            floor = block(2 * half - 0.8, 1.2, 0.5).moved(z=-0.35)
            console = block(0.6, 0.6, 0.9, chamfer=0.1)
            parts.append(joined([both_sides(side), floor, console]).moved(x=x, z=z + 0.7))
        if self.has_crane:
            foot = (x + 1.8, -self.hull.beam * 0.33, z)
            top = (foot[0], foot[1], z + self.crane_height)
            parts += [rod(foot, top, 0.15, 8), rod(top, (x - 1.0, -0.3, z + self.crane_height + 0.5), 0.1)]
        return parts

    def _tender_edge(self) -> np.ndarray:
        half = self.tender_length / 2
        return np.array(
            [[-half, 0.75, 0.0], [0.2 * half, 0.75, 0.0], [0.7 * half, 0.55, 0.08], [half, 0.02, 0.25]]
        )
