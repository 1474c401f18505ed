"""Makes the golden clusters and writes down what the shipped bundle says of them.

    python tests/golden/make_golden.py

`clusters.npz`  two clusters of each catalogue vessel: hulls that no training saw, the default sensor in a light
                sea, drawn from SEED; made only where it is missing, so that golden clusters stay golden.
`answers.json`  the answers of both presets of the bundle in models/; made anew by every run. Read its diff
                before committing it: that is what the test is for.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from shipshape.bundle import MANIFEST, load_bundle
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Options, Preset, Recognition

HERE = Path(__file__).parent
CLUSTERS, ANSWERS = HERE / "clusters.npz", HERE / "answers.json"
BUNDLE = HERE.parents[1] / "models"
SEED = 20_260_226
RANGES = ((30.0, 55.0), (55.0, 85.0))  # m, one cluster of each vessel in each
FEWEST_POINTS = 60


def golden_contacts() -> list[tuple[str, float, Contact]]:
    """Vessel and heading of each golden cluster, as they truly are, and the contact."""
    with np.load(CLUSTERS) as golden:
        points = np.split(golden["points"], np.cumsum(golden["n"])[:-1])
        truth = zip(golden["vessel"], golden["heading"], golden["sensor_height"], points, strict=True)
        return [
            (str(vessel), float(heading), Contact(cluster, sensor_height=float(height)))
            for vessel, heading, height, cluster in truth
        ]


def answer(recognition: Recognition) -> dict[str, Any]:
    """What is written down of a recognition: metres, degrees, rounded as a reader would."""
    box = recognition.box
    return {
        "vessel": recognition.vessel,
        "probability": round(recognition.probability, 4),
        "unknown": recognition.unknown,
        "heading_deg": round(math.degrees(recognition.heading), 2),
        "bow_probability": round(recognition.bow_probability, 4),
        "center": [round(value, 3) for value in box.center_level],
        "size": [round(value, 3) for value in (box.size.length, box.size.beam, box.size.height)],
    }


def make_clusters() -> None:
    """Scan the hulls; needs the lab."""
    from shipshape_lab.simulator import recipes  # noqa: PLC0415  the test reads this file without the lab
    from shipshape_lab.simulator.catalogue import DEFAULT  # noqa: PLC0415
    from shipshape_lab.simulator.datasets import hull  # noqa: PLC0415
    from shipshape_lab.simulator.scan import Conditions, scan_vessel  # noqa: PLC0415
    from shipshape_lab.simulator.sea import LIGHT_SEA  # noqa: PLC0415
    from shipshape_lab.simulator.sensor import DEFAULT_LIDAR  # noqa: PLC0415

    rng = np.random.default_rng(SEED)
    scans = []
    for name in DEFAULT.names:
        for band in RANGES:
            vessel, points = hull(name, int(rng.choice(recipes.TEST_HULLS))), np.zeros((0, 3))
            while len(points) < FEWEST_POINTS:
                scan = scan_vessel(
                    vessel,
                    DEFAULT_LIDAR,
                    placement=recipes.draw_placement(band, rng),
                    conditions=Conditions(sea=LIGHT_SEA, dropout=0.05),
                    rng=rng,
                )
                points = scan.points_level
            scans.append(scan)
    np.savez_compressed(
        CLUSTERS,
        points=np.concatenate([scan.points_level for scan in scans]),
        n=np.array([len(scan.points_level) for scan in scans], np.int32),
        vessel=np.array([scan.vessel_name for scan in scans]),
        hull_seed=np.array([scan.vessel_seed for scan in scans], np.int64),
        heading=np.array([scan.heading for scan in scans]),
        range_m=np.array([scan.range_m for scan in scans]),
        aspect_deg=np.array([scan.aspect_deg for scan in scans]),
        sensor_height=np.array([scan.sensor_height for scan in scans]),
    )


def make_answers() -> None:
    """Ask the shipped bundle, and print how far from the truth it is."""
    pipeline = Pipeline(load_bundle(BUNDLE))
    answers: dict[str, list[dict[str, Any]]] = {}
    for preset in Preset:
        answers[preset] = []
        for vessel, heading, contact in golden_contacts():
            said = pipeline.run(contact, Options(preset))
            answers[preset].append(answer(said))
            off = abs(math.degrees(math.remainder(said.heading - heading, math.tau)))
            verdict = "" if said.vessel == vessel and off < 5.0 else "   <- wrong"
            print(f"{preset}: {vessel:16} {said.vessel:16} {said.probability:.3f}  {off:6.1f} deg off{verdict}")
    ANSWERS.write_text(json.dumps({"bundle": pipeline.bundle.digest, **answers}, indent=1) + "\n")


def main() -> None:
    """Make what can be made."""
    if not CLUSTERS.exists():
        make_clusters()
    if not (BUNDLE / MANIFEST).exists():
        raise SystemExit(f"expected a trained bundle in {BUNDLE}, got none: made {CLUSTERS.name} only")
    make_answers()


if __name__ == "__main__":
    main()
