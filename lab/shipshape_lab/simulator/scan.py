"""One LiDAR cluster of one vessel: ray casting, returns, dropout, range noise.

Goes in: a vessel, a sensor, a placement, conditions and a random generator. Comes out: the points that the
sensor reports, in the level frame, with the pose behind them. What lies below the waterline is never seen.
"""

from dataclasses import dataclass

import numpy as np

from shipshape_lab.simulator.occluders import Occluder
from shipshape_lab.simulator.raycast import cast
from shipshape_lab.simulator.sea import Motion, Placement, SeaState
from shipshape_lab.simulator.sensor import Lidar
from shipshape_lab.simulator.vessel import Vessel


@dataclass(frozen=True)
class Conditions:
    """What spoils a scan.

    Attributes:
        sea: motion of the vessel; None for a calm sea.
        occluders: things that block rays on their way.
        dropout: share of returns lost at random, 0 to 1.
        dropout_per_100m: further share lost for each 100 m of range.
    """

    sea: SeaState | None = None
    occluders: tuple[Occluder, ...] = ()
    dropout: float = 0.0
    dropout_per_100m: float = 0.0

    def lost_share(self, ranges: np.ndarray) -> np.ndarray:
        """Probability that a return at each range is lost, 0 to 1, (N,) -> (N,)."""
        return np.clip(self.dropout + self.dropout_per_100m * ranges / 100.0, 0.0, 1.0)


CALM = Conditions()


@dataclass(frozen=True)
class Scan:
    """A cluster and the truth behind it.

    Attributes:
        points_level: returns in the level frame, metres, shape (N, 3), float32.
        placement: range, heading, bearing and sensor height.
        T_level_vessel: pose of the vessel, roll, pitch and heave included, shape (4, 4), float64.
        vessel_name: type name of the hull.
        vessel_seed: seed of the hull's variation, None for the nominal hull.
        hidden_share: share of the returns that occluders took away, 0 to 1; 0 where there was nothing to take.
    """

    points_level: np.ndarray
    placement: Placement
    T_level_vessel: np.ndarray
    vessel_name: str
    vessel_seed: int | None
    hidden_share: float = 0.0

    @property
    def range_m(self) -> float:
        """Horizontal distance to the vessel's origin, metres."""
        return self.placement.range_m

    @property
    def heading(self) -> float:
        """Yaw of the vessel in the level frame, counter-clockwise, radians."""
        return self.placement.heading

    @property
    def bearing(self) -> float:
        """Direction of the vessel's origin from the sensor, radians."""
        return self.placement.bearing

    @property
    def aspect_deg(self) -> float:
        """0 bow-on, 90 abeam, 180 stern-on, degrees."""
        return self.placement.aspect_deg

    @property
    def sensor_height(self) -> float:
        """Height of the sensor above the waterline, metres."""
        return self.placement.sensor_height


def scan_vessel(
    vessel: Vessel,
    lidar: Lidar,
    *,
    placement: Placement,
    conditions: Conditions = CALM,
    rng: np.random.Generator,
) -> Scan:
    """Scan a vessel once.

    Args:
        vessel: the hull, in the vessel frame.
        lidar: the sensor, at the origin of the level frame.
        placement: where the vessel lies.
        conditions: sea, occluders and dropout.
        rng: the only source of chance: azimuth phase, motion, returns, dropout and noise.

    Returns:
        The cluster; it may be empty.
    """
    phase = rng.random()
    motion = conditions.sea.draw(rng) if conditions.sea else Motion()
    T_level_vessel = placement.T_level_vessel(motion)
    azimuth, elevation = angular_window(vessel, T_level_vessel)
    directions = lidar.directions(azimuth=azimuth, elevation=elevation, phase=phase)
    hits = cast(vessel, T_level_vessel, directions)
    returned = rng.random(len(directions)) < lidar.return_probability(hits.ranges, hits.cosines)
    seen = returned.copy()
    for occluder in conditions.occluders:
        seen &= hits.ranges <= occluder.ranges(directions)
    directions, ranges = directions[seen], hits.ranges[seen]
    kept = rng.random(len(ranges)) >= conditions.lost_share(ranges)
    noisy = ranges[kept] + rng.normal(0.0, lidar.range_noise_sd, np.count_nonzero(kept))
    points = (directions[kept] * noisy[:, None]).astype(np.float32)
    dry = points[:, 2] >= -placement.sensor_height
    hidden_share = 1.0 - seen.sum() / returned.sum() if returned.any() else 0.0
    return Scan(points[dry], placement, T_level_vessel, vessel.name, vessel.seed, hidden_share)


def angular_window(vessel: Vessel, T_level_vessel: np.ndarray) -> tuple[tuple[float, float], tuple[float, float]]:
    """Azimuths and elevations (radians) between which every ray that can hit the vessel lies.

    The azimuths run upwards from low to high and so may pass +-pi; all round if the sensor is over the hull.
    """
    low, high = vessel.mesh.bounds
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)
    corners = corners @ T_level_vessel[:3, :3].T + T_level_vessel[:3, 3]
    middle = corners.mean(axis=0)
    reach = np.linalg.norm(corners[:, :2] - middle[:2], axis=1).max()
    nearest = np.hypot(*middle[:2]) - reach
    if nearest <= 0.0:
        return (-np.pi, np.pi), (-np.pi / 2, np.pi / 2)
    centre = np.arctan2(middle[1], middle[0])
    turns = np.arctan2(corners[:, 1], corners[:, 0]) - centre
    turns = np.arctan2(np.sin(turns), np.cos(turns)) + centre
    # A box face bulges towards the sensor between its corners, hence the nearest point of its circle.
    lifts = np.arctan2(corners[:, 2][:, None], np.array([nearest, nearest + 2 * reach]))
    return (turns.min(), turns.max()), (lifts.min(), lifts.max())
