"""Uncrewed surface vessel, about 5 m: two inflated hulls, arched legs, a payload tray, a sensor mast."""

from dataclasses import dataclass

import numpy as np

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.parts import block, cone, rod, tube
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class UsvCatamaran:
    """Parameters of a usv_catamaran."""

    length: float = 5.0  # m, of each hull
    beam: float = 2.45  # m, over both hulls
    radius: float = 0.24  # m, of each hull amidships
    float_height: float = 0.14  # m, hull axis above water
    bow_rise: float = 0.28  # m, lift of the hull axis at the bow
    tray_height: float = 1.1  # m above water
    tray_length: float = 1.9  # m
    tray_width: float = 1.1  # m
    tray_at: float = 0.05  # m, tray's middle ahead of amidships
    leg_spread: float = 1.35  # m between leg feet along each hull
    box_height: float = 0.38  # m, electronics box on the tray
    mast_height: float = 1.05  # m above the tray
    mast_at: float = 0.35  # m ahead of the tray's middle
    whip: float = 1.0  # m
    pods: bool = True  # engine pods on both sterns
    lidar: bool = True
    second_box: bool = True

    def build(self) -> Shape:
        """The whole craft, before it is cut at the waterline."""
        return joined([both_sides(joined(self._side())), *self._tray(), *self._mast()])

    def _side(self) -> list[Shape]:
        y = self.beam / 2 - self.radius
        s = np.linspace(0.0, 1.0, 18)
        path = np.stack(
            [self.length * (s - 0.5), np.full(18, y), self.float_height + self.bow_rise * s**4], axis=1
        )
        radii = self.radius * np.minimum(1.0, np.minimum(0.45 + 5 * s, 0.12 + 2.2 * (1 - s) ** 0.7))
        parts = [tube(path, radii, sides=14)]
        foot = self.float_height + self.radius
        for end in (-1.0, 1.0):
            knee = (self.tray_at + end * self.leg_spread * 0.42, y * 0.8, self.tray_height * 0.8)
            parts.append(rod((end * self.leg_spread, y, foot - 0.05), knee, 0.055))
            parts.append(rod(knee, (self.tray_at + end * 0.3, self.tray_width * 0.4, self.tray_height), 0.055))
        parts.append(block(2.3 * self.leg_spread, 0.14, 0.1).moved(y=y, z=foot - 0.05))
        if self.pods:
            parts.append(block(0.5, 0.3, 0.5, chamfer=0.06).moved(x=-self.length / 2 - 0.1, y=y, z=0.05))
        return parts

    def _tray(self) -> list[Shape]:
        z = self.tray_height
        parts = [block(self.tray_length, self.tray_width, 0.08).moved(x=self.tray_at, z=z)]
        parts.append(block(0.75, 0.6, self.box_height, chamfer=0.03).moved(x=self.tray_at - 0.4, z=z + 0.08))
        if self.second_box:
            parts.append(block(0.4, 0.8, 0.22).moved(x=self.tray_at + 0.6, z=z + 0.08))
        return parts

    def _mast(self) -> list[Shape]:
        x, z = self.tray_at + self.mast_at, self.tray_height + 0.08
        top = z + self.mast_height
        legs = [rod((x, y, z), (x - 0.1, 0.3 * y, top), 0.025, 4) for y in (0.35, -0.35)]
        legs.append(rod((x - 0.6, 0.0, z), (x - 0.1, 0.0, top), 0.025, 4))
        parts = [*legs, block(0.3, 0.5, 0.04).moved(x=x - 0.1, z=top)]
        parts += [fit.whip(self.whip, lean=0.0).moved(x=x - 0.2, y=y, z=top) for y in (0.22, -0.22)]
        if self.lidar:
            parts.append(cone(0.09, 0.09, 0.16).moved(x=x - 0.05, z=top + 0.04))
        return parts
