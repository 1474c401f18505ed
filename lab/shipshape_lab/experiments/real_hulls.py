"""What the shipped bundle says of real hulls that nothing was trained on, none of them in its catalogue.

    python -m shipshape_lab.experiments.real_hulls --meshes DIR --bundle models

Each mesh is scanned from 72 sides, 30 to 100 m away, by the default LiDAR. Its type may be in the catalogue (a
RHIB, a tug, a fishing boat), the hull itself is not: "right" is then a matter of opinion, so the table just says
what was answered, and how well heading and bow were found.
"""

import argparse
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape.bundle import UNKNOWN, load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact
from shipshape_lab.metrics import bow_right, heading_error_deg
from shipshape_lab.simulator.mesh_files import load_vessel
from shipshape_lab.simulator.scan import Conditions, scan_vessel
from shipshape_lab.simulator.sea import Placement
from shipshape_lab.simulator.sensor import DEFAULT_LIDAR
from shipshape_lab.simulator.vessel import Vessel

SIDES = 72
DISTANCES = (30.0, 44.0, 58.0, 72.0, 86.0, 100.0)  # m; six of them against 72 sides: every side class at every one


@dataclass
class Answers:
    """What was answered to the scans of one hull."""

    named: Counter = field(default_factory=Counter)
    estimated: list[float] = field(default_factory=list)  # heading, rad
    true: list[float] = field(default_factory=list)


def ask(vessel: Vessel, pipeline: Pipeline, *, seed: int) -> Answers:
    """The pipeline's answers to the hull seen from all sides."""
    answers, rng = Answers(), np.random.default_rng(seed)
    for side in range(SIDES):
        heading = -np.pi + 2 * np.pi * (side + 0.5) / SIDES
        placement = Placement(DISTANCES[side % len(DISTANCES)], heading=heading, bearing=float(rng.uniform(-3, 3)))
        scan = scan_vessel(vessel, DEFAULT_LIDAR, placement=placement, conditions=Conditions(), rng=rng)
        try:
            said = pipeline.run(Contact(scan.points_level))
        except InvalidInput:
            answers.named["refused"] += 1
            continue
        answers.named[UNKNOWN if said.unknown else said.vessel] += 1
        answers.estimated.append(said.heading)
        answers.true.append(heading)
    return answers


def row(name: str, vessel: Vessel, answers: Answers) -> str:
    """One line of the table."""
    said = ", ".join(f"{what} {count / SIDES:.0%}" for what, count in answers.named.most_common())
    found, true = np.array(answers.estimated), np.array(answers.true)
    errors = heading_error_deg(found, true)
    return (
        f"| {name} | {vessel.box[0]:.1f} | {said} | {np.median(errors):.1f} | {np.mean(errors <= 5):.0%} "
        f"| {np.mean(bow_right(found, true)):.0%} |"
    )


def main(argv: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=Path, required=True, help="folder of .ply hulls, metres, bow +x, z up")
    parser.add_argument(
        "--bundle", type=Path, default=Path("models"), help="folder of the bundle (default models)"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of bearings and sensor noise")
    args = parser.parse_args(argv)
    meshes = sorted(args.meshes.glob("*.ply"))
    if not meshes:
        parser.error(f"expected .ply files in {args.meshes}, found none")
    pipeline = Pipeline(load_bundle(args.bundle))
    print("| hull | length, m | answered | heading error, median, deg | within 5 deg | bow right |")
    print("|---|---|---|---|---|---|")
    for path in tqdm(meshes, desc="hulls", leave=False):
        vessel = load_vessel(path)
        tqdm.write(row(path.stem, vessel, ask(vessel, pipeline, seed=args.seed)))


if __name__ == "__main__":
    main()
