"""The paper's Experiment 2 on P: which vessel, by classifiers trained on complete and on restored clouds.

    python -m shipshape_lab.experiments.experiment_2 --data runs/data --bundle models --out runs/results

The paper says both: section 3.3.2 trains on complete clouds, section 4.1.2 on restored ones. Clusters are restored
once by each image method, by the service's own stages in preset `paper`; both classifiers read the same SPD2
images. `raw_spd2` is the classifier of the raw cluster. The classifiers of restored clouds come from the
bundle, those of complete clouds from `training.train_complete`. Stopped, it goes on where it was.
"""

import argparse
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
from shipshape_lab.experiments import numbers, outcome, predictions
from shipshape_lab.experiments.experiment_2_figure import draw
from shipshape_lab.experiments.numbers import Numbers
from shipshape_lab.experiments.systems import IMAGE_METHODS, RAW, Run
from shipshape_lab.simulator.clusters import ClusterSet, load

SYSTEMS = (RAW, *IMAGE_METHODS)
TRAINED_ON = ("complete", "restored")
REFUSED, NOT_DONE = -1, -2
SAVE_EVERY = 1000  # clusters


def load_complete(folder: Path) -> dict[str, OnnxModel]:
    """The classifiers trained on complete clouds, by system.

    Raises:
        FileNotFoundError: one is missing.
    """
    files = {RAW: "raw"} | {method: method for method in IMAGE_METHODS}
    paths = {system: folder / f"complete_{name}.onnx" for system, name in files.items()}
    for path in paths.values():
        if not path.exists():
            raise FileNotFoundError(f"expected {path}, found none: run shipshape_lab.training.train_complete")
    return {system: OnnxModel(path) for system, path in paths.items()}


def answer(pipeline: Pipeline, complete: dict[str, OnnxModel], points_level: np.ndarray) -> np.ndarray:
    """Most probable vessel by each of TRAINED_ON and SYSTEMS, (2, 5); REFUSED where the service refuses."""
    answers = np.full((len(TRAINED_ON), len(SYSTEMS)), REFUSED, np.int8)
    try:
        raw = Run(pipeline.begin(Contact(points_level), Options(Preset.PAPER))).through(pipeline, ("prior",))
    except InvalidInput:
        return answers
    answers[1, 0] = np.argmax(raw.work.prior[:-1])
    answers[0, 0] = np.argmax(classification.mean_confidence(_raw_images(pipeline, raw), complete[RAW]))
    paper = raw.branch(Options(Preset.PAPER)).through(pipeline, ("heading", "bow_stern"))
    rest = ("projection", "inpainting", "lifting", "keypoints", "spd2", "classification")
    for column, method in enumerate(ImageMethod, start=1):
        work = paper.branch(Options(Preset.PAPER, method)).through(pipeline, rest).work
        answers[1, column] = np.argmax(work.probabilities[:-1])
        answers[0, column] = np.argmax(classification.mean_confidence(work.images, complete[str(method)]))
    return answers


def _raw_images(pipeline: Pipeline, raw: Run) -> np.ndarray:
    points = raw.work.points_sight
    densest = keypoints.select_keypoints(points, KeypointParams())
    return spd2.describe(points, densest, pipeline.bundle.parameters["common"]["spd2_radius"])


def run_p(clusters: ClusterSet, pipeline: Pipeline, complete: dict, path: Path, key: list[str]) -> np.ndarray:
    """Answers (2, 5, M) of every cluster, kept in `path` on the way."""
    answers = np.full((len(TRAINED_ON), len(SYSTEMS), len(clusters)), NOT_DONE, np.int8)
    if path.exists():
        with np.load(path, allow_pickle=False) as kept:
            answers = kept["answers"] if kept["key"].tolist() == key else answers
    left = np.flatnonzero(answers[0, 0] == NOT_DONE)
    for turn, i in enumerate(tqdm(left, desc="experiment 2", mininterval=2.0), start=1):
        answers[:, :, i] = answer(pipeline, complete, clusters.cluster(int(i)))
        if turn % SAVE_EVERY == 0 or turn == len(left):
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(path, answers=answers, key=np.array(key))
    return answers


def of_answers(answers: np.ndarray, clusters: ClusterSet) -> Numbers:
    """Accuracy of every system, trained either way, by slice: P.accuracy_COMPLETE|RESTORED.SYSTEM.SLICE."""
    masks = numbers.slices(clusters.range_m, clusters.aspect_deg)
    return {
        f"P.accuracy_{trained}.{system}.{part}": float(np.mean(rows[column][mask] == clusters.label[mask]))
        for trained, rows in zip(TRAINED_ON, answers, strict=True)
        for column, system in enumerate(SYSTEMS)
        for part, mask in masks.items()
    }


def measure(data: Path, bundle: Bundle, complete: Path, out: Path) -> Numbers:
    """Answers and numbers on P."""
    clusters = load(data / "P.npz")
    nets = sorted(complete.glob("complete_*.onnx"))
    key = [bundle.digest, predictions.digest_of(data / "P.npz", *nets)]
    answers = run_p(clusters, Pipeline(bundle), load_complete(complete), out / "experiment_2.npz", key)
    return of_answers(answers, clusters)


def main(argv: list[str] | None = None) -> None:
    """Measure, write OUT/experiment_2.json and the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the data sets")
    parser.add_argument("--bundle", type=Path, default=Path("models"), help="model bundle (default models)")
    parser.add_argument(
        "--complete",
        type=Path,
        default=Path("runs/experiment_2/bundle"),
        help="folder of complete_*.onnx (default runs/experiment_2/bundle)",
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for results")
    parser.add_argument(
        "--figures", type=Path, default=Path("docs/figures"), help="folder for figures (default docs/figures)"
    )
    args = parser.parse_args(argv)
    bundle = load_bundle(args.bundle)
    found = measure(args.data, bundle, args.complete, args.out)
    path = outcome.write(
        args.out, "experiment_2", found, bundle_digest=bundle.digest, seed=bundle.training["seed"]
    )
    print(f"wrote {path} and {draw(found, args.figures)}")


if __name__ == "__main__":
    main()
