"""Pilot boat, about 16 m: low fast hull with fenders, wheelhouse amidships, handrails."""

from dataclasses import dataclass, field, replace

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block
from shipshape_lab.simulator.vessels.shape import Shape, joined


@dataclass(frozen=True)
class PilotBoat:
    """Parameters of a pilot_boat."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=15.6,
            beam=4.8,
            bow_height=2.2,
            mid_height=1.45,
            stern_height=1.4,
            bulwark=0.06,
            bow_rake=1.7,
            stern_rake=-0.2,
            transom=0.9,
            waterline=0.86,
            shoulder=0.45,
            fullness=2.4,
            entry=1.6,
            flare=1.5,
        )
    )
    house: House = field(
        default_factory=lambda: House(
            0.33, 4.9, 3.3, 2.5, front_rake=0.9, aft_rake=0.15, tumblehome=0.3, taper=0.85, facet=0.35
        )
    )
    trunk: House = field(
        default_factory=lambda: House(0.6, 3.2, 2.6, 0.75, front_rake=1.0, taper=0.6, tumblehome=0.25)
    )
    fender: float = 0.16  # m, radius of the all-round fender
    mast_height: float = 2.2  # m above the roof
    mast_at: float = 0.35  # share of the roof's length from aft
    rail_height: float = 1.0  # m
    radar_span: float = 1.4  # m
    roof_rails: bool = True
    stern_frame: bool = True  # man-overboard recovery frame
    raft: bool = True
    search_light: bool = True
    crew: int = 1

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        trunk = self.trunk.fitted(self.hull, gangway=0.5)
        return replace(self, house=self.house.fitted(self.hull, gangway=0.5), trunk=trunk)._assembled()

    def _assembled(self) -> Shape:
        hull = [
            self.hull.shape(),
            self.hull.strake(self.fender, drop=0.1),
            self.hull.strake(self.fender * 0.6, drop=0.7),
        ]
        return joined([*hull, *self._houses(), *self._roof(), *self._rails(), *self._deck_gear()])

    def _houses(self) -> list[Shape]:
        front = self.trunk.plain().moved(x=self.hull.x(self.trunk.aft), z=self.trunk.foot(self.hull))
        return [
            front,
            self.house.glazed(sill=0.5, head=0.87, brow=0.12).moved(
                x=self.hull.x(self.house.aft), z=self._floor()
            ),
        ]

    def _floor(self) -> float:
        return self.house.foot(self.hull)

    def _roof(self) -> list[Shape]:
        x = self.hull.x(self.house.aft) + self.mast_at * self.house.length
        z = self._floor() + self.house.height
        parts = [fit.lattice_mast(self.mast_height, stance=0.8, lean=0.4).moved(x=x, z=z)]
        parts.append(fit.open_radar(self.radar_span).moved(x=x - 0.3, z=z + self.mast_height * 0.82))
        parts += [fit.whip(2.4).moved(x=x + 0.5, y=y, z=z) for y in (1.0, -1.0)]
        if self.search_light:
            parts.append(fit.dome(0.2).moved(x=x + 1.6, y=0.5, z=z))
        if self.roof_rails:
            path = self.house.ring(1.0, inset=0.15)[[0, 5, 4]] + [
                self.hull.x(self.house.aft),
                0.0,
                self._floor(),
            ]
            parts.append(fit.rails(path, 0.35, wires=1))
        return parts

    def _rails(self) -> list[Shape]:
        bow = fit.rails(self.hull.edge(0.62, 0.95, count=8, inset=0.35), self.rail_height, wires=2)
        stern = fit.rails(self.hull.edge(0.02, 0.28, count=5, inset=0.25), self.rail_height, wires=2)
        return [bow, stern]

    def _deck_gear(self) -> list[Shape]:
        floor, aft = self.hull.deck(0.1), self.hull.x(0.02)
        parts = [block(1.2, 1.6, 0.7, chamfer=0.05).moved(x=self.hull.x(0.22), z=floor)]
        parts.append(fit.bitts(0.5, 0.5).moved(x=self.hull.x(0.88), z=self.hull.deck(0.88)))
        if self.stern_frame:
            parts.append(fit.arch_mast(1.8, 1.7, lean=0.3).moved(x=aft + 0.5, z=floor))
        if self.raft:
            parts.append(fit.raft_canister().moved(x=self.hull.x(0.27), y=1.3, z=floor))
        for i in range(self.crew):
            parts.append(
                fit.standing().moved(x=self.hull.x(0.68 + 0.05 * i), y=1.5 - 3.0 * (i % 2), z=self.hull.deck(0.66))
            )
        return parts
