"""Motor cruiser, about 11 m: high flared bow, raked coachroof and screen, open cockpit, radar arch."""

from dataclasses import dataclass, field, replace

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block
from shipshape_lab.simulator.vessels.shape import Shape, joined


@dataclass(frozen=True)
class MotorCruiser:
    """Parameters of a motor_cruiser."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=11.2,
            beam=3.6,
            bow_height=1.75,
            mid_height=1.25,
            stern_height=1.2,
            bulwark=0.7,
            bow_rake=1.5,
            stern_rake=-0.5,
            transom=0.88,
            waterline=0.84,
            shoulder=0.42,
            fullness=2.3,
            entry=1.6,
            flare=1.6,
        )
    )
    trunk: House = field(
        default_factory=lambda: House(0.5, 4.0, 2.3, 0.5, front_rake=1.4, taper=0.5, tumblehome=0.2)
    )
    saloon: House = field(
        default_factory=lambda: House(0.3, 4.3, 2.8, 1.6, front_rake=1.7, aft_rake=0.2, tumblehome=0.3, taper=0.85)
    )
    seat: float = 0.9  # m, height of the cockpit seats' backs
    arch_height: float = 0.8  # m above the saloon roof
    rail_height: float = 0.6  # m
    platform: float = 0.7  # m, length of the bathing platform
    fly: bool = True  # flying bridge: seats and a screen on the roof
    radar: bool = True
    helmsman: bool = False  # on the flying bridge, if there is one

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        trunk, saloon = self.trunk.fitted(self.hull, gangway=0.35), self.saloon.fitted(self.hull, gangway=0.3)
        return replace(self, trunk=trunk, saloon=saloon)._assembled()

    def _assembled(self) -> Shape:
        bow_rail = fit.rails(self.hull.edge(0.45, 0.97, count=9, inset=0.12), self.rail_height, wires=2)
        platform = block(self.platform, self.hull.beam * 0.7, 0.12).moved(
            x=self.hull.x(0) - self.platform * 0.2, z=0.3
        )
        return joined(
            [
                self.hull.shape(),
                self.hull.raised_deck(self.saloon.aft),
                self.hull.strake(0.05),
                bow_rail,
                platform,
                *self._houses(),
                *self._cockpit(),
                *self._roof(),
            ]
        )

    def _side_deck(self, t: float) -> float:
        """Height of the raised deck that the houses stand on, metres above water."""
        return float(self.hull.cap_height(t)) - 0.12

    def _houses(self) -> list[Shape]:
        trunk = self.trunk.plain().moved(x=self.hull.x(self.trunk.aft), z=self._side_deck(self.trunk.aft))
        saloon = self.saloon.glazed(sill=0.42, head=0.86, brow=0.1)
        return [trunk, saloon.moved(x=self.hull.x(self.saloon.aft), z=self._side_deck(0.4))]

    def _cockpit(self) -> list[Shape]:
        x, z = self.hull.x(0.09), self.hull.deck(0.1)
        bench = block(0.6, self.hull.beam * 0.6, 0.45).moved(x=x, z=z)
        back = block(0.15, self.hull.beam * 0.6, self.seat).moved(x=x - 0.35, z=z)
        seat = block(1.1, 0.5, 0.5).moved(x=x + 1.2, y=self.hull.beam * 0.3, z=z)
        return [bench, back, seat]

    def _roof(self) -> list[Shape]:
        x = self.hull.x(self.saloon.aft) + 0.6
        z = self._side_deck(0.4) + self.saloon.height + 0.08
        parts = [fit.arch_mast(self.saloon.width * 0.75, self.arch_height, lean=0.5).moved(x=x, z=z)]
        parts.append(fit.whip(1.8).moved(x=x - 0.5, y=0.6, z=z + self.arch_height))
        if self.radar:
            parts.append(fit.dome(0.28).moved(x=x - 0.5, z=z + self.arch_height + 0.1))
        return parts + (self._flying_bridge(z) if self.fly else [])

    def _flying_bridge(self, z: float) -> list[Shape]:
        """Seat, screen and helmsman on the saloon roof at height z, all within its edges."""
        aft = self.hull.x(self.saloon.aft) + self.saloon.aft_rake
        roof = self.saloon.length - self.saloon.front_rake - self.saloon.aft_rake
        width = (self.saloon.width - 2.0 * self.saloon.tumblehome) * 0.75
        seat, screen = aft + 0.4 * roof, aft + 0.82 * roof
        parts = [block(0.6, width, 0.45).moved(x=seat, z=z)]
        parts.append(block(0.25, width, 0.5, chamfer=0.1).moved(x=screen, z=z))
        if self.helmsman:
            parts.append(fit.seated(1.3).moved(x=seat, y=0.25 * width, z=z))
        return parts
