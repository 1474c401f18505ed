"""Makes contacts.npz, contact.pcd, the package's sample cluster and the console's samples with the simulator.

The same bytes every time.

The hulls are sisters that no model was trained on.

Example:
    python examples/make_contacts.py
"""

import json
import math
from pathlib import Path

import numpy as np
from pypcd4 import Encoding, PointCloud

from shipshape_lab.simulator import recipes
from shipshape_lab.simulator.scan import Conditions, Scan, scan_vessel
from shipshape_lab.simulator.sea import LIGHT_SEA, Placement
from shipshape_lab.simulator.sensor import DEFAULT_LIDAR
from shipshape_lab.simulator.vessels import build_vessel

EXAMPLES = Path(__file__).parent
SAMPLE = EXAMPLES.parent / "service" / "shipshape" / "sample_cluster.npy"
CONSOLE = EXAMPLES.parent / "console" / "public" / "samples"
SENSOR_HEIGHT = 3.0  # m
SEED = 7
PCD = 1  # of the scene, in contact.pcd

# vessel, range in m, bearing and heading in degrees; the last one is in nobody's catalogue
SCENE = (
    ("rhib", 38.4, 35.0, -148.3),
    ("pilot_boat", 63.7, -20.0, 75.6),
    ("fishing_boat", 52.2, 110.0, 20.4),
    ("tug", 84.6, -75.0, 160.7),
    ("patrol_boat", 97.3, 5.0, 178.2),
    ("landing_craft", 71.5, 150.0, -60.9),
)

HARD = (("tug", 60.0, 15.0, 16.0), ("pilot_boat", 185.0, -40.0, 98.0))
REMARKS = {
    ("landing_craft", 71.5): ", in no catalogue",
    ("tug", 60.0): ", seen from astern",
    ("pilot_boat", 185.0): ", far away",
}


def main() -> None:
    """Write the files."""
    rng = np.random.default_rng(SEED)
    scans = [simulate(*contact, rng) for contact in SCENE]
    np.savez_compressed(
        EXAMPLES / "contacts.npz",
        points=np.concatenate([scan.points_level for scan in scans]),
        n=np.array([len(scan.points_level) for scan in scans], np.int32),
        vessel=np.array([name for name, *_ in SCENE]),
        heading=np.array([scan.heading for scan in scans]),
        sensor_height=np.float64(SENSOR_HEIGHT),
    )
    one = PointCloud.from_xyz_points(scans[PCD].points_level)
    one.save(EXAMPLES / "contact.pcd", encoding=Encoding.BINARY)
    sample = simulate("pilot_boat", 50.0, 0.0, 60.0, rng)
    np.save(SAMPLE, thin(sample.points_level, 1000, rng))
    write_console(scans, rng)


def write_console(scans: list[Scan], rng: np.random.Generator) -> None:
    """The same contacts one by one, and what is hard: end-on, and far away."""
    hard = [(scene, simulate(*scene, rng)) for scene in HARD]
    index = []
    for (name, range_m, *_), scan in [*zip(SCENE, scans, strict=True), *hard]:
        file, points = f"{name}_{range_m:.0f}m.npy", scan.points_level
        np.save(CONSOLE / file, points)
        title = name.replace("_", " ").capitalize().replace("Rhib", "RHIB")
        text = f"{range_m:.0f} m, {len(points)} points{REMARKS.get((name, range_m), '')}"
        index.append({"file": file, "title": title, "text": text, "sensor_height_m": SENSOR_HEIGHT})
    (CONSOLE / "samples.json").write_text(json.dumps(index, indent=1) + "\n", encoding="utf-8")


def simulate(name: str, range_m: float, bearing_deg: float, heading_deg: float, rng: np.random.Generator) -> Scan:
    """One vessel in a light sea."""
    placement = Placement(
        range_m=range_m,
        heading=math.radians(heading_deg),
        bearing=math.radians(bearing_deg),
        sensor_height=SENSOR_HEIGHT,
    )
    hull = build_vessel(name, int(rng.choice(recipes.TEST_HULLS)))
    conditions = Conditions(sea=LIGHT_SEA, dropout=0.05)
    return scan_vessel(hull, DEFAULT_LIDAR, placement=placement, conditions=conditions, rng=rng)


def thin(points: np.ndarray, most: int, rng: np.random.Generator) -> np.ndarray:
    """At most so many of the points, in their order."""
    chosen = rng.permutation(len(points))[:most]
    return points[np.sort(chosen)]


if __name__ == "__main__":
    main()
