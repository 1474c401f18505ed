"""Heading of every cluster by the paper's search, by what a user would take instead, and by preset `best`.

    python -m shipshape_lab.experiments.heading_peers --data runs/data --bundle models --out runs/results

The sensor's height is not told. A set that was done with the same bundle is not done again. Errors are modulo pi;
*swapped* is an error above 45 deg: the width was taken for the length. *Flipped* is a bow that points the opposite
way, for the two that tell bow from stern. A cluster that the service refuses counts as wrong for every method.
"""

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape.bundle import Bundle, load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.stages import heading
from shipshape.types import Contact, Options, Preset, ReferenceBox
from shipshape_lab.experiments import numbers, outcome, predictions
from shipshape_lab.experiments.heading_figure import draw
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.systems import Run
from shipshape_lab.heading_peers import by_l_shape, by_min_area, by_principal_axis
from shipshape_lab.metrics import bow_right, heading_error_deg
from shipshape_lab.simulator.clusters import ClusterSet, load
from shipshape_lab.simulator.vessels import VESSEL_TYPES, build_vessel

SETS = ("P", "H", "far")
METHODS = ("area_projection_told", "paper", "min_area", "pca", "l_shape", "best")
TELL_BOW = ("paper", "best")
BANDS = ((30, 60), (60, 90), (90, 120), (120, 150), (150, 200))  # m, where distances are not those of the grid
SWAPPED_DEG = 45.0


def reference_boxes(clusters: ClusterSet) -> dict[str, ReferenceBox]:
    """The box of each type's nominal hull, of the catalogue and outside of it, metres."""
    others = {name: ReferenceBox(*map(float, build_vessel(name).box)) for name in VESSEL_TYPES}
    return others | {vessel.name: vessel.box for vessel in clusters.vessels}


def headings(pipeline: Pipeline, contact: Contact, box: ReferenceBox) -> list[float]:
    """Heading by each of METHODS, radians, NaN where the service refuses the contact.

    Args:
        pipeline: of the bundle.
        contact: one cluster.
        box: of the vessel's true type, told to `area_projection_told` alone.
    """
    try:
        begun = Run(pipeline.begin(contact, Options()))
    except InvalidInput:
        return [np.nan] * len(METHODS)
    pose = ("prior", "heading", "bow_stern")
    paper, best = (begun.branch(Options(preset)).through(pipeline, pose).work.pose for preset in Preset)
    points = contact.points_level
    told = heading.by_area_projection(points, box)
    free = (by_min_area(points), by_principal_axis(points), by_l_shape(points))
    return [told, paper.heading, *free, best.heading]


def run_set(clusters: ClusterSet, pipeline: Pipeline, key: list[str], path: Path) -> np.ndarray:
    """Headings (methods, M) of a set, kept in `path`."""
    if path.exists():
        with np.load(path, allow_pickle=False) as kept:
            if kept["key"].tolist() == key:
                return kept["headings"]
    boxes = reference_boxes(clusters)
    bar = tqdm(range(len(clusters)), desc=path.stem, mininterval=2.0)
    rows = [headings(pipeline, Contact(clusters.cluster(i)), boxes[clusters.name(i)]) for i in bar]
    found = np.array(rows, np.float32).T  # as exact as the answers that `evaluate` keeps
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, key=np.array(key), headings=found)
    return found


def masks_of(name: str, clusters: ClusterSet) -> dict[str, np.ndarray]:
    """The slices of a set: those of the grid for P; bands of distance for the others."""
    masks = numbers.slices(clusters.range_m, clusters.aspect_deg)
    if name == "P":
        return masks
    masks = {part: mask for part, mask in masks.items() if part == "overall" or not part.endswith("m")}
    for low, high in BANDS:
        inside = (clusters.range_m >= low) & (clusters.range_m < high)
        if inside.any():
            masks[f"{low}_{high}m"] = inside
    return masks


def of_headings(name: str, found: np.ndarray, clusters: ClusterSet) -> Numbers:
    """Median, shares within 5 and 10 deg, swapped and flipped shares of every method and slice."""
    result: Numbers = {f"{name}.heading.clusters": len(clusters)}
    for method, estimated in zip(METHODS, found, strict=True):
        error = heading_error_deg(estimated, clusters.heading)
        flipped = np.isfinite(estimated) & ~bow_right(estimated, clusters.heading)
        for part, mask in masks_of(name, clusters).items():
            end = "" if part == "overall" else f".{part}"
            values = {
                "median_deg": np.nanmedian(error[mask]),
                "within_5deg": np.mean(error[mask] <= 5.0),
                "within_10deg": np.mean(error[mask] <= 10.0),
                "swapped_90": np.mean(error[mask] > SWAPPED_DEG),
            }
            if method in TELL_BOW:
                values["flipped"] = np.mean(flipped[mask])
            result |= {f"{name}.heading.{method}.{what}{end}": float(value) for what, value in values.items()}
    return result


def measure(data: Path, bundle: Bundle, out: Path) -> tuple[Numbers, list[str]]:
    """The numbers of every set that is in `data`, and which those are."""
    pipeline = Pipeline(bundle)
    found: Numbers = {}
    sets = [name for name in SETS if (data / f"{name}.npz").exists()]
    for name in sets:
        clusters = load(data / f"{name}.npz")
        key = [bundle.digest, predictions.digest_of(data / f"{name}.npz")]
        answers = run_set(clusters, pipeline, key, out / f"heading_peers_{name}.npz")
        found |= of_headings(name, answers, clusters)
    return found, sets


def main(argv: list[str] | None = None) -> None:
    """Measure every set, write OUT/heading_peers.json and the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument(
        "--figures", type=Path, default=Path("docs/figures"), help="folder for figures (default docs/figures)"
    )
    args = parser.parse_args(argv)
    bundle = load_bundle(args.bundle)
    found, sets = measure(args.data, bundle, args.out)
    if not sets:
        parser.error(f"expected one of {', '.join(SETS)} in {args.data}, found none")
    path = outcome.write(args.out, "heading_peers", found, bundle_digest=bundle.digest, sets=sets)
    print(f"wrote {path} and {draw(found, args.figures)}")


if __name__ == "__main__":
    main()
