"""Harbour tug, about 24 m: full round bow, low after deck, two-tier house, high wheelhouse, funnels."""

from dataclasses import dataclass, field, replace

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.house import House
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import rod
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class Tug:
    """Parameters of a tug."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=24.0,
            beam=9.2,
            bow_height=4.0,
            mid_height=2.1,
            stern_height=2.3,
            bulwark=0.95,
            bow_rake=1.0,
            stern_rake=0.5,
            transom=0.8,
            waterline=0.95,
            shoulder=0.5,
            fullness=2.6,
            entry=2.2,
            roundness=0.62,
            flare=1.2,
        )
    )
    lower: House = field(
        default_factory=lambda: House(0.34, 9.0, 6.2, 2.7, front_rake=0.1, tumblehome=0.05, taper=0.8, facet=0.9)
    )
    upper: House = field(
        default_factory=lambda: House(0.45, 5.4, 4.8, 2.2, front_rake=0.1, tumblehome=0.1, taper=0.8, facet=0.7)
    )
    bridge: House = field(
        default_factory=lambda: House(
            0.49, 3.9, 3.9, 2.6, front_rake=-0.25, aft_rake=-0.2, tumblehome=-0.15, taper=0.8, facet=0.7
        )
    )
    funnel_height: float = 3.2  # m above the lower house
    funnel_side: float = 2.1  # m off the centreline
    mast_height: float = 4.5  # m above the bridge roof
    winch_at: float = 0.82  # t of the bow winch
    hook_at: float = 0.27  # t of the towing hook and bitts
    tyre_radius: float = 0.5  # m
    tyres: int = 6  # each side
    funnels: bool = True  # a pair; otherwise one on the centreline
    stern_winch: bool = True
    monitor: bool = True  # fire monitor on the bridge roof
    crew: int = 1

    def build(self) -> Shape:
        """The whole vessel, before it is cut at the waterline."""
        lower = self.lower.fitted(self.hull, gangway=0.7)
        upper = self.upper.carried(lower, self.hull)
        bridge = self.bridge.carried(upper, self.hull)
        return replace(self, lower=lower, upper=upper, bridge=bridge)._assembled()

    def _assembled(self) -> Shape:
        hull = [self.hull.shape(), self.hull.strake(0.25, drop=0.3), self.hull.strake(0.15, drop=1.2)]
        return joined(
            [*hull, *self._houses(), *self._funnels(), *self._mast(), *self._deck_gear(), *self._fenders()]
        )

    def _levels(self) -> tuple[float, float, float]:
        """Floors of the three houses, metres above water."""
        lower = self.lower.foot(self.hull)
        upper = lower + self.lower.height
        return lower, upper, upper + self.upper.height

    def _houses(self) -> list[Shape]:
        low, middle, high = self._levels()
        lower = self.lower.glazed(sill=0.62, head=0.72, brow=0.1).moved(x=self.hull.x(self.lower.aft), z=low)
        upper = self.upper.plain().moved(x=self.hull.x(self.upper.aft), z=middle)
        bridge = self.bridge.glazed(sill=0.38, head=0.85, brow=0.3).moved(x=self.hull.x(self.bridge.aft), z=high)
        path = self.lower.ring(1.0, inset=0.15)[[0, 5, 4]] + [self.hull.x(self.lower.aft), 0.0, low]
        return [lower, upper, bridge, fit.rails(path, 1.0)]

    def _funnels(self) -> list[Shape]:
        _, middle, _ = self._levels()
        x = self.hull.x(self.lower.aft) + 1.2
        casing = fit.stack(self.funnel_height, length=1.5, width=1.1)
        if self.funnels:
            return [both_sides(casing.moved(x=x, y=min(self.funnel_side, self.lower.width / 2 - 0.7), z=middle))]
        return [casing.moved(x=x, z=middle)]

    def _mast(self) -> list[Shape]:
        z = self._levels()[2] + self.bridge.height
        x = self.hull.x(self.bridge.aft) + 0.3 * self.bridge.length
        parts = [fit.lattice_mast(self.mast_height, stance=1.2, lean=0.2).moved(x=x, z=z)]
        parts.append(fit.open_radar(2.0).moved(x=x - 0.2, z=z + 0.8 * self.mast_height))
        parts += [fit.whip(3.0).moved(x=x + 0.5, y=y, z=z) for y in (1.3, -1.3)]
        if self.monitor:
            parts.append(rod((x + 1.6, 0.8, z), (x + 2.2, 0.8, z + 0.8), 0.12))
        return parts

    def _deck_gear(self) -> list[Shape]:
        bow, aft = self.hull.deck(0.8), self.hull.deck(0.2)
        parts = [fit.winch(2.0, 0.8).moved(x=self.hull.x(self.winch_at), z=bow)]
        parts.append(fit.bitts(1.2, 1.2).moved(x=self.hull.x(0.91), z=bow + 0.3))
        parts.append(fit.bitts(1.4, 1.6).moved(x=self.hull.x(self.hook_at - 0.07), z=aft))
        arch = self.hull.beam * 0.33
        x = self.hull.x(self.hook_at - 0.14)
        parts.append(both_sides(rod((x, arch, aft), (x, arch * 0.6, aft + 1.9), 0.13)))
        parts.append(rod((x, -arch * 0.6, aft + 1.9), (x, arch * 0.6, aft + 1.9), 0.13))
        if self.stern_winch:
            parts.append(fit.winch(1.8, 0.7).moved(x=self.hull.x(self.hook_at), z=aft))
        for i in range(self.crew):
            parts.append(fit.standing().moved(x=self.hull.x(0.18 - 0.05 * i), y=2.0 - 4.0 * (i % 2), z=aft))
        return parts

    def _fenders(self) -> list[Shape]:
        bow = self.hull.below_edge(0.93, 0.995, drop=0.4, count=5)
        stem = both_sides(joined([rod((x, y, z - 0.9), (x, y, z + 0.2), 0.35, 8) for x, y, z in bow]))
        if self.tyres == 0:
            return [stem]
        return [
            stem,
            fit.tyres(self.hull.below_edge(0.08, 0.75, drop=0.9, count=self.tyres), self.tyre_radius),
        ]
