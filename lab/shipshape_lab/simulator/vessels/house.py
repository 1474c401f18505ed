"""Deckhouses and wheelhouses: faceted fronts, raked windows set into the wall, a roof with a brow."""

from dataclasses import dataclass, replace

import numpy as np

from shipshape_lab.simulator.vessels.hull import Hull
from shipshape_lab.simulator.vessels.parts import loft, rods
from shipshape_lab.simulator.vessels.shape import Shape, joined


@dataclass(frozen=True)
class House:
    """A house on deck; the plan is a rectangle with a faceted front."""

    aft: float  # share of the hull's length from its aft end to the house's aft wall
    length: float  # m, at the foot
    width: float  # m, at the foot
    height: float  # m, foot to roof
    front_rake: float = 0.3  # m, roof edge abaft the foot; negative leans forward
    aft_rake: float = 0.0  # m, roof edge ahead of the foot
    tumblehome: float = 0.1  # m, each side's lean inwards
    taper: float = 0.9  # breadth in front over breadth aft
    facet: float = 0.12  # m, front corners abaft the middle of the front
    lift: float = 0.0  # m, foot of the front above the foot aft, where the deck rises towards the bow

    def ring(self, level: float, *, inset: float = 0.0, rise: float = 0.0) -> np.ndarray:
        """Outline (6, 3) at a share of the height, `inset` metres in from the wall and `rise` metres up."""
        back = self.aft_rake * level + inset
        front = self.length - self.front_rake * level - inset
        half = self.width / 2 - self.tumblehome * level - inset
        corner, nose = half * self.taper, half * self.taper * 0.55
        x = np.array([back, back, front - self.facet, front, front, front - self.facet])
        y = np.array([half, -half, -corner, -nose, nose, corner])
        z = np.full(6, self.height * level + rise)
        z[2:] += self.lift * (level == 0.0)
        return np.stack([x, y, z], axis=1)

    def plain(self) -> Shape:
        """The house without windows; foot at z = 0, aft wall at x = 0."""
        return loft(np.stack([self.ring(0.0), self.ring(1.0), self.ring(1.0, inset=0.05, rise=0.06)]))

    def glazed(self, *, sill: float = 0.5, head: float = 0.9, brow: float = 0.15) -> Shape:
        """The house with a window band between two shares of its height, under a roof overhanging by `brow` m."""
        skin = loft(
            np.stack(
                [
                    self.ring(0.0),
                    self.ring(sill),
                    self.ring(sill, inset=0.07),
                    self.ring(head, inset=0.07),
                    self.ring(head, inset=-brow * 0.3),
                    self.ring(1.0, inset=-brow),
                    self.ring(1.0, rise=0.1),
                ]
            )
        )
        return joined([skin, self._mullions(sill, head)])

    def _mullions(self, sill: float, head: float) -> Shape:
        """Posts at the corners of the window band and along its sides."""
        low, high = self.ring(sill, inset=0.02), self.ring(head, inset=0.02)
        feet = np.concatenate([low, *(low + s * (np.roll(low, -1, axis=0) - low) for s in (0.33, 0.67))])
        heads = np.concatenate([high, *(high + s * (np.roll(high, -1, axis=0) - high) for s in (0.33, 0.67))])
        return rods(np.stack([feet, heads], axis=1), 0.05)

    def fitted(self, hull: Hull, *, gangway: float = 0.2) -> "House":
        """The house narrowed and shortened where needed to keep `gangway` metres inside the hull's cap."""
        length = min(self.length, (0.84 - self.aft) * hull.length)
        width = min(self.width, 2.0 * (float(hull.half_beam(self.aft)) - gangway))
        ahead = self.aft + (length - self.facet) / hull.length
        shorter = replace(self, length=length, width=width)
        foot = shorter.foot(hull)
        lift = float(np.clip(hull.deck(ahead) - foot - 0.15, 0.0, 0.4 * self.height))
        side = hull.reach(hull.x(ahead), foot + lift)  # a flared side leans in below the cap
        room = 2.0 * min(float(hull.half_beam(ahead)) - gangway, side - 0.15)
        return replace(shorter, lift=lift, taper=min(self.taper, max(room, 0.3) / width))

    def foot(self, hull: Hull) -> float:
        """Height of the lowest deck under the house, metres above water, so that no gap shows below its walls."""
        front = self.aft + self.length / hull.length
        return min(hull.deck(t) for t in np.linspace(self.aft, front, 5))

    def carried(self, lower: "House", hull: Hull) -> "House":
        """The house moved, shortened and narrowed where needed to stand wholly on the roof of a lower one."""
        start = lower.aft + (lower.aft_rake + 0.1) / hull.length
        end = lower.aft + (lower.length - lower.front_rake - 0.1) / hull.length
        length = min(self.length, (end - start) * hull.length)
        aft = min(max(self.aft, start), end - length / hull.length)
        width = min(self.width, lower.width - 2.0 * lower.tumblehome - 0.1)
        return replace(self, aft=aft, length=length, width=width, taper=min(self.taper, lower.taper + 0.05))
