"""How many vessels `shipshape batch --segment` keeps whole, by the gap that it is given and by the LiDAR.

    python benchmarks/segmentation.py

Ray-cast hulls that no model was trained on, 30 to 110 m away in a light sea. Whole: one cluster has more than 95 %
of the points above the band of the water.
"""

import argparse

import numpy as np

from shipshape.batch.method import Segmentation
from shipshape.batch.segmentation import segment
from shipshape_lab.simulator.recipes import TEST_HULLS
from shipshape_lab.simulator.scan import Conditions, scan_vessel
from shipshape_lab.simulator.sea import LIGHT_SEA, Placement
from shipshape_lab.simulator.sensor import LIDARS, Lidar
from shipshape_lab.simulator.vessels import build_vessel

GAPS = (2.0, 3.0, 4.0, 5.0, 6.0)
HEIGHT = 3.0  # m, of the LiDAR above the water
VESSELS = (
    "tug",
    "patrol_boat",
    "rhib",
    "fishing_boat",
    "pilot_boat",
    "landing_craft",
    "sailing_yacht",
    "small_ferry",
)


def clusters_of(lidar: Lidar, count: int, seed: int) -> list[np.ndarray]:
    """What the LiDAR sees of so many vessels; those of which it sees too little are left out."""
    rng = np.random.default_rng(seed)
    conditions = Conditions(sea=LIGHT_SEA, dropout=0.05)
    found = []
    for index in range(count):
        range_m, heading, bearing = rng.uniform(30, 110), rng.uniform(-3, 3), rng.uniform(-3, 3)
        placement = Placement(float(range_m), float(heading), float(bearing), HEIGHT)
        hull = build_vessel(VESSELS[index % len(VESSELS)], int(rng.choice(TEST_HULLS)))
        scan = scan_vessel(hull, lidar, placement=placement, conditions=conditions, rng=rng)
        if np.count_nonzero(_dry(scan.points_level)) >= Segmentation().min_points:
            found.append(scan.points_level)
    return found


def is_whole(points: np.ndarray, gap: float) -> bool:
    """Whether one cluster has nearly all of the vessel."""
    clusters, _ = segment(points, Segmentation(gap=gap), HEIGHT)
    return max(map(len, clusters), default=0) > 0.95 * np.count_nonzero(_dry(points))


def _dry(points: np.ndarray) -> np.ndarray:
    return points[:, 2] >= Segmentation().water_band - HEIGHT


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Counts vessels that segmentation keeps whole.")
    parser.add_argument("--count", type=int, default=60, help="vessels a LiDAR (default 60)")
    parser.add_argument("--seed", type=int, default=0, help="of all that is drawn (default 0)")
    args = parser.parse_args()
    seen = {lidar.name: clusters_of(lidar, args.count, args.seed) for lidar in LIDARS}
    print("gap, m    " + "".join(name.rjust(12) for name in [*seen, "together"]))
    for gap in GAPS:
        whole = [sum(is_whole(points, gap) for points in clusters) for clusters in seen.values()]
        totals = [len(clusters) for clusters in seen.values()]
        cells = zip([*whole, sum(whole)], [*totals, sum(totals)], strict=True)
        print(f"{gap:<10g}" + "".join(f"{some} of {all_}".rjust(12) for some, all_ in cells))


if __name__ == "__main__":
    main()
