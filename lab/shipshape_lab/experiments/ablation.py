"""The paper's ablation over r and d_min (its Table 5): accuracy over both, 0.3 to 1.0 m in steps of 0.1.

    python -m shipshape_lab.experiments.ablation --data runs/data --bundle models --out runs/results

Since r and d_min would be chosen by it, it runs on the catalogue's vessels of the validation set, not on P. Every
cluster is restored once (preset `paper`, full_side); only keypoints, SPD2 and classifier run in each cell. The
classifiers are the bundle's, trained with keypoints of r = d_min = 0.5 m: they are not trained again in each cell.
"""

import argparse
from itertools import product
from pathlib import Path

import numpy as np
from tqdm import tqdm

from shipshape.bundle import Bundle, load_bundle
from shipshape.errors import InvalidInput
from shipshape.onnx_model import OnnxModel
from shipshape.pipeline import Pipeline
from shipshape.stages import classification, keypoints, spd2
from shipshape.stages.keypoints import KeypointParams
from shipshape.types import Contact, ImageMethod, Options, Preset
from shipshape_lab.experiments import outcome, predictions
from shipshape_lab.experiments.ablation_figure import draw
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.systems import RAW
from shipshape_lab.simulator.clusters import ClusterSet
from shipshape_lab.training.examples import Examples
from shipshape_lab.training.partial import run_until

STEPS = tuple(round(0.1 * tenth, 1) for tenth in range(3, 11))  # m, of both r and d_min
CELLS = tuple(KeypointParams(radius, spacing) for radius, spacing in product(STEPS, STEPS))
METHOD = ImageMethod.FULL_SIDE
SYSTEMS = (RAW, str(METHOD))


def by_cell(points: np.ndarray, model: OnnxModel, radius: float, classes: int) -> np.ndarray:
    """Most probable vessel in each of CELLS.

    Args:
        points: (n, 3), the cloud in the frame that the classifier was trained in, m.
        model: the classifier.
        radius: of the SPD2 images, m.
        classes: number of the catalogue's vessels, which come first.
    """
    found = np.empty(len(CELLS), np.int8)
    for cell, params in enumerate(CELLS):
        images = spd2.describe(points, keypoints.select_keypoints(points, params), radius)
        found[cell] = np.argmax(classification.mean_confidence(images, model)[:classes])
    return found


def answer(pipeline: Pipeline, points_level: np.ndarray) -> np.ndarray:
    """Answers of both SYSTEMS in each of CELLS, (2, 64).

    Raises:
        InvalidInput: the service refuses the cluster.
    """
    models, classes = pipeline.bundle.models, len(pipeline.bundle.catalogue)
    radius = pipeline.bundle.parameters["common"]["spd2_radius"]
    work = run_until(pipeline, Contact(points_level), Options(Preset.PAPER, METHOD), "lifting")
    restored = work.pose.to_vessel(work.restored.points_level)
    raw = by_cell(work.points_sight, models["prior"], radius, classes)
    return np.stack([raw, by_cell(restored, models[f"spd2_{METHOD}"], radius, classes)])


def run(clusters: ClusterSet, index: np.ndarray, pipeline: Pipeline, path: Path, key: list[str]) -> np.ndarray:
    """Which answers are right, (2, 64, M) bool, kept in `path`; a refused cluster counts as wrong."""
    if path.exists():
        with np.load(path, allow_pickle=False) as kept:
            if kept["key"].tolist() == key:
                return kept["right"]
    right = np.zeros((len(SYSTEMS), len(CELLS), len(index)), np.bool_)
    for column, i in enumerate(tqdm(index, desc="ablation", mininterval=2.0)):
        try:
            right[:, :, column] = answer(pipeline, clusters.cluster(int(i))) == clusters.label[i]
        except InvalidInput:
            continue
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, right=right, key=np.array(key))
    return right


def of_right(right: np.ndarray) -> Numbers:
    """Accuracy in each cell, validation.ablation.SYSTEM.r_50cm_d_50cm, and how far the best leads the served one.

    The standard error of the lead is that of paired answers; chance flatters it, as the best of 64 cells.
    """
    found: Numbers = {"validation.ablation.clusters": int(right.shape[2])}
    for system, answers in zip(SYSTEMS, right, strict=True):
        shares = answers.mean(axis=1)
        best = int(np.argmax(shares))
        gained = answers[best].astype(float) - answers[CELLS.index(KeypointParams())]
        cells = {cell_name(params): float(share) for params, share in zip(CELLS, shares, strict=True)}
        cells |= {"best_r_cm": round(100 * CELLS[best].radius), "best_d_cm": round(100 * CELLS[best].spacing)}
        cells |= {"lead": float(gained.mean()), "lead_error": float(gained.std() / np.sqrt(len(gained)))}
        found |= {f"validation.ablation.{system}.{name}": value for name, value in cells.items()}
    return found


def cell_name(params: KeypointParams) -> str:
    """Slice of a cell in the keys, in centimetres."""
    return f"r_{round(100 * params.radius)}cm_d_{round(100 * params.spacing)}cm"


def measure(data: Path, bundle: Bundle, out: Path, every: int) -> Numbers:
    """Answers and numbers on every N-th catalogue cluster of the validation set."""
    examples = Examples.read(data, "validation", catalogue_only=True)
    key = [bundle.digest, predictions.digest_of(data / "validation.npz"), str(every)]
    index = examples.indices[::every]
    return of_right(run(examples.clusters, index, Pipeline(bundle), out / "ablation.npz", key))


def main(argv: list[str] | None = None) -> None:
    """Measure, write OUT/ablation.json and the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument("--every", type=int, default=2, help="only each Nth cluster (default 2)")
    parser.add_argument(
        "--figures", type=Path, default=Path("docs/figures"), help="folder for figures (default docs/figures)"
    )
    args = parser.parse_args(argv)
    bundle = load_bundle(args.bundle)
    found = measure(args.data, bundle, args.out, args.every)
    path = outcome.write(args.out, "ablation", found, bundle_digest=bundle.digest, every=args.every)
    print(f"wrote {path} and {draw(found, args.figures)}")


if __name__ == "__main__":
    main()
