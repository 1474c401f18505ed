"""How close each restored cloud comes to the complete surface, on an even subsample of P or of H.

    python -m shipshape_lab.experiments.restoration --set P --data runs/data --bundle models --out runs/results

Leaves OUT/restoration_p.npz with the scores of every cluster and OUT/restoration_p.json with the means. All is
compared in the level frame, so an error of the estimated pose counts. The truth is 16,384 points of the complete
outer surface above the water; every cloud is compared as it is, with as many points as it has (the number is kept
beside the scores). `surface` is what 2,048 other points of the true surface would score: no cloud of about that
size can be expected to do better. Completion networks, where --completers holds trained ones, are given the
cluster in the pose that `best` estimated.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape.bundle import load_bundle
from shipshape.errors import InvalidInput
from shipshape.pipeline import Pipeline
from shipshape.types import Contact, Pose
from shipshape_lab import metrics
from shipshape_lab.experiments import numbers, outcome
from shipshape_lab.experiments.evaluate import about_bundle
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.predictions import digest_of, digest_of_folder
from shipshape_lab.experiments.systems import BEST, PIPELINES, run_systems
from shipshape_lab.training.examples import Example, Examples

# 13 shares no factor with the 360 headings of the grid, so all headings meet all distances.
EVERY = {"P": 13, "H": 5}
SURFACE_POINTS = 16_384  # as many as PCN's truth, so that its own spacing stays well under 1 % of the extent
REFERENCE_POINTS = 2_048
MIRROR = np.array([1.0, -1.0, 1.0], np.float32)
COMPLETERS = ("pcn", "snowflakenet")
CLOUDS = (BEST, *COMPLETERS, "raw", "mirrored", "mirrored_true_pose", *PIPELINES[1:], "surface")  # as tables show
SCORES = ("cd_l1", "cd_l2", "fscore", "points")


def mirrored(points_level: np.ndarray, pose: Pose) -> np.ndarray:
    """The cloud and its reflection about the centre plane of `pose`, level frame, (2 n, 3)."""
    return np.concatenate([points_level, pose.to_level(pose.to_vessel(points_level) * MIRROR)])


def clouds_of(
    pipeline: Pipeline, example: Example, contact: Contact, completers: Sequence = ()
) -> dict[str, np.ndarray]:
    """What each system makes of a contact, level frame.

    Raises:
        InvalidInput: the contact cannot be one vessel's cluster.
    """
    runs = run_systems(pipeline, contact)
    points, pose = contact.points_level, runs[BEST].work.pose
    return {
        "raw": points,
        "mirrored": mirrored(points, pose),
        "mirrored_true_pose": mirrored(points, example.pose),
        **{name: runs[name].work.restored.points_level for name in PIPELINES},
        **{completer.name: completer.complete(points, pose) for completer in completers},
    }


def score(clouds: dict[str, np.ndarray], example: Example, rng: np.random.Generator) -> dict[str, tuple]:
    """SCORES of each cloud, and of the surface itself, against the complete surface.

    The surface's points come in random order; the reference is drawn from those that are not the truth.
    """
    surface = rng.permutation(example.surface_level)
    count = min(SURFACE_POINTS, len(surface) - REFERENCE_POINTS)
    extent = max(example.pose.size.length, example.pose.size.beam, example.pose.size.height)
    truth = metrics.CompleteSurface(surface[:count], extent)
    clouds = {**clouds, "surface": surface[count : count + REFERENCE_POINTS]}
    return {name: _scores(truth.nearest(cloud), len(cloud)) for name, cloud in clouds.items()}


def _scores(nearest: metrics.Nearest, points: int) -> tuple[float, ...]:
    return metrics.chamfer_l1(nearest), metrics.chamfer_l2(nearest), metrics.f_score(nearest), points


def evaluate(examples: Examples, pipeline: Pipeline, index: np.ndarray, completers: Sequence = ()) -> np.ndarray:
    """Scores (M, clouds, scores) of the clusters `index`; NaN where the service refuses the cluster."""
    scores = np.full((len(index), len(CLOUDS), len(SCORES)), np.nan, np.float32)
    for row, i in enumerate(tqdm(index, desc="restoration", mininterval=2.0)):
        example = examples.example(int(i))
        try:
            clouds = clouds_of(pipeline, example, Contact(example.contact.points_level), completers)
        except InvalidInput:
            continue
        for name, values in score(clouds, example, np.random.default_rng([0, int(i)])).items():
            scores[row, CLOUDS.index(name)] = values
    return scores


def of_scores(name: str, scores: np.ndarray, range_m: np.ndarray, aspect_deg: np.ndarray) -> Numbers:
    """Means of CD-L1 and CD-L2 (both x 1000), F-score@1% and number of points of every cloud on a set."""
    scores = scores.astype(np.float64) * np.array([metrics.REPORTED_FACTOR] * 2 + [1.0, 1.0])
    masks = numbers.slices(range_m, aspect_deg)
    if name != "P":
        masks = {"overall": masks["overall"], **numbers.band_slices(range_m), **numbers.aspect_slices(aspect_deg)}
    found: Numbers = {f"{name}.restoration.clusters": int(np.isfinite(scores[:, 0, 0]).sum())}
    for place, cloud in enumerate(CLOUDS):
        for part, mask in masks.items():
            own = scores[mask, place]
            own = own[np.isfinite(own[:, 0])]
            for what, value in zip(SCORES, own.mean(axis=0) if len(own) else (), strict=False):
                found[f"{name}.{what}.{cloud}{'' if part == 'overall' else f'.{part}'}"] = value
    return found


def load_completers(folder: Path | None) -> list:
    """The trained completion networks of a folder; none without a folder."""
    if folder is None:
        return []
    from shipshape_lab.completion.load import load_completers as load  # noqa: PLC0415  they need torch, the rest does not

    return list(load(folder))


def trainings(args: argparse.Namespace, completers: Sequence) -> tuple[dict[str, str], Numbers]:
    """Schedule of each completion network, and the numbers of how long it was trained."""
    if not completers:
        return {}, {}
    from shipshape_lab.completion.load import training_of  # noqa: PLC0415  it needs torch, the rest does not

    found = {completer.name: training_of(args.completers / completer.name) for completer in completers}
    trained_on: Numbers = {}
    for name, training in found.items():
        trained_on[f"{args.set}.completer.{name}.clusters"] = training.clusters
        trained_on[f"{args.set}.completer.{name}.last_gain"] = training.last_gain
    return {name: training.schedule for name, training in found.items()}, trained_on


def main(argv: list[str] | None = None) -> None:
    """Command line: one pass over the subsample."""
    args = _parser().parse_args(argv)
    examples, bundle = Examples.read(args.data, args.set), load_bundle(args.bundle)
    every, completers = args.every or EVERY[args.set], load_completers(args.completers)
    index = np.arange(0, len(examples.clusters), every)
    path = args.out / f"restoration_{args.set.lower()}.npz"
    trained = digest_of_folder(args.completers) if completers else "none"
    key = [bundle.digest, digest_of(args.data / f"{args.set}.npz"), str(every), trained]
    if not _finished(path, key):
        scores = evaluate(examples, Pipeline(bundle), index, completers)
        args.out.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, key=key, index=index, scores=scores)
    with np.load(path, allow_pickle=False) as arrays:
        truth = examples.clusters.range_m[index], examples.clusters.aspect_deg[index]
        found = of_scores(args.set, arrays["scores"], *truth)
    schedules, trained_on = trainings(args, completers)
    about = {**about_bundle(bundle), "every": every, "sensor_height": "not told", "completers": schedules}
    outcome.write(args.out, path.stem, found | trained_on, **about)
    for cloud in CLOUDS:
        if f"{args.set}.cd_l1.{cloud}" in found:
            l1, l2, f, points = (found[f"{args.set}.{what}.{cloud}"] for what in SCORES)
            print(f"{cloud:<20} CD-L1 {l1:7.2f}  CD-L2 {l2:7.3f}  F@1% {f:.3f}  {points:6.0f} points")


def _finished(path: Path, key: list[str]) -> bool:
    if not path.exists():
        return False
    with np.load(path, allow_pickle=False) as arrays:
        return arrays["key"].tolist() == key


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m shipshape_lab.experiments.restoration",
        description="Compares restored clouds with the complete surface.",
        epilog="example: python -m shipshape_lab.experiments.restoration --set P --data runs/data --out results",
    )
    parser.add_argument("--set", choices=tuple(EVERY), required=True, help="the test set")
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--completers", type=Path, help="folder of trained completion networks; none without it")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument("--every", type=int, help="only each Nth cluster (default 13 of P, 5 of H)")
    return parser


if __name__ == "__main__":
    main()
