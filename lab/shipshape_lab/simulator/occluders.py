"""Things between the sensor and the vessel that take rays away: boxes and other hulls, in the level frame."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shipshape_lab.simulator.raycast import cast
from shipshape_lab.simulator.sea import Placement
from shipshape_lab.simulator.vessel import Vessel


class Occluder(Protocol):
    """Anything that can say how far each ray from the sensor gets before it hits it."""

    def ranges(self, directions_level: np.ndarray) -> np.ndarray:
        """Distance along each unit ray, metres, inf for a miss; (N, 3) -> (N,)."""
        ...


@dataclass(frozen=True)
class BoxOccluder:
    """A box along the axes of the level frame, from its low to its high corner (x, y, z), metres."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def ranges(self, directions_level: np.ndarray) -> np.ndarray:
        """Distance at which each ray enters the box (slab method); (N, 3) -> (N,)."""
        # A ray along an axis divides by a tiny number instead of zero, which leaves its slab test true.
        safe = np.where(np.abs(directions_level) < 1e-12, 1e-12, directions_level)
        to_low, to_high = np.asarray(self.low) / safe, np.asarray(self.high) / safe
        enter = np.minimum(to_low, to_high).max(axis=1)
        leave = np.maximum(to_low, to_high).min(axis=1)
        return np.where((enter <= leave) & (leave > 0.0), np.maximum(enter, 0.0), np.inf)


@dataclass(frozen=True)
class HullOccluder:
    """Another vessel, upright, at its own place."""

    vessel: Vessel
    placement: Placement

    def ranges(self, directions_level: np.ndarray) -> np.ndarray:
        """Distance at which each ray hits this hull; (N, 3) -> (N,)."""
        return cast(self.vessel, self.placement.T_level_vessel(), directions_level).ranges
