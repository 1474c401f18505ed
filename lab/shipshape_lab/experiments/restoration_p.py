"""How close each restored cloud comes to the complete surface, on an even subsample of the paper grid P.

    python -m shipshape_lab.experiments.restoration_p --data runs/data --bundle models --out runs/results

Writes OUT/restoration.npz. Everything is compared in the level frame, so an error of the estimated pose counts.
The truth is 16,384 points of the complete outer surface above the water; every cloud is compared as it is,
with as many points as it has (the number is kept beside the scores). `surface` is what 2,048 other points of the
true surface would score: no cloud of about that size can be expected to do better.
"""

import argparse
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape.bundle import load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Pose
from shipshape_lab import metrics
from shipshape_lab.experiments.evaluate_p import write_about
from shipshape_lab.experiments.predictions import digest_of
from shipshape_lab.experiments.systems import BEST, PIPELINES, run_systems
from shipshape_lab.training.examples import Example, Examples

EVERY = 13  # shares no factor with the 360 headings of the grid, so all headings meet all distances
SURFACE_POINTS = 16_384  # as many as PCN's truth, so that its own spacing stays well under 1 % of the extent
REFERENCE_POINTS = 2_048
MIRROR = np.array([1.0, -1.0, 1.0], np.float32)
CLOUDS = ("raw", "mirrored", "mirrored_true_pose", *PIPELINES, "surface")
SCORES = ("cd_l1", "cd_l2", "fscore", "points")


def mirrored(points_level: np.ndarray, pose: Pose) -> np.ndarray:
    """The cloud and its reflection about the centre plane of `pose`, level frame, (2 n, 3)."""
    return np.concatenate([points_level, pose.to_level(pose.to_vessel(points_level) * MIRROR)])


def clouds_of(pipeline: Pipeline, example: Example, contact: Contact) -> dict[str, np.ndarray]:
    """What each system makes of a contact, level frame.

    Raises:
        InvalidInput: the contact cannot be one vessel's cluster.
    """
    runs = run_systems(pipeline, contact)
    points = contact.points_level
    return {
        "raw": points,
        "mirrored": mirrored(points, runs[BEST].work.pose),
        "mirrored_true_pose": mirrored(points, example.pose),
        **{name: runs[name].work.restored.points_level for name in PIPELINES},
    }


def score(clouds: dict[str, np.ndarray], example: Example, rng: np.random.Generator) -> np.ndarray:
    """Scores of each cloud of CLOUDS against the complete surface, (clouds, scores).

    The surface's points come in random order; the reference is drawn from those that are not the truth.
    """
    surface = rng.permutation(example.surface_level)
    count = min(SURFACE_POINTS, len(surface) - REFERENCE_POINTS)
    extent = max(example.pose.size.length, example.pose.size.beam, example.pose.size.height)
    truth = metrics.CompleteSurface(surface[:count], extent)
    clouds = {**clouds, "surface": surface[count : count + REFERENCE_POINTS]}
    return np.array([_scores(truth.nearest(clouds[name]), len(clouds[name])) for name in CLOUDS], np.float32)


def _scores(nearest: metrics.Nearest, points: int) -> tuple[float, ...]:
    return metrics.chamfer_l1(nearest), metrics.chamfer_l2(nearest), metrics.f_score(nearest), points


def evaluate(examples: Examples, pipeline: Pipeline, index: np.ndarray) -> np.ndarray:
    """Scores (M, clouds, scores) of the clusters `index`; NaN where the service refuses the cluster."""
    scores = np.full((len(index), len(CLOUDS), len(SCORES)), np.nan, np.float32)
    for row, i in enumerate(tqdm(index, desc="restoration", mininterval=2.0)):
        example = examples.example(int(i))
        try:
            clouds = clouds_of(pipeline, example, Contact(example.contact.points_level))
        except InvalidInput:
            continue
        scores[row] = score(clouds, example, np.random.default_rng([0, int(i)]))
    return scores


def main(argv: list[str] | None = None) -> None:
    """Command line: one pass over the subsample."""
    args = _parser().parse_args(argv)
    examples, bundle = Examples.read(args.data, "P"), load_bundle(args.bundle)
    index = np.arange(0, len(examples.clusters), args.every)
    path, key = args.out / "restoration.npz", [bundle.digest, digest_of(args.data / "P.npz"), str(args.every)]
    if _finished(path, key):
        print(f"{path} belongs to this bundle and set already")
        return
    scores = evaluate(examples, Pipeline(bundle), index)
    args.out.mkdir(parents=True, exist_ok=True)
    clusters = examples.clusters
    truth = {"range_m": clusters.range_m[index], "aspect_deg": clusters.aspect_deg[index]}
    np.savez_compressed(path, key=key, index=index, scores=scores, **truth)
    write_about(args.out / "restoration.json", bundle, every=args.every, sensor_height="not told")
    for name, (l1, l2, f, points) in zip(CLOUDS, np.nanmean(scores, axis=0), strict=True):
        print(f"{name:<20} CD-L1 {1e3 * l1:7.2f}  CD-L2 {1e3 * l2:7.3f}  F@1% {f:.3f}  {points:6.0f} points")


def _finished(path: Path, key: list[str]) -> bool:
    if not path.exists():
        return False
    with np.load(path, allow_pickle=False) as arrays:
        return arrays["key"].tolist() == key


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.experiments.restoration_p",
        description="Compares restored clouds with the complete surface.",
        epilog="example: python -m shipshape_lab.experiments.restoration_p --data runs/data --out runs/results",
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument("--every", type=int, default=EVERY, help=f"only each Nth cluster (default {EVERY})")
    return parser


if __name__ == "__main__":
    main()
