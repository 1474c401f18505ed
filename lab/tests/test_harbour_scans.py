"""Ray-cast scans of several vessels at once are split into the vessels, near and far, by every sensor."""

import numpy as np
import pytest

from shipshape.batch.method import Segmentation
from shipshape.batch.segmentation import segment
from shipshape_lab.simulator.recipes import TEST_HULLS
from shipshape_lab.simulator.scan import Conditions, scan_vessel
from shipshape_lab.simulator.sea import LIGHT_SEA, Placement
from shipshape_lab.simulator.sensor import LIDARS
from shipshape_lab.simulator.vessels import build_vessel

HEIGHT = 3.0  # m, of the LiDAR above the water
FLEET = (("tug", 70.0, 0.3), ("patrol_boat", 90.0, 1.4), ("rhib", 35.0, -1.0), ("fishing_boat", 50.0, 2.6))


def harbour(lidar, rng) -> list[np.ndarray]:
    """The points of each vessel."""
    conditions = Conditions(sea=LIGHT_SEA, dropout=0.05)
    clouds = []
    for name, range_m, bearing in FLEET:
        placement = Placement(range_m, float(rng.uniform(-3, 3)), bearing, HEIGHT)
        hull = build_vessel(name, int(rng.choice(TEST_HULLS)))
        clouds.append(scan_vessel(hull, lidar, placement=placement, conditions=conditions, rng=rng).points_level)
    return clouds


def is_one_cluster(vessel: np.ndarray, clusters: list[np.ndarray]) -> bool:
    """Whether one cluster has nearly all of its dry points, and no other has many."""
    dry = {tuple(point) for point in vessel[vessel[:, 2] > 0.5 - HEIGHT].tolist()}
    shares = [len(dry & {tuple(point) for point in cluster.tolist()}) / len(dry) for cluster in clusters]
    return max(shares) > 0.95 and sum(share > 0.05 for share in shares) == 1


@pytest.mark.parametrize("lidar", LIDARS, ids=lambda lidar: lidar.name)
def test_vessels_are_one_cluster_each(lidar):
    whole = 0
    for seed in range(3):
        rng = np.random.default_rng(seed)
        vessels = harbour(lidar, rng)
        waves = rng.uniform(-40, 40, (500, 3)).astype(np.float32)
        waves[:, 2] = rng.normal(-HEIGHT, 0.1, len(waves))
        clusters, _ = segment(np.concatenate([*vessels, waves]), Segmentation(), HEIGHT)
        assert len(clusters) <= len(vessels) + 1
        whole += sum(is_one_cluster(vessel, clusters) for vessel in vessels)
    assert whole >= 11  # of 12
