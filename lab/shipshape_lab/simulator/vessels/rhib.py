"""Rigid inflatable boat, about 9 m: tube collar, jockey console, crew, arch mast, outboards."""

from dataclasses import dataclass, field

import numpy as np

from shipshape_lab.simulator.vessels import fittings as fit
from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import block, rod, tube
from shipshape_lab.simulator.vessels.shape import Shape, both_sides, joined


@dataclass(frozen=True)
class Rhib:
    """Parameters of a rhib."""

    hull: Hull = field(
        default_factory=lambda: Hull(
            length=8.6,
            beam=2.5,
            bow_height=1.15,
            mid_height=0.62,
            stern_height=0.62,
            bulwark=0.16,
            bow_rake=1.1,
            transom=0.95,
            waterline=0.82,
            shoulder=0.55,
            fullness=2.6,
            entry=1.8,
        )
    )
    collar: float = 0.27  # m, radius of the tube
    console_at: float = 0.46  # t of the console
    console_height: float = 1.15  # m
    console_width: float = 0.9  # m
    screen: float = 0.5  # m, height of the windscreen
    rows: int = 3  # rows of two seats
    row_gap: float = 0.95  # m between rows
    crew: int = 4  # people seated, from the front
    arch_at: float = 0.1  # t of the arch's feet
    arch_height: float = 1.9  # m
    whip: float = 2.2  # m
    twin: bool = True  # two outboards rather than one
    radar: bool = True
    bow_locker: bool = True
    gunner: bool = False  # one more person standing forward

    def build(self) -> Shape:
        """The whole boat, before it is cut at the waterline."""
        return joined([self.hull.shape(), self._collar(), *self._cockpit(), *self._aft_gear(), *self._bow_gear()])

    def _collar(self) -> Shape:
        path = self.hull.edge(-0.03, 0.965, count=22, inset=self.collar * 0.3)
        path = np.concatenate([path[:-1], [path[-1] * [1, 0.9, 1]], path[-1:] * [1, 0, 1] + [0.25, 0, 0]])
        radii = self.collar * np.concatenate([[0.45, 0.85], np.ones(len(path) - 2)])
        return both_sides(tube(path, radii, sides=10))

    def _cockpit(self) -> list[Shape]:
        x, floor = self.hull.x(self.console_at), self.hull.deck(self.console_at)
        top = floor + self.console_height
        console = block(0.8, self.console_width, self.console_height, chamfer=0.12).moved(x=x, z=floor)
        pane = block(0.06, self.console_width * 0.8, self.screen).moved(x=x + 0.2, z=top)
        parts = [console, pane]
        room = (self.console_at - self.arch_at) * self.hull.length - 1.3  # seats end ahead of the arch
        rows = min(self.rows, 1 + int(room / self.row_gap))
        for place in range(2 * rows):
            at = {"x": x - 0.95 - self.row_gap * (place // 2), "y": 0.42 - 0.84 * (place % 2), "z": floor}
            parts.append(block(0.6, 0.36, 0.62, chamfer=0.05).moved(**at))
            parts.append(block(0.08, 0.36, 0.45).moved(x=at["x"] - 0.3, y=at["y"], z=floor + 0.6))
            if place < self.crew:
                parts.append(fit.seated(1.42).moved(**at))
        return parts

    def _aft_gear(self) -> list[Shape]:
        x, floor = self.hull.x(self.arch_at), self.hull.deck(self.arch_at)
        top = floor + self.arch_height
        aft, z = self.hull.x(0.0), self.hull.stern_height
        parts = [fit.arch_mast(self.hull.beam * 0.62, self.arch_height).moved(x=x, z=floor)]
        parts += [fit.whip(self.whip).moved(x=x - 0.4, y=y, z=top) for y in (0.5, -0.5)]
        parts.append(rod((x - 0.4, 0.0, top), (x - 0.4, 0.0, top + 0.7), 0.04))
        if self.radar:
            parts.append(fit.dome(0.28).moved(x=x - 0.4, z=top + 0.1))
        engines = (0.38, -0.38) if self.twin else (0.0,)
        return parts + [fit.outboard(1.5).moved(x=aft - 0.02, y=y, z=z) for y in engines]

    def _bow_gear(self) -> list[Shape]:
        x, floor = self.hull.x(0.76), self.hull.deck(0.76)
        parts = []
        if self.bow_locker:
            parts.append(block(0.9, 0.8, 0.5, chamfer=0.1).moved(x=x, z=floor))
        if self.gunner:
            parts.append(fit.standing().moved(x=x - 0.8, z=floor))
        return parts
